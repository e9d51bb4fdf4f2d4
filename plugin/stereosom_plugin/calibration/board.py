"""A stereo calibration from pictures of a chessboard or a grid of circles, by OpenCV."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Floats

from ..errors import InputError, require
from .model import Calibration, View, assemble, lens_of

Pattern = Literal["chessboard", "circles", "asymmetric-circles"]
SUFFIXES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp"}
FEWEST_PAIRS, ENOUGH_PAIRS = 3, 10
POOR_PX = 1.0
_MOST_PIXELS, _MOST_PICTURES = 8192**2, 500


@dataclass(frozen=True)
class PictureError:
    """RMS reprojection error of one pair of pictures, px."""

    left: str
    right: str
    left_px: float
    right_px: float


def calibrate(
    left: str | Path,
    right: str | Path,
    *,
    board: tuple[int, int],
    square: float,
    pattern: Pattern = "chessboard",
) -> tuple[Calibration, tuple[PictureError, ...]]:
    """Calibrate two cameras by pictures that both took of one board at the same instants.

    Parameters
    ----------
    left, right : path
        Folders of pictures, paired in order of their names.
    board : (int, int)
        Inner corners (or circles) in a row, and rows.
    square : float
        mm between neighboring corners or circles.
    pattern : {'chessboard', 'circles', 'asymmetric-circles'}

    Returns
    -------
    Calibration
        With notes on pictures that were left out or fit badly.
    tuple of PictureError
        Of each pair in which the board was found.

    Raises
    ------
    InputError
        Where the pictures do not pair, differ in size, or show too few boards.
    """
    if pattern not in get_args(Pattern):
        raise InputError("--pattern", f"{pattern!r} is unknown", "give chessboard or circles")
    if min(board) < 3 or max(board) > 100 or not 0 < square < float("inf"):
        raise InputError(
            "--board, --square",
            f"{board[0]}x{board[1]} of {square:g} mm is no board",
            "give inner corners per row and column, and their distance in mm",
        )
    cv2 = require("cv2", "endoscopy")
    pairs = _pairs(Path(left), Path(right))
    size: tuple[int, int] | None = None
    found: list[tuple[Any, Any]] = []
    used, missed = [], []
    for pair in pairs:
        pictures = [_gray(file) for file in pair]
        for file, picture in zip(pair, pictures, strict=True):
            size = size or picture.shape[::-1]
            if picture.shape[::-1] != size:
                raise InputError(
                    file,
                    f"is {picture.shape[1]}×{picture.shape[0]} px, others {size[0]}×{size[1]}",
                    "give pictures of one size",
                )
        corners = [_corners(cv2, picture, board, pattern) for picture in pictures]
        if corners[0] is None or corners[1] is None:
            missed.append(pair[0].name)
            continue
        found.append((corners[0], _same_order(corners[0], corners[1])))
        used.append(pair)
    if len(found) < FEWEST_PAIRS or size is None:
        raise InputError(
            f"{left}, {right}",
            f"show a {board[0]}×{board[1]} {pattern} in {len(found)} of {len(pairs)} pairs",
            f"give {ENOUGH_PAIRS} or more pairs, and count the inner corners for --board",
        )
    a, b, errors = _solve(cv2, found, _points(board, square, pattern), size)
    table = tuple(
        PictureError(pair[0].name, pair[1].name, float(error[0]), float(error[1]))
        for pair, error in zip(used, errors, strict=True)
    )
    source = f"{pattern} {board[0]}×{board[1]}, {len(found)} pairs, by OpenCV"
    try:
        return assemble(a, b, source, notes=_notes(table, missed)), table
    except ValueError as error:
        raise InputError(
            f"{left}, {right}", f"give no rig ({error})", "take the board at more angles"
        ) from None


def _notes(table: Sequence[PictureError], missed: list[str]) -> list[str]:
    notes = []
    if missed:
        notes.append(f"the board was not found in {len(missed)} pairs: {', '.join(missed[:5])}")
    if len(table) < ENOUGH_PAIRS:
        notes.append(f"{len(table)} pairs are few; {ENOUGH_PAIRS} or more are better")
    worst = max(table, key=lambda row: max(row.left_px, row.right_px))
    overall = float(np.sqrt(np.mean([(row.left_px**2 + row.right_px**2) / 2 for row in table])))
    if overall > POOR_PX:
        notes.append(
            f"the calibration is poor: {overall:.2f} px RMS reprojection error, most in "
            f"{worst.left}; leave blurred and wrongly found boards out"
        )
    elif max(worst.left_px, worst.right_px) > 3 * overall:
        notes.append(f"{worst.left} fits much worse than the others; look at it")
    return notes


def _solve(
    cv2: Any, found: list[tuple[Any, Any]], points: Floats, size: tuple[int, int]
) -> tuple[View, View, Floats]:
    """Each camera by itself, then both together from there (OpenCV, `stereoCalibrate`)."""
    world = [points.astype(np.float32)] * len(found)
    seen = [[pair[side].astype(np.float32) for pair in found] for side in (0, 1)]
    try:
        single = [cv2.calibrateCamera(world, corners, size, None, None) for corners in seen]
        _, k1, d1, k2, d2, turn, moved, _, _, _, _, errors = cv2.stereoCalibrateExtended(
            world, seen[0], seen[1], single[0][1], single[0][2], single[1][1], single[1][2],
            size, np.eye(3), np.zeros(3), flags=cv2.CALIB_USE_INTRINSIC_GUESS,
        )  # fmt: skip
    except cv2.error as error:
        raise InputError(
            "--calibrate", f"OpenCV finds no cameras ({str(error).split(':')[-1].strip()[:100]})",
            "take the board at more angles and distances",
        ) from None  # fmt: skip
    a = View(k1, np.eye(3), np.zeros(3), size, lens_of(k1, np.ravel(d1)))
    b = View(k2, turn, np.ravel(moved), size, lens_of(k2, np.ravel(d2)))
    return a, b, np.asarray(errors).reshape(-1, 2)


def _corners(
    cv2: Any, picture: npt.NDArray[np.uint8], board: tuple[int, int], pattern: Pattern
) -> Any:
    if pattern == "chessboard":
        ok, corners = cv2.findChessboardCornersSB(picture, board)
    else:
        symmetric = pattern == "circles"
        flags = cv2.CALIB_CB_SYMMETRIC_GRID if symmetric else cv2.CALIB_CB_ASYMMETRIC_GRID
        ok, corners = cv2.findCirclesGrid(picture, board, flags=flags)
    return corners.reshape(-1, 2) if ok else None


def _same_order(left: Any, right: Any) -> Any:
    """A board may be found from its other end: both eyes must name its corners alike."""
    turned = (left[-1] - left[0]) @ (right[-1] - right[0]) < 0
    return right[::-1].copy() if turned else right


def _points(board: tuple[int, int], square: float, pattern: Pattern) -> Floats:
    """Corners of the board, (n, 3), mm, row by row."""
    row, column = np.divmod(np.arange(board[0] * board[1]), board[0])
    x = 2 * column + row % 2 if pattern == "asymmetric-circles" else column
    return np.asarray(np.column_stack([x, row, 0 * row]) * square, dtype=np.float64)


def _pairs(left: Path, right: Path) -> list[tuple[Path, Path]]:
    files = []
    for folder in (left, right):
        if not folder.is_dir():
            raise InputError(folder, "is no folder", "give two folders of pictures of the board")
        files.append(sorted(f for f in folder.iterdir() if f.suffix.lower() in SUFFIXES))
    if len(files[0]) != len(files[1]) or not 0 < len(files[0]) <= _MOST_PICTURES:
        raise InputError(
            f"{left}, {right}",
            f"hold {len(files[0])} and {len(files[1])} pictures",
            f"give as many of both eyes, {FEWEST_PAIRS} to {_MOST_PICTURES}",
        )
    return list(zip(*files, strict=True))


def _gray(file: Path) -> npt.NDArray[np.uint8]:
    pillow = require("PIL.Image", "endoscopy")
    try:
        with pillow.open(file) as picture:
            if picture.width * picture.height > _MOST_PIXELS:
                raise InputError(file, "is larger than 8192×8192", "give a camera's picture")
            return np.asarray(picture.convert("L"), dtype=np.uint8)
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, pillow.DecompressionBombError) as error:
        raise InputError(file, f"cannot be read ({error})", "give a whole picture") from None
