"""One calibration in every format, written as their public descriptions say.

The truth, worked out by hand. View a: K = [1000, 320; 1000, 240], at the origin. View b:
K = [900, 310; 900, 250], R a turn about y with cosine 0.96 and sine −0.28, T = (−5, 0, 1) mm.
The point (10, 20, 100) mm is seen by a at 320 + 1000·0.1 = 420, 240 + 1000·0.2 = 440. For b it
lies at R X + T = (9.6 − 28 − 5, 20, 2.8 + 96 + 1) = (−23.4, 20, 99.8), so at
310 − 900·23.4/99.8 = 98.9780, 250 + 900·20/99.8 = 430.3607.

Distortion: see `test_lens.py`; a's is (−0.2, 0.05, 0.001, −0.002, 0.01), which shows that point at
418.912625, 438.07525; b's is k1 = 0.1 alone.
"""

import json

import numpy as np

POINT = [[10.0, 20.0, 100.0]]
SEEN_A, SEEN_B = [420.0, 440.0], [98.9780, 430.3607]
BENT_A = [418.912625, 438.07525]
K_A = [[1000.0, 0, 320], [0, 1000, 240], [0, 0, 1]]
K_B = [[900.0, 0, 310], [0, 900, 250], [0, 0, 1]]
D_A, D_B = [-0.2, 0.05, 0.001, -0.002, 0.01], [0.1, 0.0, 0.0, 0.0, 0.0]
R = [[0.96, 0, -0.28], [0, 1, 0], [0.28, 0, 0.96]]
T = [-5.0, 0.0, 1.0]
WITHIN = {"abs": 1e-3}


def _text(values):
    return ", ".join(repr(float(value)) for value in np.ravel(values))


def opencv_matrix(name, values, indent="   "):
    rows, cols = np.atleast_2d(values).shape
    return (
        f"{name}: !!opencv-matrix\n{indent}rows: {rows}\n{indent}cols: {cols}\n{indent}dt: d\n"
        f"{indent}data: [ {_text(values)} ]\n"
    )


def opencv_yaml(names="M1 D1 M2 D2 R T", header="%YAML:1.0\n---\n", size="image"):
    values = [K_A, [D_A], K_B, [D_B], R, np.array([T]).T]
    text = "".join(
        opencv_matrix(name, each) for name, each in zip(names.split(), values, strict=True)
    )
    sizes = {"image": "imageSize: [ 640, 480 ]\n", "two": "image_width: 640\nimage_height: 480\n"}
    return header + sizes.get(size, "") + text


def opencv_xml(names="M1 D1 M2 D2 R T"):
    values = [K_A, [D_A], K_B, [D_B], R, np.array([T]).T]
    text = '<?xml version="1.0"?>\n<opencv_storage>\n<imageSize>640 480</imageSize>\n'
    for name, each in zip(names.split(), values, strict=True):
        rows, cols = np.shape(each)
        text += (
            f'<{name} type_id="opencv-matrix">\n  <rows>{rows}</rows>\n  <cols>{cols}</cols>\n'
            f"  <dt>d</dt>\n  <data>\n    {_text(each).replace(',', '')}</data></{name}>\n"
        )
    return text + "</opencv_storage>\n"


def opencv_json():
    def node(values):
        rows, cols = np.shape(values)
        return {"type_id": "opencv-matrix", "rows": rows, "cols": cols, "dt": "d",
                "data": np.ravel(values).tolist()}  # fmt: skip

    return json.dumps(
        {"imageSize": [640, 480], "M1": node(K_A), "D1": node([D_A]), "M2": node(K_B),
         "D2": node([D_B]), "R": node(R), "T": node(np.array([T]).T)}
    )  # fmt: skip


def scared_frame_data():
    return json.dumps(
        {"camera-pose": np.eye(4).tolist(),
         "camera-calibration": {"KL": K_A, "DL": [D_A], "KR": K_B, "DR": [D_B], "R": R,
                                "T": [[each] for each in T]},
         "timestamp": 0}
    )  # fmt: skip


def stereomis_ini():
    def section(name, k, d):
        lines = [f"[{name}]", "res_x=640", "res_y=480", f"fc_x={k[0][0]}", f"fc_y={k[1][1]}",
                 f"cc_x={k[0][2]}", f"cc_y={k[1][2]}"]  # fmt: skip
        return "\n".join([*lines, *(f"kc_{i}={each}" for i, each in enumerate([*d, 0, 0, 0]))])

    pose = [f"R_{i}={each}" for i, each in enumerate(np.ravel(R))]
    pose += [f"T_{i}={each}" for i, each in enumerate(T)]
    left, right = section("StereoLeft", K_A, D_A), section("StereoRight", K_B, D_B)
    return "\n".join([left, right, *pose]) + "\n"


