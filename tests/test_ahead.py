"""What is made ahead comes in order, with its errors, and leaves no process behind."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time

import numpy as np
import pytest

from stereosom.options import Options
from stereosom.reconstruction import Reconstruction
from stereosom_plugin import run
from stereosom_plugin.acquisition import Acquisition
from stereosom_plugin.ahead import ahead
from stereosom_plugin.errors import InputError
from stereosom_plugin.run import _again


def test_the_same_comes_in_the_same_order():
    made = (np.full((50, 50), number) for number in range(30))
    assert [int(one[0, 0]) for one in ahead(made)] == list(range(30))
    assert multiprocessing.active_children() == []


def test_it_is_another_process_where_there_is_one_to_spare():
    (worker,) = ahead(os.getpid() for _ in range(1))
    if not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2:
        pytest.skip("one processor, or another system")
    assert worker != os.getpid()


def test_the_first_frame_of_a_run_is_made_here_and_the_others_ahead():
    first, *others = run._after_first(os.getpid() for _ in range(3))
    assert first == os.getpid()
    assert len(others) == 2
    if not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2:
        pytest.skip("one processor, or another system")
    assert os.getpid() not in others


def test_an_error_comes_after_what_was_made_before():
    def failing():
        yield 1
        raise InputError("a.dcm", "is torn", "copy it again")

    made = ahead(failing())
    assert next(made) == 1
    with pytest.raises(InputError, match="is torn"):
        next(made)
    assert multiprocessing.active_children() == []


def test_a_process_that_dies_is_no_silent_end():
    def dying():
        yield 1
        os._exit(3)

    if not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2:
        pytest.skip("it would be this process")
    with pytest.raises(RuntimeError, match="ended"):
        list(ahead(dying()))


def test_it_ends_with_its_taker_and_never_runs_far_ahead(tmp_path):
    log = tmp_path / "made"

    def endless():
        number = 0
        while True:
            with log.open("a") as file:
                file.write("x")
            yield np.zeros(80_000)
            number += 1

    made = ahead(endless())
    next(made)
    made.close()
    assert multiprocessing.active_children() == []
    assert log.stat().st_size < 5


def test_a_run_that_goes_on_makes_its_last_frames_again():
    assert _again(range(8), {0, 1, 2, 3, 4}, [5, 6, 7]) == [2, 3, 4]
    assert _again(range(8), {0}, list(range(1, 8))) == [0]
    assert _again(range(8), set(), list(range(8))) == []
    assert _again(range(8), set(range(8)), []) == []


class Disk:
    """An output folder whose first write ends when a second frame has been tracked."""

    frames_done: frozenset[int] = frozenset()
    rows = ()

    def __init__(self, full=False):
        self.second, self.written, self.full = threading.Event(), [], full

    def commit(self, result, **described):
        assert self.second.wait(10)
        if self.full:
            raise InputError("out", "cannot be written", "make room")
        self.written.append(result.index)


def run_on(disk, monkeypatch):
    def track(observations, **options):
        yield Reconstruction(0, 0.0, "failed", reason="nothing there")
        disk.second.set()
        yield Reconstruction(1, 0.1, "failed", reason="nothing there")

    monkeypatch.setattr(run, "track", track)
    acquisition = Acquisition(lambda index: None, (None,), [0.0, 0.1])
    return run.reconstruct_run(
        acquisition, disk, segment=lambda image: image > 0, frames=[0, 1], method="joint-spline",
        options=Options(), sampling=run.Sampling(),
    )  # fmt: skip


def test_a_frame_is_written_while_the_next_is_tracked(monkeypatch):
    disk = Disk()
    for result in run_on(disk, monkeypatch):
        assert result.index in disk.written
    assert disk.written == [0, 1]


def test_what_cannot_be_written_ends_the_run(monkeypatch):
    with pytest.raises(InputError, match="make room"):
        list(run_on(Disk(full=True), monkeypatch))


def test_frames_wait_so_that_a_slow_one_holds_up_nobody(tmp_path):
    if not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2:
        pytest.skip("one processor, or another system")
    log = tmp_path / "made"

    def items():
        for _ in range(4):
            yield np.zeros(30_000)  # as much as a frame of 1024²
            with log.open("a") as file:
                file.write("x")

    made = ahead(items())
    next(made)
    patience = time.monotonic() + 20
    while not (log.exists() and log.stat().st_size == 4) and time.monotonic() < patience:
        time.sleep(0.02)
    assert log.stat().st_size == 4
    made.close()
