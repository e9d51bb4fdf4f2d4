"""The output folder: every frame's file whole or absent, a row per frame, a run that resumes."""

from __future__ import annotations

import csv
import io
import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from stereosom.camera import StereoRig
from stereosom.reconstruction import Reconstruction

from .calibration import write_rig
from .errors import InputError
from .files import sweep, write_whole
from .lens import Lens
from .polydata import write_markups, write_pvd, write_vtp

COLUMNS = (
    "frame", "time_s", "status", "length_mm", "tip_x_mm", "tip_y_mm", "tip_z_mm",
    "residual_a_px", "residual_b_px", "sigma_mm", "reason",
)  # fmt: skip
RECORD, TABLE, SERIES, RIG, MARKUPS = (
    "run.json", "centerlines.csv", "centerlines.pvd", "rig.json", "centerline.mrk.json",
)  # fmt: skip
_PICTURES = ("scene.png", "overlay_a.png", "overlay_b.png")
DICOM_CENTERLINES, DICOM_MASKS = "centerlines.dcm", ("masks_a.dcm", "masks_b.dcm")
_OURS = re.compile(
    "|".join([r"centerline_\d{4,}\.vtp", *map(re.escape, (RECORD, TABLE, SERIES, RIG, MARKUPS)),
              *map(re.escape, (*_PICTURES, DICOM_CENTERLINES, *DICOM_MASKS))])
)  # fmt: skip

Row = dict[str, str]


def centerline_path(folder: Path, frame: int) -> Path:
    """Where the `.vtp` of a frame stands in an output folder."""
    return folder / f"centerline_{frame:04d}.vtp"


class OutputFolder:
    """Where one run's results go.

    Opening it writes nothing. `begin` makes the folder, or finds out what an interrupted run
    of the same call has left to do. Each `commit` writes a frame's `.vtp` before its row, so
    that a row always names a file that is whole, however the process ends.

    Parameters
    ----------
    path : path
    record : mapping
        What identifies the call (inputs by hash, options); written to `run.json`.

    Raises
    ------
    InputError
        Where `path` is a file.
    """

    def __init__(self, path: str | Path, record: Mapping[str, Any]) -> None:
        self.path = Path(path)
        self.record = json.loads(json.dumps(record))
        self.rows: list[Row] = []
        if self.path.exists() and not self.path.is_dir():
            raise InputError(path, "is a file, not a folder", "give --output another name")

    def begin(
        self,
        rigs: Sequence[StereoRig],
        *,
        lenses: tuple[Lens, Lens] | None = None,
        overwrite: bool = False,
    ) -> None:
        """Make the folder ready, and read back the rows that an interrupted run has left.

        Raises
        ------
        InputError
            Where it holds something else and `overwrite` is not given, or cannot be written.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            sweep(self.path)
            left = {file.name for file in self.path.iterdir()}
            if overwrite:
                for name in filter(_OURS.fullmatch, left):
                    (self.path / name).unlink()
            elif left and not self._is_ours():
                raise InputError(
                    self.path,
                    "holds the results of another call, or other files",
                    "give an empty folder to --output, or --overwrite",
                )
            else:
                self.rows = self._committed_rows()
        except OSError as error:
            raise InputError(
                self.path,
                f"cannot be written ({error.strerror or error})",
                "give --output a folder that can",
            ) from None
        self._write_json(RECORD, self.record)
        write_rig(rigs, self.path / RIG, lenses)
        table = io.StringIO(newline="")
        writer = csv.DictWriter(table, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.rows)
        with write_whole(self.path / TABLE) as part:
            part.write_text(table.getvalue(), encoding="utf-8")

    @property
    def frames_done(self) -> set[int]:
        """Numbers of the frames that have a row."""
        return {int(row["frame"]) for row in self.rows}

    def commit(self, result: Reconstruction, **described: Any) -> None:
        """Write one frame: its `.vtp` where there is a curve, then its row.

        `described` as in `polydata.to_polydata`.
        """
        if result.ok:
            write_vtp(result, centerline_path(self.path, result.index), **described)
        row = _row(result)
        line = io.StringIO(newline="")
        csv.DictWriter(line, COLUMNS, lineterminator="\n").writerow(row)
        try:
            # One write call: a row is appended whole, or the process was killed before it.
            with open(self.path / TABLE, "ab", buffering=0) as table:
                table.write(line.getvalue().encode("utf-8"))
                os.fsync(table.fileno())
        except OSError as error:
            raise InputError(
                self.path / TABLE,
                f"cannot be written ({error.strerror})",
                "make room and run the same call again: it goes on where it stopped",
            ) from None
        self.rows.append(row)

    def finish(self) -> None:
        """Write the time series of all frames that have a curve."""
        entries = [
            (float(row["time_s"]), centerline_path(self.path, int(row["frame"])).name)
            for row in sorted(self.rows, key=lambda row: int(row["frame"]))
            if row["status"] in ("ok", "predicted")
        ]
        write_pvd(entries, self.path / SERIES)

    def write_markups(self, result: Reconstruction) -> None:
        """Write a curve that 3D Slicer edits."""
        write_markups(result, self.path / MARKUPS)

    def _is_ours(self) -> bool:
        try:
            left = json.loads((self.path / RECORD).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return False
        same = ("command", "inputs", "options")
        return isinstance(left, dict) and all(left.get(k) == self.record.get(k) for k in same)

    def _committed_rows(self) -> list[Row]:
        try:
            text = (self.path / TABLE).read_text(encoding="utf-8")
        except FileNotFoundError:
            return []
        whole = text[: text.rfind("\n") + 1]  # a killed write may leave a torn last line
        rows = [row for row in csv.DictReader(io.StringIO(whole)) if None not in row.values()]
        return [
            row
            for row in rows
            if row["status"] in ("lost", "failed")
            or centerline_path(self.path, int(row["frame"])).exists()
        ]

    def _write_json(self, name: str, content: Mapping[str, Any]) -> None:
        with write_whole(self.path / name) as part:
            part.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def read_table(folder: str | Path) -> list[Row]:
    """Rows of a folder's `centerlines.csv`.

    Raises
    ------
    InputError
        Where the folder holds none.
    """
    try:
        with open(Path(folder) / TABLE, encoding="utf-8", newline="") as table:
            rows = list(csv.DictReader(table))
    except OSError:
        raise InputError(
            folder, f"holds no {TABLE}", "give a folder that stereosom has written"
        ) from None
    if rows and not set(COLUMNS) <= set(rows[0]):
        raise InputError(Path(folder) / TABLE, "lacks columns", "run the reconstruction again")
    return rows


def _row(result: Reconstruction) -> Row:
    row = dict.fromkeys(COLUMNS, "")
    row |= {
        "frame": str(result.index),
        "time_s": f"{result.time:.6f}",
        "status": result.status,
        "reason": result.reason,
    }
    if result.backbone is not None and result.residuals is not None:
        x, y, z = result.backbone.tip
        sigma = result.standard_deviation_at([result.backbone.length])[0]
        row |= {
            "length_mm": f"{result.backbone.length:.4f}",
            "tip_x_mm": f"{x:.4f}",
            "tip_y_mm": f"{y:.4f}",
            "tip_z_mm": f"{z:.4f}",
            "residual_a_px": f"{result.residuals[0]:.4f}",
            "residual_b_px": f"{result.residuals[1]:.4f}",
            "sigma_mm": f"{sigma:.4f}",
        }
    return row
