"""Small stereo recordings with their calibration: a flat wall of random blots before two eyes.

Eyes of focal length 300 px, 5 mm apart, see a wall at 75 mm: what the left one sees at x, the
right one sees at x − 300·5/75 = x − 20, in the same row.
"""

from fractions import Fraction

import av
import numpy as np
from scipy.ndimage import gaussian_filter

SIZE, SHIFT = (320, 180), 20


def wall(seed=0):
    """Both eyes' pictures of one instant, (180, 320, 3) bytes each."""
    width, height = SIZE
    blots = np.random.default_rng(seed).standard_normal((height, width + SHIFT, 3))
    smooth = gaussian_filter(blots, (2, 2, 0))
    picture = np.clip(128 + 45 * smooth / smooth.std(), 0, 255).astype(np.uint8)
    return picture[:, :width].copy(), picture[:, SHIFT:].copy()


def marked(number, size=SIZE):
    """A picture that tells its number: all of it is so bright."""
    return np.full((size[1], size[0], 3), number, dtype=np.uint8)


def calibration(size=SIZE, lens=(0, 0, 0, 0, 0), rectified=False, turned_deg=0.0):
    """The two eyes in OpenCV's words; `turned_deg` rolls the right eye."""
    width, height = size

    def matrix(name, values):
        rows, cols = np.atleast_2d(values).shape
        data = ", ".join(f"{value:.10g}" for value in np.ravel(values))
        return (f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n"
                f"   data: [ {data} ]\n")  # fmt: skip

    intrinsics = [[300, 0, width / 2], [0, 300, height / 2], [0, 0, 1]]
    c, s = np.cos(np.deg2rad(turned_deg)), np.sin(np.deg2rad(turned_deg))
    text = f"%YAML:1.0\n---\nimageSize: [ {width}, {height} ]\n"
    for eye in "12":
        text += matrix(f"M{eye}", intrinsics) + matrix(f"D{eye}", [lens])
    text += matrix("R", [[c, -s, 0], [s, c, 0], [0, 0, 1]]) + matrix("T", [[-5], [0], [0]])
    if rectified:
        for eye, shift in (("1", 0), ("2", -1500)):
            projection = [[300, 0, width / 2, shift], [0, 300, height / 2, 0], [0, 0, 1, 0]]
            text += matrix(f"R{eye}", np.eye(3)) + matrix(f"P{eye}", projection)
    return text


def write_film(path, pictures, rate=20, stamps=None, codec="ffv1", pixels="bgr0"):
    """Pictures, (rows, columns, 3) bytes, without loss; `stamps` count steps of 1/rate s."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate)
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = pixels
        for number, picture in enumerate(pictures):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
            frame.pts = number if stamps is None else stamps[number]
            frame.time_base = Fraction(1, rate)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def stacked(left, right, layout):
    """One picture that holds both eyes."""
    if layout == "side-by-side":
        return np.hstack([left, right])
    if layout == "top-bottom":
        return np.vstack([left, right])
    lines = np.empty((2 * len(left), *left.shape[1:]), dtype=left.dtype)
    lines[::2], lines[1::2] = left, right
    return lines
