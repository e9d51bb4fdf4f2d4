"""The 3D Slicer extension without Slicer: its panel with doubles, its files, its command line."""

import importlib.util
import json
import math
import os
import re
import subprocess
import sys
import types
import xml.etree.ElementTree as ElementTree
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path

import pytest

import stereosom
from stereosom_plugin.output import read_table

ROOT = Path(__file__).parent.parent
EXTENSION = ROOT / "plugin" / "slicer"
MODULE = EXTENSION / "StereoSOM"
UI = MODULE / "Resources" / "UI" / "StereoSOM.ui"
RUN = EXTENSION / "StereoSOMRun" / "StereoSOMRun.py"


# ---- doubles of what only a running Slicer has ---------------------------------------


class Widget:
    """Stands for any Qt widget: holds its properties, calls what is connected."""

    def __init__(self):
        self.connected, self.given = {}, []

    def connect(self, signal, slot):
        self.connected[signal] = slot

    def click(self):
        assert self.enabled
        self.connected["clicked(bool)"](False)

    def __getattr__(self, name):
        if not name.startswith("set"):
            raise AttributeError(name)
        return lambda *values: self.given.append((name, *values))


class Base:
    """Stands for Slicer's base classes."""

    def __init__(self, parent=None):
        self.parent, self.layout = parent, types.SimpleNamespace(addWidget=lambda _: None)

    def setup(self):
        pass

    def resourcePath(self, name):
        return str(MODULE / "Resources" / name)

    def getParameterNode(self):
        return "node"


class Observing:
    def __init__(self):
        self.observed = []

    def addObserver(self, *what):
        self.observed.append(what)

    def removeObserver(self, *what):
        self.observed.remove(what)

    def removeObservers(self):
        self.observed.clear()


def wrapper(cls):
    """Stands for `parameterNodeWrapper`: defaults, and the binding that it promises."""

    class Wrapped(cls):
        def __init__(self, node):
            self.bound = []
            for name in cls.__annotations__:
                setattr(self, name, getattr(cls, name, None))

        def connectGui(self, ui):
            self.bound.append(ui)
            return len(self.bound)

        def disconnectGui(self, tag):
            self.bound.pop()

    Wrapped.__annotations__ = cls.__annotations__
    return Wrapped


@pytest.fixture
def slicer(monkeypatch):
    """A package `slicer` of doubles; what the user is told is kept in `slicer.told`."""
    told = []

    @contextmanager
    def display(title, waitCursor=False):
        try:
            yield
        except Exception as error:  # as Slicer does: a window, not a crash
            told.append(f"{title}: {error}")

    slicer = types.ModuleType("slicer")
    slicer.told = told
    slicer.vtkMRMLScalarVolumeNode = slicer.vtkMRMLSequenceNode = object
    slicer.mrmlScene = types.SimpleNamespace(StartCloseEvent=1, EndCloseEvent=2)
    slicer.app = types.SimpleNamespace(processEvents=lambda: None)
    names = {element.get("name") for element in ElementTree.parse(UI).iter("widget")}
    slicer.ui = types.SimpleNamespace(**{name: Widget() for name in names})
    slicer.util = types.ModuleType("slicer.util")
    vars(slicer.util).update(
        VTKObservationMixin=Observing,
        loadUI=lambda path: Widget() if Path(path) == UI else None,
        childWidgetVariables=lambda _: slicer.ui,
        tryWithErrorDisplay=display,
        resetSliceViews=lambda: None,
        resetThreeDViews=lambda: None,
    )
    wrapping = types.ModuleType("slicer.parameterNodeWrapper")
    wrapping.parameterNodeWrapper = wrapper
    for name in ("Choice", "Minimum", "WithinRange"):
        setattr(wrapping, name, lambda *values: values)
    loadable = types.ModuleType("slicer.ScriptedLoadableModule")
    for kind in ("", "Widget", "Logic", "Test"):
        setattr(loadable, f"ScriptedLoadableModule{kind}", type(f"Base{kind}", (Base,), {}))
    modules = {
        "slicer": slicer,
        "slicer.util": slicer.util,
        "slicer.parameterNodeWrapper": wrapping,
        "slicer.ScriptedLoadableModule": loadable,
    }
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    return slicer


@pytest.fixture
def library(monkeypatch):
    """`StereoSOMLib` on the path, as Slicer has it."""
    monkeypatch.syspath_prepend(MODULE)


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Logic:
    """A double of the logic: three frames, of which the widget may ask for fewer."""

    def __init__(self):
        self.results, self.asked = None, []

    def getParameterNode(self):
        return self.node

    def ensurePackages(self, chosen):
        self.asked.append("packages")

    def process(self, chosen):
        self.results = types.SimpleNamespace(browser="browser", table="table")
        for done in (1, 2, 3):
            self.asked.append(done)
            yield done, 3, f"frame {done - 1}: ok"

    def editable(self):
        self.asked.append("editable")

    def export(self, chosen, folder):
        self.asked.append(folder)
        return folder


