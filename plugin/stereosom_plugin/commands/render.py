"""`stereosom render`: pictures and films of a result, without a screen."""

from __future__ import annotations

import argparse
from collections import deque
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..ahead import ahead
from ..errors import InputError
from .drawing import Results
from .reconstructing import progress_bar, say, warn

T = TypeVar("T")

DOES = "draw a result or film a run, without a screen"
EXAMPLE = "stereosom render out --output film.mp4 --ghosts 5"

_FILMS = (".mp4", ".gif")
_SIZES = {"picture": (1600, 1200), "film": (960, 720), "4k": (3840, 2160)}
# Seconds that the eye takes to go around, and the pictures in each.
_TURN_S, _TURN_RATE = 6.0, 24.0
_LEAST_SIDE, _MOST_SIDE = 64, 8192


def add_words(parser: argparse.ArgumentParser) -> None:
    """Say which words the command takes."""
    parser.add_argument("input", metavar="OUT | FILE.vtp", help="a folder of results, or one file")
    parser.add_argument("--output", required=True, metavar="PICTURE.png | FILM.mp4 | FILM.gif")
    parser.add_argument(
        "--frame", type=int, metavar="N", help="of a folder; default: the first with a curve"
    )
    parser.add_argument(
        "--color-by",
        choices=("Curvature", "StandardDeviation", "Time"),
        help="default: Curvature, where the files hold it",
    )
    parser.add_argument(
        "--view",
        choices=("best", "a", "b", "overview"),
        help="the device's best side, without perspective; as a view sees it; or from between "
        "both views (default)",
    )
    parser.add_argument("--turntable", action="store_true", help="film one shape from all around")
    parser.add_argument(
        "--ghosts", type=_count, default=0, metavar="N", help="show the N shapes before, too"
    )
    parser.add_argument(
        "--overlay", choices=("a", "b", "both"), help="the curve over the source pictures instead"
    )
    parser.add_argument(
        "--outline", action="store_true", help="with --overlay: outline what was segmented"
    )
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--size", type=_size, metavar="WxH", help="pixels, such as 1920x1080")
    size.add_argument("--4k", dest="size", action="store_const", const=_SIZES["4k"],
                      help="the same as --size 3840x2160")  # fmt: skip
    parser.add_argument(
        "--fps", type=_rate, metavar="N", help="pictures a second; default: as the run was taken"
    )
    parser.add_argument("--quiet", action="store_true", help="say nothing but errors")


def run(arguments: argparse.Namespace) -> int:
    """Draw one frame of an output folder, or a `.vtp`; or film all of them."""
    output = Path(arguments.output)
    film = output.suffix.lower() in _FILMS
    _check(arguments, output, film)
    results = Results(Path(arguments.input))
    if film and not arguments.turntable and len(results.frames) < 2:
        raise InputError(
            arguments.input, "is one frame, and no film", "give --turntable, or a folder of a run"
        )
    if results.acquisition is None:
        if arguments.overlay:
            raise InputError(
                arguments.input,
                "the pictures that it was made of are not in their place",
                "bring them back, or leave out --overlay",
            )
        if not arguments.quiet and arguments.view != "best":
            warn("the pictures that it was made of are not found: it is drawn without them")
    pictures = _overlays(results, arguments) if arguments.overlay else _scenes(results, arguments)

    from .. import render

    if film:
        fps = arguments.fps or _fps(results, arguments.turntable)
        count = render.write_film(pictures, output, fps)
        say(arguments, f"{output}: {count} pictures, {fps:.4g} a second")
    else:
        render.write_picture(next(pictures), output)
        say(arguments, str(output))
    return 0


# ---- what is drawn -------------------------------------------------------------------


def _scenes(results: Results, arguments: argparse.Namespace) -> Iterator[Any]:
    """Pictures in space, one after the other."""
    from .. import render

    film = Path(arguments.output).suffix.lower() in _FILMS
    chosen = results.frames if film and not arguments.turntable else [_frame(results, arguments)]
    size = arguments.size or _SIZES["film" if film else "picture"]
    # By time, the colors run over all that is shown; else they and the eye fit all of the film.
    first = max(0, results.with_curve.index(_first_curve(results, chosen)) - arguments.ghosts)
    last = results.with_curve.index(_first_curve(results, chosen[::-1]))
    surveyed = render.survey(
        (line for frame in results.with_curve[first : last + 1] if (line := results.line(frame))),
        arguments.color_by,
    )
    view: Any = arguments.view or "overview"
    with render.Stage(
        surveyed, results.rig(chosen[0]), view=view, size=size, turning=arguments.turntable
    ) as stage:
        shots = _shots(results, chosen, arguments.ghosts, with_images=view != "best")
        if arguments.turntable:
            shot = next(shots)
            count = round(_TURN_S * (arguments.fps or _TURN_RATE))
            for angle in progress_bar(arguments, "rendering")(
                np.linspace(0, 360, count, endpoint=False)
            ):
                yield stage.draw(shot, turn_deg=float(angle))
        else:
            steps: Iterable[int] = chosen
            for _ in progress_bar(arguments, "rendering")(steps) if film else steps:
                yield stage.draw(next(shots))


def _shots(results: Results, frames: list[int], ghosts: int, *, with_images: bool) -> Iterator[Any]:
    from .. import render

    before = [frame for frame in results.with_curve if frame < frames[0]][-ghosts or None :]
    past: deque[Any] = deque(maxlen=ghosts)
    if ghosts:
        past.extend(results.line(frame) for frame in before)
    read = ((results.line(i), results.images(i) if with_images else None) for i in frames)
    for frame, (line, images) in zip(frames, _ahead_of(read, frames), strict=True):
        rig = results.rig(frame)
        if line is not None:
            heading = render.heading(line, rig)
        else:
            heading = (f"frame {frame} · {results.time(frame):.3f} s",)
        if results.state(frame):
            heading = (heading[0], results.state(frame), *heading[1:])
        yield render.Shot(line, rig, images, tuple(past), heading)
        if line is not None:
            past.append(line)


