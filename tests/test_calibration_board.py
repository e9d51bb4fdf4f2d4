"""Calibration from pictures of a board: drawn ray by ray, with lenses, and found again."""

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from stereosom_plugin.calibration.board import calibrate
from stereosom_plugin.cli import main
from stereosom_plugin.errors import InputError

cv2 = pytest.importorskip("cv2")

SIZE, SQUARE, FINER = (480, 360), 4.0, 2
K = [np.array([[500.0, 0, 235], [0, 505, 178], [0, 0, 1]]),
     np.array([[495.0, 0, 242], [0, 498, 183], [0, 0, 1]])]  # fmt: skip
D = [np.array([-0.2, 0.05, 0.001, -0.001, 0]), np.array([-0.15, 0.02, 0, 0.001, 0])]
TURN, MOVED = Rotation.from_rotvec([0.01, -0.05, 0.005]).as_matrix(), np.array([-5.0, 0.1, 0.05])


def rays(side):
    """Of every quarter of a pixel, by OpenCV's own undistortion."""
    x, y = ((np.arange(length * FINER) + 0.5) / FINER - 0.5 for length in SIZE)
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 1, 2)
    flat = cv2.undistortPoints(pixels, K[side], D[side])[:, 0]
    return np.column_stack([flat, np.ones(len(flat))])


def chessboard(u, v):
    """9×6 inner corners: 10×7 fields."""
    return ((np.floor(u) + np.floor(v)) % 2 == 0) & (u >= -1) & (u < 9) & (v >= -1) & (v < 6)


def circles(u, v):
    """9×6 discs in rows and columns."""
    column, row = np.clip(np.rint(u), 0, 8), np.clip(np.rint(v), 0, 5)
    return np.hypot(u - column, v - row) < 0.28


def asymmetric_circles(u, v):
    """Rows of 4 discs two fields apart, every other row moved by one; 9 rows."""
    row = np.clip(np.rint(v), 0, 8)
    column = np.clip(np.rint((u - row % 2) / 2), 0, 3) * 2 + row % 2
    return np.hypot(u - column, v - row) < 0.35


def picture(seen, turn, moved, pattern=chessboard):
    """A board on the plane z = 0 of its own axes, dark on light."""
    plane = np.linalg.inv(np.column_stack([turn[:, 0], turn[:, 1], moved]))
    at = seen @ plane.T
    dark = pattern(*(at[:, :2] / at[:, 2:]).T / SQUARE)
    fine = np.where(dark, 30.0, 220.0).reshape(SIZE[1], FINER, SIZE[0], FINER)
    return Image.fromarray(fine.mean(axis=(1, 3)).round().astype(np.uint8))


def take(folder, pattern, pairs, middle):
    """Pairs of pictures in two folders, of a board about whose middle (mm) both turn."""
    chance, seen = np.random.default_rng(1), [rays(0), rays(1)]
    for name in ("left", "right"):
        (folder / name).mkdir()
    for index in range(pairs):
        turn = Rotation.from_rotvec(chance.uniform(-0.45, 0.45, 3)).as_matrix()
        center = [chance.uniform(-6, 6), chance.uniform(-4, 4), chance.uniform(55, 75)]
        moved = center - turn @ middle
        picture(seen[0], turn, moved, pattern).save(folder / "left" / f"{index:02d}.png")
        other = picture(seen[1], TURN @ turn, TURN @ moved + MOVED, pattern)
        other.save(folder / "right" / f"{index:02d}.png")
    return folder


@pytest.fixture(scope="module")
def boards(tmp_path_factory):
    """Ten pairs of pictures of a chessboard."""
    return take(tmp_path_factory.mktemp("boards"), chessboard, 10, [16, 10, 0])