@pytest.fixture
def panel(slicer, library):
    """The widget, set up, with the logic's double behind it."""
    module = load(MODULE / "StereoSOM.py")
    logic = Logic()
    logic.node = module.StereoSOMParameterNode("node")
    module.StereoSOMLogic = lambda: logic
    widget = module.StereoSOMWidget(types.SimpleNamespace(isEntered=True))
    widget.setup()
    return types.SimpleNamespace(module=module, widget=widget, logic=logic, ui=slicer.ui)


# ---- the panel -----------------------------------------------------------------------


def test_panel_asks_for_both_views_before_it_applies(panel):
    assert panel.ui.applyButton.enabled is False
    panel.logic.node.viewA = panel.logic.node.viewB = "a volume"
    for *_, changed in panel.widget.observed:
        if changed == panel.widget._checkCanApply:
            changed()
    assert panel.ui.applyButton.enabled is True


def test_panel_applies_shows_and_exports(panel, slicer):
    panel.ui.applyButton.enabled = True
    panel.ui.applyButton.click()
    assert panel.logic.asked == ["packages", 1, 2, 3]
    assert (panel.ui.progressBar.value, panel.ui.progressBar.maximum) == (3, 3)
    assert panel.ui.messageLabel.text == "frame 2: ok"
    assert ("setMRMLTableNode", "table") in panel.ui.tableView.given
    for scrubber in (panel.ui.seekWidget, panel.ui.playWidget):
        assert ("setMRMLSequenceBrowserNode", "browser") in scrubber.given
    assert (panel.ui.applyButton.visible, panel.ui.stopButton.visible) == (True, False)
    panel.ui.editButton.click()
    panel.ui.exportPathEdit.currentPath = "out"
    panel.ui.exportButton.click()
    assert panel.logic.asked[-2:] == ["editable", "out"]
    assert slicer.told == []


def test_panel_stops_after_the_present_frame(panel, slicer):
    slicer.app.processEvents = panel.widget.onStop
    panel.ui.applyButton.enabled = True
    panel.ui.applyButton.click()
    assert panel.logic.asked == ["packages", 1]
    assert panel.ui.exportButton.enabled is True, "what is done stays"


def test_panel_tells_what_is_wrong_and_can_be_used_again(panel, slicer):
    def fail(chosen):
        raise ValueError("view a: is not chosen; choose a volume or a sequence")

    panel.logic.process = fail
    panel.ui.applyButton.enabled = True
    panel.ui.applyButton.click()
    assert slicer.told == ["Stereo SOM: view a: is not chosen; choose a volume or a sequence"]
    assert panel.ui.applyButton.visible is True
    assert panel.ui.inputsButton.enabled is True


def test_panel_lets_go_of_a_scene_that_closes(panel):
    panel.widget.onSceneStartClose(None, None)
    assert panel.logic.node.bound == []
    panel.widget.onSceneEndClose(None, None)
    assert len(panel.logic.node.bound) == 1
    panel.widget.cleanup()
    assert panel.widget.observed == []


def test_panel_and_its_description_have_the_same_widgets():
    elements = list(ElementTree.parse(UI).iter("widget"))
    names = [element.get("name") for element in elements]
    assert len(names) == len(set(names))
    used = set(re.findall(r"self\.ui\.(\w+)", (MODULE / "StereoSOM.py").read_text("utf-8")))
    bound = {
        element.get("name")
        for element in elements
        if any(p.get("name") == "SlicerParameterName" for p in element.findall("property"))
    }
    passive = ("QLabel", "ctkCollapsibleButton", "qMRMLWidget")
    active = {e.get("name") for e in elements if e.get("class") not in passive}
    assert used <= set(names)
    assert active <= used | bound, "a widget that does nothing"
    classes = {element.get("class") for element in elements}
    declared = {c.findtext("class") for c in ElementTree.parse(UI).iter("customwidget")}
    assert declared == {name for name in classes if name[0] in "cq"}
    for connection in ElementTree.parse(UI).iter("connection"):
        assert {connection.findtext("sender"), connection.findtext("receiver")} <= set(names)


def test_parameters_are_the_settings_and_the_inputs(panel):
    from StereoSOMLib.settings import METHODS, Settings

    names = [field.name for field in fields(Settings)]
    node = panel.module.StereoSOMParameterNode
    assert list(node.__annotations__) == ["viewA", "viewB", "rigFile", *names]
    bound = re.findall(r"SlicerParameterName.*\n\s*<string>(\w+)", UI.read_text("utf-8"))
    assert sorted(bound) == sorted(node.__annotations__)
    chosen = node("node")
    assert panel.module.settings_of(chosen) == Settings()
    assert panel.module.rig_file(chosen) == ""
    chosen.rigFile = Path("rig.json")
    assert panel.module.rig_file(chosen) == "rig.json"
    assert set(METHODS) <= set(stereosom.METHODS)
    assert Settings.method == METHODS[0]