def _overlays(results: Results, arguments: argparse.Namespace) -> Iterator[Any]:
    """Source pictures with the projected curve, one after the other."""
    from .. import render

    output = Path(arguments.output)
    film = output.suffix.lower() in _FILMS
    chosen = results.frames if film else [_frame(results, arguments)]
    views = "ab" if arguments.overlay == "both" else arguments.overlay
    size = arguments.size
    if size and len(views) == 2:
        size = ((size[0] - render.GAP) // 2, size[1])
    outlines = _segmented(results, chosen) if arguments.outline else iter(())
    read = _ahead_of(
        ((results.line(i), results.images(i), next(outlines, (None, None))) for i in chosen), chosen
    )
    for frame in progress_bar(arguments, "rendering")(chosen) if film else chosen:
        rig = results.rig(frame)
        if rig is None:
            raise InputError(arguments.input, "has no rig.json", "give the folder of a whole run")
        line, images, seen = next(read)
        parts = []
        for view in views:
            number, camera = "ab".index(view), getattr(rig, view)
            words = [f"view {view}", f"frame {frame}", f"{results.time(frame):.3f} s"]
            if images is None:
                words.append("its picture cannot be read")
                image: Any = np.zeros(camera.image_size[::-1], dtype=np.uint8)
            else:
                image = images[number]
            words += [state] if (state := results.state(frame)) else []
            words += ["outline: segmented"] if arguments.outline else []
            lenses = results.acquisition.lenses if results.acquisition else None
            over = render.Overlay.of(
                line, image, camera, view, " · ".join(words), seen[number],
                lenses[number] if lenses else None,
            )  # fmt: skip
            parts.append(render.overlaid(over, size=size, scale_bar=True))
        picture = render.beside(parts) if len(parts) == 2 else parts[0]
        yield render.padded(picture, arguments.size, even=output.suffix.lower() == ".mp4")


def _ahead_of(read: Iterator[T], frames: list[int]) -> Iterator[T]:
    """What is read of each frame: of a film in another process, while the one before is drawn."""
    return ahead(read) if len(frames) > 1 else read


def _segmented(results: Results, frames: list[int]) -> Iterator[tuple[Any, Any]]:
    """What is segmented in both views of each frame, (n, 2) pixels, as the run did it."""
    from .. import segmentation

    if results.acquisition is None:
        return
    for observation in segmentation.observe(
        results.acquisition, results.segmenter(), frames=frames
    ):
        yield observation.pixels_a, observation.pixels_b


# ---- what was asked for --------------------------------------------------------------


def _check(arguments: argparse.Namespace, output: Path, film: bool) -> None:
    """Refuse what does not go together, before anything is read."""
    if output.suffix.lower() not in (".png", *_FILMS):
        raise InputError(
            output, "is no .png, .mp4 or .gif", "give --output a name that ends in one of them"
        )
    given = {
        "--turntable": arguments.turntable,
        "--view": arguments.view,
        "--ghosts": arguments.ghosts,
        "--color-by": arguments.color_by,
    }
    for word in (word for word, value in given.items() if value and arguments.overlay):
        raise InputError(word, "does not go with --overlay", "leave one of them out")
    if arguments.outline and not arguments.overlay:
        raise InputError("--outline", "needs --overlay", "give --overlay a, b or both")
    if arguments.turntable and not film:
        raise InputError("--turntable", "makes a film", "give --output a name in .mp4 or .gif")
    if arguments.fps and not film:
        raise InputError("--fps", "is for films", "give --output a name in .mp4 or .gif")
    if film and arguments.frame is not None and not arguments.turntable:
        raise InputError("--frame", "is one picture, no film", "give --turntable, or a .png")
    if arguments.size and output.suffix.lower() == ".mp4":
        from ..render import check_even

        check_even(arguments.size)


def _frame(results: Results, arguments: argparse.Namespace) -> int:
    frame = results.with_curve[0] if arguments.frame is None else arguments.frame
    if frame not in results.frames:
        raise InputError(
            f"--frame {frame}",
            f"is none of {len(results.frames)} frames",
            f"give one from {results.frames[0]} to {results.frames[-1]}",
        )
    if frame not in results.with_curve and not arguments.overlay:
        raise InputError(
            f"--frame {frame}",
            f"has no curve ({results.state(frame)})",
            f"give another one, such as {results.with_curve[0]}",
        )
    return frame


def _first_curve(results: Results, frames: list[int]) -> int:
    return next(frame for frame in frames if frame in set(results.with_curve))


def _fps(results: Results, turntable: bool) -> float:
    """As the run was taken, as far as a film can be played so."""
    return _TURN_RATE if turntable else float(np.clip(results.rate() or 10.0, 1.0, 50.0))


def _size(text: str) -> tuple[int, int]:
    width, x, height = text.lower().partition("x")
    if not (x and width.isdecimal() and height.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is not WxH, such as 1920x1080")
    size = (int(width), int(height))
    if min(size) < _LEAST_SIDE or max(size) > _MOST_SIDE:
        raise argparse.ArgumentTypeError(
            f"{text} px: each side must lie between {_LEAST_SIDE} and {_MOST_SIDE}"
        )
    return size


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) > 1000:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 0 to 1000")
    return int(text)


def _rate(text: str) -> float:
    if not 0.1 <= (value := float(text)) <= 240:
        raise argparse.ArgumentTypeError(f"{text!r} is not a rate from 0.1 to 240")
    return value
