"""Render the stereo endoscope film beside this file: a bending cannula before tissue.

    python data/endoscope/make_film.py

needs numpy, scipy and PyAV, and nothing of this project: lens, projection and curve are written
out here, so that the truth owes nothing to the code that it checks. Rays are cast through the
inverse of the lens, four per pixel; the cannula is the set of points within its radius of the
curve, with a rounded tip.
"""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import cKDTree

HERE = Path(__file__).parent
FRAMES, RATE, SIZE = 40, 20, (640, 360)
RADIUS, WORKING_DISTANCE = 1.0, 60.0  # mm
CRF = "15"

# Intrinsics (px), lens (k1, k2, p1, p2, k3 as OpenCV defines them); X_right = TURN X_left + SHIFT.
EYES = {
    "left": (560.0, 560.6, 322.3, 178.4, (-0.26, 0.09, 0.0006, -0.0004, 0.0)),
    "right": (562.1, 562.9, 317.2, 181.9, (-0.25, 0.08, -0.0005, 0.0003, 0.0)),
}
ANGLES = np.deg2rad([0.2, -1.2, 0.3])  # about x, y, z
SHIFT = np.array([-5.0, 0.04, 0.06])  # mm


def turn():
    """Rotation of the right eye, (3, 3): about x, then y, then z."""
    (a, b, c), (s, t, u) = np.cos(ANGLES), np.sin(ANGLES)
    about_x = np.array([[1, 0, 0], [0, a, -s], [0, s, a]])
    about_y = np.array([[b, 0, t], [0, 1, 0], [-t, 0, b]])
    about_z = np.array([[c, -u, 0], [u, c, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def curve(time):
    """Backbone at a time in 0..1, (n, 3) mm, left eye's axes: x right, y down, z forward.

    Its direction turns with arc length, by rates that change over the film.
    """
    s = np.linspace(0, 66 + 5 * np.sin(2 * np.pi * time), 1201)
    swing, nod = np.sin(2 * np.pi * time), np.cos(2 * np.pi * time)
    share = s / 60
    azimuth = np.deg2rad(203 + (8 + 20 * swing) * share**2)
    elevation = np.deg2rad(8 + (-12 + 16 * nod) * share)
    direction = np.column_stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
         -np.sin(elevation)]
    )  # fmt: skip
    steps = 0.5 * (direction[1:] + direction[:-1]) * np.diff(s)[:, None]
    return np.array([52.0, 24.5, 66.0]) + np.concatenate([[np.zeros(3)], np.cumsum(steps, axis=0)])


def rays(eye):
    """Directions of unit depth through four places of every pixel, (4, rows, columns, 2)."""
    fx, fy, cx, cy, (k1, k2, p1, p2, k3) = EYES[eye]
    row, column = np.mgrid[: SIZE[1], : SIZE[0]].astype(float)
    found = []
    for down in (-0.25, 0.25):
        for right in (-0.25, 0.25):
            seen = np.stack([(column + right - cx) / fx, (row + down - cy) / fy], axis=-1)
            ideal = seen.copy()
            for _ in range(40):  # distorted = ideal * radial + tangential, solved for ideal
                x, y = ideal[..., 0], ideal[..., 1]
                r2 = x * x + y * y
                radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
                tangential = np.stack(
                    [2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                     p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], axis=-1
                )  # fmt: skip
                ideal = (seen - tangential) / radial[..., None]
            found.append(ideal)
    return np.stack(found)


def tissue(generator):
    """A square texture, (n, n, 3) from 0 to 1: red mucosa with darker vessels."""
    n = 1024
    clouds = sum(
        scale * gaussian_filter(generator.standard_normal((n, n)), scale, mode="wrap")
        for scale in (3, 8, 25, 60)
    )
    clouds /= clouds.std()
    ridges = gaussian_filter(generator.standard_normal((n, n)), 22, mode="wrap")
    vessels = np.exp(-((ridges / ridges.std() / 0.06) ** 2))
    base = np.array([0.62, 0.27, 0.22]) * (1 + 0.10 * clouds[..., None])
    return np.clip(base * (1 - 0.35 * vessels[..., None] * [0.6, 1, 1]), 0, 1)


def background(sight, texture, center, axes):
    """What an eye sees without the cannula: directions and colors of all rays."""
    direction = np.concatenate([sight, np.ones((*sight.shape[:-1], 1))], axis=-1) @ axes
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    # A wavy plane 24 mm behind the working distance, lit from the endoscope.
    hit = center + direction * ((WORKING_DISTANCE + 24 - center[2]) / direction[..., 2:])
    for _ in range(3):
        depth = WORKING_DISTANCE + 24 + 2.5 * np.sin(hit[..., 0] / 9) * np.cos(hit[..., 1] / 7)
        hit = center + direction * ((depth - center[2]) / direction[..., 2])[..., None]
    place = [(hit[..., k] * 10 + 512) % 1024 for k in (1, 0)]
    color = np.stack(
        [map_coordinates(texture[..., c], place, order=1, mode="grid-wrap") for c in range(3)], -1
    )
    fall = (80 / np.linalg.norm(hit - center, axis=-1)) ** 2 * direction[..., 2] ** 2
    color = color * fall[..., None]
    slope = np.cos(hit[..., 0] / 9) * np.cos(hit[..., 1] / 7)
    wet = np.clip(slope * fall - 0.8, 0, 0.1)[..., None] / 0.1
    return direction, color + 0.35 * wet


def render(points, sight, behind, center, axes):
    """One picture of an eye, (rows, columns, 3) from 0 to 1; `axes` are its rotation."""
    direction, color = behind
    flat, out = direction.reshape(-1, 3), color.reshape(-1, 3).copy()
    # Rays that pass near the curve, and from there the march along them onto its surface.
    moved = (points - center) @ axes.T
    seen = moved[:, :2] / moved[:, 2:]
    reach = 1.6 * RADIUS / moved[:, 2].min()
    gap = cKDTree(seen).query(sight.reshape(-1, 2), distance_upper_bound=reach)[0]
    active = np.flatnonzero(np.isfinite(gap))
    tree = cKDTree(points)
    t = np.full(len(flat), 40.0)
    touched = np.zeros(len(flat), dtype=bool)
    for _ in range(60):
        gap = tree.query(center + flat[active] * t[active, None])[0] - RADIUS
        touched[active[gap < 2e-3]] = True
        t[active] += gap
        active = active[(gap >= 2e-3) & (t[active] < 110)]
        if len(active) == 0:
            break
    on = np.flatnonzero(touched)
    body = center + flat[on] * t[on, None]
    normal = body - points[tree.query(body)[1]]
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    facing = np.clip(-(normal * flat[on]).sum(-1), 0, 1)[:, None]
    metal = np.array([0.66, 0.72, 0.78]) * (0.30 + 0.62 * facing)
    out[on] = metal + 0.75 * facing**60  # its highlight
    picture = np.clip(out.reshape(color.shape), 0, 1).mean(axis=0)
    return gaussian_filter(picture, (0.6, 0.6, 0))  # the optics' blur


def write_calibration():
    """The calibration as OpenCV's FileStorage writes it."""

    def matrix(name, values):
        values = np.atleast_2d(values)
        data = ", ".join(f"{value:.10g}" for value in values.ravel())
        return (f"{name}: !!opencv-matrix\n   rows: {values.shape[0]}\n"
                f"   cols: {values.shape[1]}\n   dt: d\n   data: [ {data} ]\n")  # fmt: skip

    text = f"%YAML:1.0\n---\nimageWidth: {SIZE[0]}\nimageHeight: {SIZE[1]}\n"
    for number, (fx, fy, cx, cy, lens) in enumerate(EYES.values(), 1):
        text += matrix(f"M{number}", [[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        text += matrix(f"D{number}", lens)
    text += matrix("R", turn()) + matrix("T", SHIFT[:, None])
    (HERE / "calibration.yaml").write_text(text, encoding="utf-8")


def main():
    """Write the films, the calibration and the truth."""
    write_calibration()
    generator = np.random.default_rng(2010)
    texture = tissue(generator)
    standing = {"left": (np.zeros(3), np.eye(3)), "right": (-turn().T @ SHIFT, turn())}
    films = {}
    for eye in EYES:
        container = av.open(str(HERE / f"{eye}.mp4"), "w")
        stream = container.add_stream(
            "libx264", rate=RATE, options={"crf": CRF, "preset": "veryslow"}
        )
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        sight = rays(eye)
        films[eye] = container, stream, sight, background(sight, texture, *standing[eye])
    for frame in range(FRAMES):
        points = curve(frame / FRAMES)
        truth = points[np.linspace(0, len(points) - 1, 121).astype(int)]
        np.savetxt(HERE / f"truth_{frame:03d}.csv", truth, "%.4f", ",", header="x,y,z", comments="")
        for eye, (container, stream, sight, behind) in films.items():
            picture = render(points, sight, behind, *standing[eye])
            noisy = picture + generator.normal(0, 0.008 + 0.012 * picture)
            levels = np.clip(np.rint(noisy * 255), 0, 255).astype(np.uint8)
            shown = av.VideoFrame.from_ndarray(levels, format="rgb24")
            shown = shown.reformat(format="yuv420p", dst_colorspace="ITU709")
            shown.pts, shown.time_base = frame, Fraction(1, RATE)
            container.mux(stream.encode(shown))
        print(f"frame {frame}", flush=True)
    for container, stream, *_ in films.values():
        container.mux(stream.encode())
        container.close()


if __name__ == "__main__":
    main()