def test_settings_become_the_options_of_the_method(library):
    from StereoSOMLib.settings import Settings

    assert Settings(radius=1.5, length=80).options().prior.radius == 1.5
    assert Settings().options().prior.length is None
    assert type(Settings(method="stereo-som").options()).__name__ == "StereoSomOptions"
    assert Settings(segmenter="mask").segment()([[0, 1]]).tolist() == [[False, True]]


# ---- what is installed ---------------------------------------------------------------


@pytest.fixture
def packages(library):
    from StereoSOMLib import packages

    return packages


def test_nothing_is_installed_where_nothing_is_missing(packages):
    def never(*_):
        raise AssertionError("asked or installed")

    needed = packages.needed(dicom=True)
    assert needed[0].module == "stereosom_plugin"
    assert packages.install_missing(needed, install=never, agree=never) == []


def test_only_what_is_missing_is_installed_beside_what_is_there(packages):
    calls, asked = [], []

    class Missing(packages.Package):
        def missing(self):
            return not calls

    def install(arguments):
        *wanted, option, file = arguments
        assert option == "--constraint"
        calls.append((wanted, Path(file).read_text("utf-8").splitlines(), file))

    def agree(question):
        asked.append(question)
        return True

    there = packages.Package("numpy", "numpy>=1")
    missing = Missing("absent", "absent>=2")
    done = packages.install_missing([there, missing], install=install, agree=agree)
    ((wanted, kept, file),) = calls
    assert done == wanted == ["absent>=2"]
    assert len(asked) == 1
    assert "absent>=2" in asked[0]
    assert kept == packages.constraints()
    assert not Path(file).exists()


def test_what_the_user_refuses_is_not_installed(packages):
    absent = packages.Package("no_such_module", "no-such-module")
    with pytest.raises(packages.CannotInstall, match="Not installed: no-such-module"):
        packages.install_missing([absent], install=lambda _: 1 / 0, agree=lambda _: False)


def test_what_pip_cannot_do_is_told_in_one_line(packages):
    absent = packages.Package("no_such_module", "no-such-module")
    with pytest.raises(packages.CannotInstall, match="could not be installed") as told:
        packages.install_missing([absent], install=lambda _: 1 / 0, agree=lambda _: True)
    assert "\n" not in str(told.value)


def test_pip_may_change_nothing_that_is_there(packages):
    lines = packages.constraints()
    import numpy

    assert f"numpy=={numpy.__version__}" in lines
    for name in packages.NEVER:
        assert any(re.match(rf"{name}(==|<0)", line, re.I) for line in lines), name


def test_slicers_own_builds_without_a_record_are_kept(packages, monkeypatch):
    monkeypatch.setattr(packages, "distributions", list)
    assert packages.constraints() == ["vtk<0", "SimpleITK<0", "numpy<0"]


def test_an_old_slicer_gets_one_clear_line(packages):
    packages.check_python((3, 12, 0))
    with pytest.raises(packages.CannotInstall, match=r"Python 3\.9.*mid-2025"):
        packages.check_python((3, 9, 10))


def test_own_package_is_that_of_the_checkout_or_the_published_one(packages, tmp_path):
    assert packages.own_package().requirement == str(ROOT)
    assert packages.own_package(tmp_path / "a/b/c/d/packages.py").requirement == "stereosom"


def test_nothing_heavy_is_needed_before_packages_are_there():
    """A fresh Slicer loads the module with none of ours installed."""
    modules = "StereoSOMLib.packages, StereoSOMLib.settings, sys"
    code = f"import {modules}; print('stereosom' in sys.modules)"
    environment = os.environ | {"PYTHONPATH": str(MODULE)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True)
    assert done.stdout.strip() == b"False", done.stderr


# ---- metadata ------------------------------------------------------------------------


def test_catalog_entry_has_what_the_index_wants():
    """Slicer's schema for catalog entries, v1.0.1: these are required, others are not allowed."""
    entry = json.loads((EXTENSION / "StereoSOM.json").read_text("utf-8"))
    assert {"$schema", "category", "scm_url"} <= entry.keys()
    optional = {"scm_revision", "scm_type", "build_dependencies", "build_subdirectory", "enabled"}
    assert entry.keys() <= {"$schema", "category", "scm_url", "tier"} | optional
    assert entry["tier"] in (1, 3, 5)
    assert entry["$schema"].endswith("slicer-extension-catalog-entry-schema-v1.0.1.json#")
    cmake = (EXTENSION / "CMakeLists.txt").read_text("utf-8")
    for name in ("HOMEPAGE", "CATEGORY", "CONTRIBUTORS", "DESCRIPTION", "ICONURL",
                 "SCREENSHOTURLS", "DEPENDS"):  # fmt: skip
        assert f"set(EXTENSION_{name} " in cmake
    assert f'set(EXTENSION_CATEGORY "{entry["category"]}")' in cmake
    assert f'set(_repository "{entry["scm_url"].removesuffix(".git")}")' in cmake


