"""Files that are whole or not there."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InputError

_PREFIX = ".stereosom-part-"


@contextmanager
def write_whole(path: str | Path) -> Iterator[Path]:
    """Write a file so that it is there whole or not at all, whatever happens meanwhile.

    Parameters
    ----------
    path : path
        The file to write; it is replaced where it exists.

    Yields
    ------
    Path
        A new, empty file in the same folder and with the same suffix. When the block ends it
        is flushed to disk and takes its name; when the block fails it is removed.

    Raises
    ------
    InputError
        Where the folder cannot be written to, or the disk is full.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with write_whole(Path(folder, "tip.txt")) as part:
    ...         _ = part.write_text("12.5")
    ...     [file.name for file in Path(folder).iterdir()]
    ['tip.txt']
    """
    path = Path(path)
    part = path.parent / f"{_PREFIX}{secrets.token_hex(6)}{path.suffix}"
    try:
        part.open("xb").close()
        yield part
        with part.open("rb+") as written:
            os.fsync(written.fileno())
        part.replace(path)
        _flush_folder(path.parent)
    except OSError as error:
        raise InputError(
            path,
            f"cannot be written ({error.strerror or error})",
            "give a folder that exists, may be written to and has room",
        ) from error
    finally:
        if part.is_file():
            part.unlink()


def sweep(folder: str | Path) -> None:
    """Remove what a killed process left half-written in a folder."""
    for part in Path(folder).glob(f"{_PREFIX}*"):
        part.unlink(missing_ok=True)


def _flush_folder(folder: Path) -> None:
    """Bring a new name to disk, on systems where folders can be opened."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