@pytest.mark.parametrize(
    ("name", "drawn", "board", "middle"),
    [
        ("circles", circles, (9, 6), [16, 10, 0]),
        ("asymmetric-circles", asymmetric_circles, (4, 9), [14, 16, 0]),
    ],
)
def test_circles_do_as_well(tmp_path, name, drawn, board, middle):
    take(tmp_path, drawn, 6, middle)
    folders = tmp_path / "left", tmp_path / "right"
    found, table = calibrate(*folders, board=board, square=SQUARE, pattern=name)
    # The middle of an ellipse is not the picture of the disc's middle: a little is lost.
    assert found.rigs[0].baseline == pytest.approx(np.linalg.norm(MOVED), rel=0.02)
    assert found.rigs[0].a.focal_length == pytest.approx(502.5, rel=0.02)
    assert len(table) == 6


def test_a_drawn_rig_is_found_again(boards):
    found, table = calibrate(boards / "left", boards / "right", board=(9, 6), square=SQUARE)
    rig = found.rigs[0]
    assert rig.baseline == pytest.approx(np.linalg.norm(MOVED), rel=0.005)
    assert rig.convergence_deg == pytest.approx(np.degrees(np.arccos(TURN[2, 2])), abs=0.2)
    assert rig.a.focal_length == pytest.approx(502.5, rel=0.005)
    assert rig.b.focal_length == pytest.approx(496.5, rel=0.005)
    # By how much the lens moves a ray, it says to a tenth of a pixel.
    ray = np.array([[0.19, 0.12, 1.0]])
    bends = found.lenses[0].distort(rig.a.project(60 * ray)) - rig.a.project(60 * ray)
    bent = cv2.projectPoints(ray, np.zeros(3), np.zeros(3), K[0], D[0])[0].ravel()
    assert bends[0] == pytest.approx(bent - K[0][:2] @ ray[0], abs=0.1)
    assert len(table) == 10
    assert max(max(row.left_px, row.right_px) for row in table) < 0.15
    assert found.notes == ()


def test_a_poor_calibration_says_so(boards, tmp_path):
    """The right pictures of other instants: nothing fits."""
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
    for index in range(4):
        (tmp_path / "left" / f"{index}.png").write_bytes(
            (boards / "left" / f"{index:02d}.png").read_bytes()
        )
        (tmp_path / "right" / f"{index}.png").write_bytes(
            (boards / "right" / f"{(index + 1) % 4:02d}.png").read_bytes()
        )
    found, _ = calibrate(tmp_path / "left", tmp_path / "right", board=(9, 6), square=SQUARE)
    assert any("poor" in note for note in found.notes)
    assert any("4 pairs are few" in note for note in found.notes)


def test_pictures_without_the_board_are_refused(tmp_path):
    for index in range(3):
        Image.new("L", SIZE, 100).save(tmp_path / f"{index}.png")
    with pytest.raises(InputError, match=r"chessboard in 0 of 3 pairs; .*inner corners"):
        calibrate(tmp_path, tmp_path, board=(9, 6), square=SQUARE)


def test_pictures_that_do_not_pair_or_are_none(boards, tmp_path):
    (tmp_path / "few").mkdir()
    with pytest.raises(InputError, match="hold 10 and 0 pictures"):
        calibrate(boards / "left", tmp_path / "few", board=(9, 6), square=SQUARE)
    (tmp_path / "few" / "a.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match="cannot be read"):
        calibrate(tmp_path / "few", tmp_path / "few", board=(9, 6), square=SQUARE)
    with pytest.raises(InputError, match="is no board"):
        calibrate(tmp_path / "few", tmp_path / "few", board=(1, 6), square=SQUARE)


def test_the_command_prints_the_error_of_each_picture(boards, tmp_path, capsys):
    folders = [str(boards / name) for name in ("left", "right")]
    words = ["rig", "--calibrate", *folders, "--board", "9x6", "--square", "4"]
    assert main([*words, "--output", str(tmp_path / "rig.json")]) == 0
    said = capsys.readouterr().out
    assert said.count(".png, ") == 10
    assert "baseline 5.0" in said
    assert (tmp_path / "rig.json").is_file()