def test_no_address_leads_to_a_stranger():
    """Until the project has one of its own: github.com/OWNER would be somebody's."""
    for path in EXTENSION.rglob("*"):
        if path.suffix in (".txt", ".json", ".xml", ".md"):
            assert "OWNER" not in path.read_text("utf-8"), path


def test_every_file_is_built_into_the_extension():
    cmake = (MODULE / "CMakeLists.txt").read_text("utf-8").replace("${MODULE_NAME}", "StereoSOM")
    files = [f.relative_to(MODULE) for f in MODULE.rglob("*") if f.suffix in (".py", ".ui", ".png")]
    assert len(files) > 8
    for file in files:
        assert file.as_posix() in cmake
    for named in re.findall(r"^  (\S+\.\w+)$", cmake, re.M):
        assert (MODULE / named).is_file()
    whole = (EXTENSION / "CMakeLists.txt").read_text("utf-8")
    for folder in re.findall(r"add_subdirectory\((\w+)\)", whole):
        assert (EXTENSION / folder / "CMakeLists.txt").is_file()


def test_pictures_and_licence_of_the_extension():
    from PIL import Image

    with Image.open(MODULE / "Resources" / "Icons" / "StereoSOM.png") as icon:
        assert icon.size == (128, 128)
    assert (EXTENSION / "LICENSE.txt").read_bytes() == (ROOT / "LICENSE").read_bytes()
    text = (EXTENSION / "CMakeLists.txt").read_text("utf-8")
    for path in re.findall(r"\$\{_repository\}/(?:raw|blob)/main/([^\"]+)", text):
        assert (ROOT / path).is_file()


# ---- the command-line module ---------------------------------------------------------


def test_command_line_module_describes_itself():
    """To Slicer, which runs it; and to people."""
    shown = [
        subprocess.run([sys.executable, RUN, word], capture_output=True, text=True, timeout=60)
        for word in ("--xml", "--help")
    ]
    assert [(done.returncode, done.stderr) for done in shown] == [(0, "")] * 2
    root = ElementTree.fromstring(shown[0].stdout.encode())
    assert root.tag == "executable"
    for name in root.iter("longflag"):
        assert f"--{name.text}" in shown[1].stdout


def test_command_line_module_runs_as_slicer_calls_it(mask_case, tmp_path, capsys):
    words = [
        mask_case / "a.png", mask_case / "b.png", "--kind", "masks",
        "--rig", mask_case / "rig.json", "--output", tmp_path / "out",
        "--centerline", tmp_path / "c.vtp", "--radius", "0",
        "--frames", "", "--returnparameterfile", tmp_path / "returned.txt",
        "--processinformationaddress", "0",
    ]  # fmt: skip
    assert load(RUN).main(map(str, words)) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert (out.splitlines()[0], out.splitlines()[-1]) == ("<filter-start>", "</filter-end>")
    told = [float(p) for p in re.findall(r"<filter-progress>([\d.]+)<", out)]
    assert told == [0, 1]
    ElementTree.fromstring(f"<all>{out}</all>")
    returned = dict(
        line.split(" = ") for line in (tmp_path / "returned.txt").read_text().splitlines()
    )
    assert (returned["reconstructed"], returned["failed"]) == ("1", "0")
    assert float(returned["lastLength"]) == pytest.approx(60 * math.pi / 2, abs=1)
    (row,) = read_table(tmp_path / "out")
    assert returned["lastTip"] == ",".join(row[f"tip_{axis}_mm"] for axis in "xyz")
    whole = (tmp_path / "out" / "centerline_0000.vtp").read_bytes()
    assert (tmp_path / "c.vtp").read_bytes() == whole


def test_command_line_module_refuses_in_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert load(RUN).main(["a.dcm", "b.dcm", "--output", "out"]) == 2
    assert capsys.readouterr() == ("", "stereosom: error: a.dcm: no such file; check the path\n")
    assert load(RUN).main(["a.dcm", "b.dcm"]) == 2
    assert "--output: is missing" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_command_line_module_says_where_stereosom_comes_from(tmp_path):
    """As in a Slicer where nothing was installed yet: without our packages on the path."""
    done = subprocess.run(
        [sys.executable, "-S", RUN, "a", "b", "--output", "out"],
        env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"},
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 2
    assert "stereosom is missing" in done.stderr
    assert "pip install" in done.stderr
    assert len(done.stderr.splitlines()) == 1
