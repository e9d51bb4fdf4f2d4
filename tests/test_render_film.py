"""Films: what is written is what is read back, a picture at a time, and whole or not at all."""

import builtins
import itertools
import sys
import tracemalloc

import numpy as np
import pytest

from stereosom_plugin import render
from stereosom_plugin.errors import InputError

av = pytest.importorskip("av", reason="films need PyAV")
WIDTH, HEIGHT = 128, 96


def pictures(count):
    """A bright square that walks over gray, so that no two pictures are alike."""
    for k in range(count):
        picture = np.full((HEIGHT, WIDTH, 3), 90, dtype=np.uint8)
        picture[20:60, 8 * k : 8 * k + 40] = (200, 120, 40)
        yield picture


def read_back(path):
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
        return frames, float(stream.average_rate), stream.codec_context


@pytest.mark.parametrize(("suffix", "off_by"), [(".mp4", 6), (".gif", 4)])
def test_a_film_holds_its_pictures_in_order_at_their_rate(tmp_path, suffix, off_by):
    path = tmp_path / f"film{suffix}"
    assert render.write_film(pictures(10), path, fps=12.5) == 10
    frames, rate, _ = read_back(path)
    assert rate == pytest.approx(12.5)
    assert len(frames) == 10
    for drawn, read in zip(pictures(10), frames, strict=True):
        assert np.abs(drawn.astype(int) - read).mean() < off_by
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_an_mp4_plays_everywhere_and_names_its_colors(tmp_path):
    """H.264 with 4:2:0 is what browsers play; without BT.709 named they guess the colors."""
    render.write_film(pictures(3), tmp_path / "f.mp4", fps=5)
    frames, _, codec = read_back(tmp_path / "f.mp4")
    assert (codec.name, codec.pix_fmt) == ("h264", "yuv420p")
    assert int(codec.colorspace) == 1  # BT.709
    with av.open(str(tmp_path / "f.mp4")) as film:
        frame = next(film.decode(video=0)).reformat(
            format="rgb24", src_colorspace="ITU709", dst_color_range="JPEG"
        )
    middle = frame.to_ndarray()[40, 20]
    assert np.abs(middle.astype(int) - (200, 120, 40)).max() < 10
    assert len(frames) == 3


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_pictures_are_written_as_they_come_and_none_is_kept(tmp_path, suffix):
    """A film of 400 pictures takes no more of Python's memory than one of 40."""
    peaks = []
    for count in (40, 400):
        tracemalloc.start()
        source = itertools.islice(itertools.cycle(pictures(10)), count)
        render.write_film(source, tmp_path / f"f{suffix}", fps=25)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # cycle() keeps its ten; a film kept whole would be ten times as much.
    assert peaks[1] < 2 * peaks[0]


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_a_film_that_breaks_off_leaves_nothing(tmp_path, suffix):
    path = tmp_path / f"film{suffix}"
    path.write_bytes(b"the film of yesterday")

    def breaking():
        yield from pictures(4)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render.write_film(breaking(), path, fps=5)
    assert path.read_bytes() == b"the film of yesterday"
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_what_cannot_be_a_film_is_refused(tmp_path):
    path = tmp_path / "film.mp4"
    odd = (picture[:-1] for picture in pictures(2))
    with pytest.raises(InputError, match=r"128x95: is odd.*give --size 128x94"):
        render.write_film(odd, path, fps=5)
    with pytest.raises(InputError, match="no pictures"):
        render.write_film(iter(()), path, fps=5)
    with pytest.raises(InputError, match="cannot be written"):
        render.write_film(pictures(2), tmp_path / "no" / "film.mp4", fps=5)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="limits on file size are POSIX")
def test_a_full_disk_is_one_line(tmp_path):
    """A limit on file size fails the writes of the encoder as a full disk does."""
    import resource
    import signal

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    noise = (
        np.random.default_rng(k).integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        for k in range(30)
    )
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
        with pytest.raises(InputError, match="cannot be written"):
            render.write_film(noise, tmp_path / "f.mp4", fps=5)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert not list(tmp_path.iterdir())


def test_a_missing_encoder_names_the_extra(tmp_path, monkeypatch):
    real = builtins.__import__

    def without_av(name, *rest):
        if name == "av":
            raise ImportError("No module named 'av'")
        return real(name, *rest)

    monkeypatch.delitem(sys.modules, "av")
    monkeypatch.setattr(builtins, "__import__", without_av)
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(ImportError, match=r"av is missing.*pip install 'stereosom\[vtk\]'"):
        render.write_film(pictures(1), tmp_path / "f.mp4", fps=5)
