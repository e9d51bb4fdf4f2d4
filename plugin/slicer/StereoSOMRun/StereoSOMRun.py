#!/usr/bin/env python-real
"""Stereo SOM as a command-line module of 3D Slicer: for its panel, a shell, and pipelines.

A thin layer over the command `stereosom`: what it takes is said once, in StereoSOMRun.xml.
"""

import argparse
import shutil
import sys
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path

NAME = "StereoSOMRun"
DESCRIPTION = Path(__file__).resolve().with_suffix(".xml")
OLDEST_PYTHON = (3, 11)
_NUMBERS = {"integer": int, "double": float}
# 0 and nothing stand for "not given", as a panel cannot leave a number out.
_PASSED_ON = ("method", "radius", "length", "samples", "frames", "rate", "rig")


def main(words=None):
    """Run the module; returns the exit code, that of `stereosom`."""
    words = sys.argv[1:] if words is None else list(words)
    if "--xml" in words:
        print(DESCRIPTION.read_text(encoding="utf-8"))
        return 0
    chosen = parser().parse_args(words)
    if sys.version_info < OLDEST_PYTHON:
        return refuse("this Python is too old; use 3D Slicer of mid-2025 or later (Python 3.12)")
    try:
        from stereosom_plugin import cli
        from stereosom_plugin.output import centerline_path, read_table
    except ImportError as error:
        return refuse(
            f"stereosom is missing ({error}); open the module Stereo SOM once, which installs it, "
            "or run: PythonSlicer -m pip install stereosom scikit-image"
        )
    if not chosen.output:
        return refuse("--output: is missing; name a folder for the results")
    code = cli.main(words_of(chosen), progress=told)
    if code == 2:
        return code
    rows = read_table(chosen.output)
    curves = [row for row in rows if row["status"] in ("ok", "predicted")]
    if chosen.centerline and curves:
        shutil.copyfile(
            centerline_path(Path(chosen.output), int(curves[0]["frame"])), chosen.centerline
        )
    if chosen.returnparameterfile:
        write_returned(chosen.returnparameterfile, rows, curves)
    return code


def parameters():
    """Parameters of the description, as XML elements."""
    tree = ElementTree.parse(DESCRIPTION)
    groups = tree.getroot().findall("parameters")
    return [p for group in groups for p in group if p.find("name") is not None]


def parser():
    """Words as the description says them, and those that Slicer adds to every call."""
    words = argparse.ArgumentParser(
        prog=NAME, description=ElementTree.parse(DESCRIPTION).getroot().findtext("description")
    )
    for parameter in parameters():
        name, index = parameter.findtext("name"), parameter.findtext("index")
        if parameter.findtext("channel") == "output" and index is not None:
            continue  # returned, not given
        given = {"help": parameter.findtext("description")}
        choices = [element.text for element in parameter.findall("element")]
        if index is not None:
            words.add_argument(name, metavar=name.upper(), **given)
        elif parameter.tag == "boolean":
            words.add_argument(f"--{parameter.findtext('longflag')}", action="store_true", **given)
        else:
            words.add_argument(
                f"--{parameter.findtext('longflag')}",
                default=parameter.findtext("default") or None,
                type=_NUMBERS.get(parameter.tag, str),
                choices=choices or None,
                **given,
            )
    words.add_argument("--xml", action="store_true", help="print the description, and stop")
    words.add_argument("--returnparameterfile", metavar="FILE", help="where results are returned")
    words.add_argument("--processinformationaddress", metavar="ADDRESS", help=argparse.SUPPRESS)
    return words


def words_of(chosen):
    """Give the words of the call of `stereosom`."""
    words = [chosen.kind, chosen.viewA, chosen.viewB, "--output", chosen.output, "--quiet"]
    for name in _PASSED_ON:
        value = getattr(chosen, name)
        if value:
            words.append(f"--{name}={value}")
    return [*words, "--overwrite"] if chosen.overwrite else words


def told(steps):
    """Tell Slicer how far it is, as each step is begun."""
    steps, start = list(steps), time.monotonic()
    say(
        f"<filter-start>\n<filter-name>{NAME}</filter-name>\n"
        f"<filter-comment>{len(steps)} frames</filter-comment>\n</filter-start>"
    )
    try:
        for number, step in enumerate(steps):
            say(f"<filter-progress>{number / len(steps):.4f}</filter-progress>")
            yield step
        say("<filter-progress>1</filter-progress>")
    finally:
        say(
            f"<filter-end>\n<filter-name>{NAME}</filter-name>\n"
            f"<filter-time>{time.monotonic() - start:.3f}</filter-time>\n</filter-end>"
        )


def write_returned(path, rows, curves):
    """Write what is returned: name = value, a line each."""
    returned = {"reconstructed": len(curves), "failed": len(rows) - len(curves)}
    if curves:
        last = curves[-1]
        returned["lastLength"] = last["length_mm"]
        returned["lastTip"] = ",".join(last[f"tip_{axis}_mm"] for axis in "xyz")
    lines = [f"{name} = {value}\n" for name, value in returned.items()]
    Path(path).write_text("".join(lines), encoding="utf-8")


def say(text):
    """Print and flush: Slicer reads along."""
    print(text, flush=True)


def refuse(text):
    """Say in one line what is wrong; returns the exit code."""
    print(f"{NAME}: error: {' '.join(text.split())}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    raise SystemExit(main())
