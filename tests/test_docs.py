"""Every snippet of the README and the docs runs, on a copy of the study that ships."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

from stereosom_plugin.cli import main

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def snippets(language):
    """Code blocks of all pages, one test parameter each."""
    found = []
    for page in PAGES:
        blocks = re.findall(rf"^```{language}\n(.*?)^```", page.read_text("utf-8"), re.S | re.M)
        for number, block in enumerate(blocks, start=1):
            found.append(pytest.param(block, id=f"{page.name}-{number}"))
    return found


@pytest.fixture
def study(sample, tmp_path, monkeypatch, request):
    """A copy of the study that a page is about, as the current folder."""
    film = request.node.callspec.id.startswith("endoscopy.md")
    shutil.copytree(sample.parent / "endoscope" if film else sample, tmp_path / "study")
    monkeypatch.chdir(tmp_path / "study")


@pytest.mark.parametrize("code", snippets("python"))
@pytest.mark.usefixtures("study")
def test_python_snippet_runs(code, capsys):
    exec(compile(code, "snippet", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out


@pytest.mark.parametrize("block", snippets("bash"))
@pytest.mark.usefixtures("study")
def test_stereosom_calls_of_a_snippet_run(block):
    # The README's commands for a fresh machine begin otherwise; `.ci/run` runs them whole.
    calls = [line for line in block.splitlines() if line.startswith("stereosom ")]
    for line in calls:
        assert main(shlex.split(line)[1:]) == 0
    assert calls or "venv" in block


def test_links_between_pages_lead_somewhere():
    for page in PAGES:
        for link in re.findall(r"\]\(([^)#:]+)\)", page.read_text("utf-8")):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_numbers_of_the_contract_stay_in_bounds():
    """No file over 5 MB, data under 12 MB."""
    data = [file for file in (ROOT / "data").rglob("*") if file.is_file()]
    assert sum(file.stat().st_size for file in data) < 12e6
    assert max(file.stat().st_size for file in data) < 5e6