def ros(k, d, turn, projection, model="plumb_bob"):
    def node(name, values):
        rows, cols = np.shape(values)
        return f"{name}:\n  rows: {rows}\n  cols: {cols}\n  data: [{_text(values)}]\n"

    return (
        "image_width: 640\nimage_height: 480\ncamera_name: stereo\n" + node("camera_matrix", k)
        + f"distortion_model: {model}\n" + node("distortion_coefficients", [d])
        + node("rectification_matrix", turn) + node("projection_matrix", projection)
    )  # fmt: skip


def mayacam(k, turn, moved, size="640,480", drops_zero=False):
    rows = [_text(row).replace(" ", "") for row in k]
    if drops_zero:
        rows[1] = rows[1].partition(",")[2]
    turned = "\n".join(_text(row).replace(" ", "") for row in turn)
    return (
        f"image size\n{size}\n\ncamera matrix\n" + "\n".join(rows)
        + f"\n\nrotation\n{turned}\n\ntranslation\n" + "\n".join(map(str, moved)) + "\n"
    )  # fmt: skip


def bouguet():
    angle = -np.arcsin(0.28)
    return {"KK_left": K_A, "kc_left": np.array([D_A]).T, "KK_right": K_B,
            "kc_right": np.array([D_B]).T, "om": np.array([[0, angle, 0]]).T,
            "T": np.array([T]).T, "nx": 640.0, "ny": 480.0, "R": R,
            "calib_name_left": "left"}  # fmt: skip


def matlab_struct(newer=False):
    """Rows from the left: K transposed, pixels from one; R transposed."""

    def camera(k, d):
        one_based = np.add(k, [[0, 0, 1], [0, 0, 1], [0, 0, 0]])
        named = {"K": one_based} if newer else {"IntrinsicMatrix": one_based.T}
        return {name: each.tolist() for name, each in named.items()} | {
            "RadialDistortion": [d[0], d[1], d[4]], "TangentialDistortion": [d[2], d[3]],
            "ImageSize": [480, 640], "WorldUnits": "millimeters"}  # fmt: skip

    return {"CameraParameters1": camera(K_A, D_A), "CameraParameters2": camera(K_B, D_B),
            "RotationOfCamera2": np.transpose(R).tolist(), "TranslationOfCamera2": T}  # fmt: skip


RTK = """<?xml version="1.0"?>
<!DOCTYPE RTKGEOMETRY>
<RTKThreeDCircularGeometry version="3">
  <SourceToIsocenterDistance>1000</SourceToIsocenterDistance>
  <SourceToDetectorDistance>1536</SourceToDetectorDistance>
  <Projection>
    <GantryAngle>0</GantryAngle>
    <Matrix>
      -1536 0 0 0
      0 -1536 0 0
      0 0 1 -1000
    </Matrix>
  </Projection>
  <Projection>
    <GantryAngle>90</GantryAngle>
    <Matrix>
      0 0 1536 0
      0 -1536 0 0
      1 0 0 -1000
    </Matrix>
  </Projection>
</RTKThreeDCircularGeometry>
"""


def two_view(pitch=18.2):
    """Dots of a tilted 6×6 grid, as both lenses show them, and F by its definition."""
    side = np.arange(6) * pitch / 10
    x, y = np.meshgrid(side, side)
    grid = np.column_stack([x.ravel(), y.ravel(), 0.3 * x.ravel()]) / [np.sqrt(1.09), 1,
                                                                       np.sqrt(1.09)]  # fmt: skip
    space = np.add(grid, [-5, -5, 60])
    rays_b = space @ np.transpose(R) + T
    dots = []
    for k, points in ((K_A, space), (K_B, rays_b)):
        pixels = points @ np.transpose(k)
        dots.append(pixels[:, :2] / pixels[:, 2:])
    cross = np.array([[0, -T[2], T[1]], [T[2], 0, -T[0]], [-T[1], T[0], 0]])
    f = np.linalg.inv(K_B).T @ cross @ np.array(R) @ np.linalg.inv(K_A)
    return {"left": {"intrinsics": K_A}, "right": {"intrinsics": K_B},
            "fundamental": (f / f[2, 2]).tolist(), "dots_left": dots[0].tolist(),
            "dots_right": dots[1].tolist()}  # fmt: skip
