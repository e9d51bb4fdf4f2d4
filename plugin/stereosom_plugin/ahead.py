"""Work ahead: what an iterator yields is made in a process of its own, and taken in order here."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.reduction import ForkingPickler
from typing import Any, TypeVar

T = TypeVar("T")
_ITEM, _ERROR, _END = range(3)
# What waits to be taken may be so much: four frames of 1024², or else one that is slow to fit
# lets the other process idle. Linux gives more to nobody but root.
_WAITING_BYTES = 1 << 20
# The process that works ahead has so long to close what it has open.
_PATIENCE_S = 5.0


def ahead(items: Iterable[T]) -> Iterator[T]:
    """Yield the same as `items`, which another process makes meanwhile, some items ahead.

    As many wait as fit in a megabyte.

    The process is a copy of this one (a fork), so that `items` may be anything; what it yields
    must be picklable. Where there is no fork, or but one processor, it is this process that
    works. An error of `items` is raised here, after the items before it. The process ends with
    the generator.

    Examples
    --------
    >>> list(ahead(number**2 for number in range(4)))
    [0, 1, 4, 9]
    """
    if not _can_fork():
        yield from items
        return
    context: Any = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    _widen(sender)
    process = context.Process(target=_make, args=(items, receiver, sender), daemon=True)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()  # what waits there would be written twice
    opencv = sys.modules.get("cv2")
    threads = opencv.getNumThreads() if opencv else 0
    if opencv:
        opencv.setNumThreads(1)  # the copy would wait for threads that it does not have
    with warnings.catch_warnings():
        # Python 3.12 warns where libraries hold threads; none of them is used in the copy.
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    sender.close()
    try:
        while True:
            try:
                kind, content = receiver.recv()
            except EOFError:
                process.join()
                raise RuntimeError(
                    f"the process that works ahead ended ({process.exitcode})"
                ) from None
            if kind == _END:
                break
            if kind == _ERROR:
                raise content
            yield content
    finally:
        receiver.close()
        process.terminate()
        process.join(_PATIENCE_S)
        process.kill()  # where it waits for something that never comes
        process.join()
        if opencv:
            opencv.setNumThreads(threads)


def _widen(sender: Connection) -> None:
    """Let some items wait in a pipe, so that a slow one on either side holds up nobody."""
    import fcntl

    with suppress(OSError):  # a system may allow less
        fcntl.fcntl(sender.fileno(), fcntl.F_SETPIPE_SZ, _WAITING_BYTES)


def _can_fork() -> bool:
    """Whether a copy of this process is to be had, and would run beside it."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return sys.platform == "linux" and (count or 1) > 1


def _make(items: Iterable[Any], receiver: Connection, sender: Connection) -> None:
    """In the copy: send what is made; the pipe, when full, holds it back."""
    # What was left for collection before would, when freed here, wait for threads that it lacks.
    gc.freeze()
    receiver.close()
    # The other process hears the interrupt, too, and ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # so that what is open is closed
    try:
        try:
            for item in items:
                sender.send((_ITEM, item))
            sender.send((_END, None))
        except BrokenPipeError:
            raise
        except Exception as error:
            try:
                ForkingPickler.loads(ForkingPickler.dumps(error))
            except Exception:  # an error of another library that cannot pass
                error = RuntimeError(f"{type(error).__name__}: {error}")
            sender.send((_ERROR, error))
    except BrokenPipeError:  # nobody waits for it any more
        pass
