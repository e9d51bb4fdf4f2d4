"""The `.vtp` contract, read back by VTK itself, and what is refused."""

import json
import math
import random
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLPolyDataWriter

from stereosom.backbone import Backbone
from stereosom.reconstruction import Reconstruction
from stereosom.synthetic import arc
from stereosom_plugin import polydata
from stereosom_plugin.errors import InputError
from stereosom_plugin.files import sweep, write_whole
from stereosom_plugin.vtp_decoder import content_of
from stereosom_plugin.vtp_text import vtp_text
from stereosom_plugin.vtp_writer import make_polydata

COVARIANCE = np.array([[0.04, 0.01, 0.02], [0.01, 0.09, 0.03], [0.02, 0.03, 0.16]])
POINT_ARRAYS = {
    "ArcLength": 1,
    "Abscissas": 1,
    "Radius": 1,
    "MaximumInscribedSphereRadius": 1,
    "FrenetTangent": 3,
    "ParallelTransportNormals": 3,
    "Curvature": 1,
    "Torsion": 1,
    "Covariance": 6,
    "StandardDeviation": 1,
    "Determined": 1,
}


def quarter_circle(**changes):
    """Radius 50 mm, frame 3 at 0.2 s, with everything known."""
    known = {
        "index": 3,
        "time": 0.2,
        "status": "ok",
        "method": "joint-spline",
        "backbone": arc(50.0, 90.0),
        "covariance": np.tile(COVARIANCE, (5, 1, 1)),
        "residuals": (0.5, 0.7),
        "radius": 1.2,
    }
    return Reconstruction(**{**known, **changes})


def vtk_read(path):
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def values(data, name):
    return vtk_to_numpy(data.GetArray(name))


@pytest.fixture
def written(tmp_path):
    polydata.write_vtp(quarter_circle(), tmp_path / "c.vtp", source_uids=("1.2.3", "1.2.4"))
    return vtk_read(tmp_path / "c.vtp")


# ---- what is written -----------------------------------------------------------------


def test_every_array_of_the_contract_is_there(written):
    data = written.GetPointData()
    found = {data.GetArrayName(i): data.GetArray(i) for i in range(data.GetNumberOfArrays())}
    assert {name: array.GetNumberOfComponents() for name, array in found.items()} == POINT_ARRAYS
    assert {array.GetDataTypeAsString() for array in found.values()} == {"double"}
    assert written.GetPoints().GetData().GetDataTypeAsString() == "double"
    assert data.GetScalars().GetName() == "Abscissas"
    assert data.GetVectors().GetName() == "FrenetTangent"
    assert data.GetNormals().GetName() == "ParallelTransportNormals"


def test_one_polyline_in_equal_steps(written):
    assert written.GetNumberOfCells() == written.GetNumberOfLines() == 1
    assert written.GetNumberOfPoints() == written.GetCell(0).GetNumberOfPoints() == 200
    s = values(written.GetPointData(), "ArcLength")
    np.testing.assert_allclose(np.diff(s), 25 * math.pi / 199, rtol=1e-9)
    points = vtk_to_numpy(written.GetPoints().GetData())
    np.testing.assert_allclose(points[[0, -1]], arc(50, 90).sample(2), atol=1e-9)


def test_quarter_circle_has_its_known_numbers(written):
    data, cell = written.GetPointData(), written.GetCellData()
    assert values(cell, "Length")[0] == pytest.approx(78.5398, abs=1e-3)
    assert values(cell, "Tortuosity")[0] == pytest.approx(0.110721, abs=1e-5)
    np.testing.assert_allclose(values(data, "Curvature"), 0.02, rtol=1e-3)
    np.testing.assert_allclose(values(data, "Torsion"), 0, atol=1e-6)
    np.testing.assert_allclose(values(data, "Radius"), 1.2)
    tangent, normal = values(data, "FrenetTangent"), values(data, "ParallelTransportNormals")
    np.testing.assert_allclose(np.linalg.norm([tangent, normal], axis=-1), 1, rtol=1e-9)
    np.testing.assert_allclose(np.sum(tangent * normal, axis=1), 0, atol=1e-9)


def test_covariance_order_and_standard_deviation(written):
    data = written.GetPointData()
    wanted = [0.04, 0.09, 0.16, 0.01, 0.03, 0.02]  # xx, yy, zz, xy, yz, xz
    np.testing.assert_allclose(values(data, "Covariance"), np.tile(wanted, (200, 1)), rtol=1e-9)
    full = math.sqrt(np.linalg.eigvalsh(COVARIANCE)[-1])
    deviation = values(data, "StandardDeviation")
    np.testing.assert_allclose(deviation[[0, -1]], full, rtol=1e-9)
    assert np.all(deviation[1:-1] < full)  # along the curve nothing counts but at its ends
    np.testing.assert_array_equal(values(data, "Determined"), 1)


def test_field_data(written):
    field = written.GetFieldData()
    text = {
        name: [
            field.GetAbstractArray(name).GetValue(i)
            for i in range(field.GetAbstractArray(name).GetNumberOfValues())
        ]
        for name in ("SPACE", "Method", "Generator", "SourceSOPInstanceUID")
    }
    assert text["SPACE"] == ["LPS"]
    assert text["Method"] == ["joint-spline"]
    assert re.fullmatch(r"stereosom( \d.*)?", text["Generator"][0])
    assert text["SourceSOPInstanceUID"] == ["1.2.3", "1.2.4"]
    assert values(field, "TimeValue") == pytest.approx([0.2])
    assert values(field, "Frame") == pytest.approx([3])
    assert values(field, "ReprojectionError") == pytest.approx([0.5, 0.7])


def test_unknown_radius_is_not_written_and_poor_depth_is_told(tmp_path):
    poor = quarter_circle(radius=None, covariance=np.tile(4.0 * np.eye(3), (2, 1, 1)))
    data = polydata.to_polydata(poor).GetPointData()
    assert not data.HasArray("Radius")
    assert not data.HasArray("MaximumInscribedSphereRadius")
    np.testing.assert_allclose(values(data, "StandardDeviation"), 2.0, rtol=1e-9)
    np.testing.assert_array_equal(values(data, "Determined"), 0)
    thick = quarter_circle(radius=0.7, covariance=np.tile(4.0 * np.eye(3), (2, 1, 1)))
    np.testing.assert_array_equal(
        values(polydata.to_polydata(thick).GetPointData(), "Determined"), 1
    )


@pytest.mark.parametrize(("spacing", "count"), [(1.0, 80), (78.539816339, 2), (1000.0, 2)])
def test_spacing_is_the_longest_step(spacing, count):
    made = polydata.to_polydata(quarter_circle(), spacing=spacing)
    assert made.GetNumberOfPoints() == count


@pytest.mark.parametrize("wrong", [{"samples": 1}, {"spacing": 0.0}, {"spacing": 1e-9}])
def test_senseless_sampling_is_refused(wrong):
    with pytest.raises(ValueError, match=r"spacing|samples"):
        polydata.to_polydata(quarter_circle(), **wrong)


def test_frame_without_backbone_is_refused(tmp_path):
    lost = Reconstruction(7, 0.5, "lost", reason="no device in view b")
    with pytest.raises(ValueError, match="frame 7 has no backbone: no device in view b"):
        polydata.write_vtp(lost, tmp_path / "c.vtp")
    assert not list(tmp_path.iterdir())


def contents(data):
    """Size and values of all numbers and strings, points and line too, and what is active."""
    parts = {"points": data.GetPoints().GetData(), "line": data.GetLines().GetConnectivityArray()}
    for of in ("GetPointData", "GetCellData", "GetFieldData"):
        held = getattr(data, of)()
        for number in range(held.GetNumberOfArrays()):
            parts[of, held.GetArrayName(number)] = held.GetAbstractArray(number)
    to = data.GetPointData()
    active = [getattr(to, f"Get{role}")() for role in ("Scalars", "Vectors", "Normals")]
    return {
        name: (
            array.GetDataTypeSize(),
            array.GetNumberOfComponents(),
            [array.GetValue(number) for number in range(array.GetNumberOfValues())],
        )
        for name, array in parts.items()
    } | {"active": [array and array.GetName() for array in active]}


@pytest.mark.parametrize("known", [True, False])
def test_the_text_of_a_file_is_read_as_what_vtk_holds(known, tmp_path):
    points = np.random.default_rng(0).normal(size=(7, 3))
    described = {"Length": [2.5], "Tortuosity": [0.25], "Frame": [3], "SPACE": ["LPS"]}
    point_data = {}
    if known:
        point_data = {
            "Abscissas": points[:, 0],
            "FrenetTangent": points,
            "ParallelTransportNormals": points[::-1],
            "Covariance": np.hstack([points, points]),
            "Determined": points[:, 0] > 0,
        }
        described |= {'a "name" <&>': ["größer", "", "b"], "ReprojectionError": (0.5, 0.25)}
    (tmp_path / "c.vtp").write_text(vtp_text(points, point_data, described), encoding="utf-8")
    made = make_polydata(points, point_data, described)
    assert contents(vtk_read(tmp_path / "c.vtp")) == contents(made)


# ---- what is read back ---------------------------------------------------------------


def test_round_trip(tmp_path):
    polydata.write_vtp(quarter_circle(), tmp_path / "c.vtp")
    line = polydata.read_vtp(tmp_path / "c.vtp")
    assert (line.time, line.frame) == (0.2, 3)
    assert set(line.arrays) == set(POINT_ARRAYS)
    assert line.field["SPACE"] == ("LPS",)
    assert line.field["Length"] == pytest.approx([78.5398], abs=1e-3)
    assert line.backbone.length == pytest.approx(25 * math.pi, rel=1e-9)
    direct = polydata.to_centerline(quarter_circle())
    np.testing.assert_array_equal(direct.points, line.points)


def test_ras_is_turned(tmp_path):
    made = polydata.to_polydata(quarter_circle(backbone=Backbone.through([[1, 2, 3], [4, 7, 9]])))
    made.GetFieldData().GetAbstractArray("SPACE").SetValue(0, "RAS")
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(made)
    writer.SetFileName(str(tmp_path / "ras.vtp"))
    writer.Write()
    line = polydata.read_vtp(tmp_path / "ras.vtp")
    np.testing.assert_allclose(line.points[[0, -1]], [[-1, -2, 3], [-4, -7, 9]])
    np.testing.assert_allclose(
        line.arrays["FrenetTangent"], line.backbone.tangent(line.arrays["ArcLength"]), atol=1e-9
    )


ASCII = """<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian"><PolyData>
<Piece NumberOfPoints="{n}" NumberOfLines="1">
<Points><DataArray type="Float64" NumberOfComponents="{components}" format="ascii">{points}</DataArray></Points>
<Lines><DataArray type="Int64" Name="connectivity" format="ascii">{line}</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">{end}</DataArray></Lines>
</Piece></PolyData></VTKFile>"""  # noqa: E501
STRAIGHT = {"n": 3, "components": 3, "points": "0 0 0 0 0 5 0 0 9", "line": "0 1 2", "end": 3}


def test_foreign_file_without_any_of_our_arrays(tmp_path):
    file = tmp_path / "foreign.vtp"
    file.write_text(ASCII.format(**{**STRAIGHT, "line": "2 1 0"}))
    line = polydata.read_vtp(file)
    np.testing.assert_allclose(line.points, [[0, 0, 9], [0, 0, 5], [0, 0, 0]])
    assert (line.time, line.frame, line.backbone.length) == (0, 0, pytest.approx(9))


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"components": -3}, "NumberOfComponents = -3"),
        ({"components": 4000000000}, "NumberOfComponents"),
        ({"n": 10**12}, "NumberOfPoints"),
        ({"n": -1}, "NumberOfPoints"),
        ({"line": "0 1 7"}, "points that are not there"),
        ({"line": "0 1 -1"}, "points that are not there"),
        ({"end": 7}, ""),
        ({"points": "0 0 0 0 0 nan 0 0 9"}, "not finite"),
        ({"points": "0 0 0 0 0 1e300 0 0 9"}, "a kilometre away"),
        ({"n": 3, "line": "", "end": 0}, "fewer than two points"),
        ({"points": "1 1 1 1 1 1 1 1 1"}, "two different points"),
        ({"n": 0, "points": "", "line": "", "end": ""}, "offsets"),
    ],
)
def test_broken_files_are_refused_in_one_line(tmp_path, capfd, change, why):
    file = tmp_path / "broken.vtp"
    file.write_text(ASCII.format(**{**STRAIGHT, **change}))
    with pytest.raises(InputError, match=re.escape(why) or None) as caught:
        polydata.read_vtp(file)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")  # VTK speaks through the error alone


@pytest.mark.parametrize(
    "text",
    [
        "",
        "not xml",
        "<html></html>",
        "<VTKFile",
        '<VTKFile type="ImageData"/>',
        "<AppendedData",
        '<VTKFile type="PolyData">' + "<a>" * 200_000,
        '<!DOCTYPE a [<!ENTITY b "c">]><VTKFile type="PolyData"/>',
    ],
)
def test_what_is_no_vtp_is_refused(tmp_path, capfd, text):
    (tmp_path / "no.vtp").write_text(text)
    with pytest.raises(InputError):
        polydata.read_vtp(tmp_path / "no.vtp")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("mode", "encoded"),
    [("Ascii", True), ("Binary", True), ("Appended", True), ("Appended", False)],
)
@pytest.mark.parametrize("compressor", ["None", "LZ4", "ZLib", "LZMA"])
@pytest.mark.parametrize(("byte_order", "size"), [("LittleEndian", 64), ("BigEndian", 32)])
def test_every_way_to_write_a_vtp_is_read(tmp_path, mode, compressor, encoded, byte_order, size):
    """ParaView's default, for one, is raw appended data."""
    made = polydata.to_polydata(quarter_circle())
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(made)
    writer.SetFileName(str(tmp_path / "odd.vtp"))
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    getattr(writer, f"SetByteOrderTo{byte_order}")()
    getattr(writer, f"SetHeaderTypeToUInt{size}")()
    getattr(writer, f"SetIdTypeToInt{size}")()
    writer.SetEncodeAppendedData(encoded)
    assert writer.Write()
    line = polydata.read_vtp(tmp_path / "odd.vtp")
    np.testing.assert_allclose(line.points, polydata.from_polydata(made).points, atol=1e-9)
    assert set(line.arrays) == set(POINT_ARRAYS)
    assert line.field["SPACE"] == ("LPS",)


def mutations(whole, count, seed):
    """Copies of a file with one to four bytes changed, a stretch cut out, or one doubled."""
    chance = random.Random(seed)
    for _ in range(count):
        broken = bytearray(whole)
        for _ in range(chance.randint(1, 4)):
            broken[chance.randrange(len(broken))] = chance.randrange(256)
        at, size = chance.randrange(len(broken)), chance.randrange(40)
        kind = chance.randrange(4)
        if kind == 0:
            del broken[at : at + size]
        elif kind == 1:
            broken[at:at] = broken[at : at + size]
        yield bytes(broken)


@pytest.mark.parametrize(
    ("count", "seed"), [(60, 1), pytest.param(1500, 2, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("mode", ["ascii", "binary", "appended"])
def test_mutated_files_are_read_or_refused_in_one_line(tmp_path, capfd, mode, count, seed):
    """In this process, VTK's own reader aborts on some of these."""
    writer = vtkXMLPolyDataWriter()
    getattr(writer, f"SetDataModeTo{mode.title()}")()
    writer.SetEncodeAppendedData(False)
    writer.SetCompressorTypeToNone()
    writer.SetInputData(polydata.to_polydata(quarter_circle(), samples=20))
    writer.SetFileName(str(tmp_path / "whole.vtp"))
    writer.Write()
    refused, lines = 0, set()
    for broken in mutations((tmp_path / "whole.vtp").read_bytes(), count, seed):
        (tmp_path / "broken.vtp").write_bytes(broken)
        try:
            line = polydata.read_vtp(tmp_path / "broken.vtp")
        except InputError as error:
            refused += 1
            lines.add(len(str(error).splitlines()))
        else:
            assert np.isfinite(line.points).all()
            assert all(len(array) == len(line.points) for array in line.arrays.values())
    assert refused > 0
    assert lines == {1}
    assert capfd.readouterr() == ("", "")


def test_a_reader_that_dies_is_replaced(tmp_path):
    """Nested tags behind the header, where only VTK looks, crash its parser; files go on."""
    polydata.write_vtp(quarter_circle(), tmp_path / "good.vtp")
    head = b'<VTKFile type="PolyData" version="0.1"><PolyData/><AppendedData encoding="raw">'
    (tmp_path / "deep.vtp").write_bytes(head + b"</AppendedData>" + b"<a>" * 3_000_000)
    with pytest.raises(InputError):
        polydata.read_vtp(tmp_path / "deep.vtp")
    assert polydata.read_vtp(tmp_path / "good.vtp").frame == 3


def test_cut_off_file_is_refused(tmp_path, capfd):
    polydata.write_vtp(quarter_circle(), tmp_path / "c.vtp")
    whole = (tmp_path / "c.vtp").read_bytes()
    for share in (0.1, 0.3, 0.6, 0.9):
        (tmp_path / "c.vtp").write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(InputError):
            polydata.read_vtp(tmp_path / "c.vtp")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["missing.vtp", "."])
def test_missing_file_is_refused(tmp_path, name):
    with pytest.raises(InputError, match="cannot be read"):
        polydata.read_vtp(tmp_path / name)


# ---- other files ---------------------------------------------------------------------


def test_pvd_names_files_and_seconds(tmp_path):
    polydata.write_pvd([(0.0, "a.vtp"), (1 / 15, 'b&"c".vtp')], tmp_path / "c.pvd")
    sets = ElementTree.parse(tmp_path / "c.pvd").getroot().findall("Collection/DataSet")
    assert [(float(e.get("timestep")), e.get("file")) for e in sets] == [
        (0.0, "a.vtp"),
        (1 / 15, 'b&"c".vtp'),
    ]


def test_markups_curve(tmp_path):
    polydata.write_markups(quarter_circle(), tmp_path / "c.mrk.json", samples=20)
    content = json.loads((tmp_path / "c.mrk.json").read_text())
    assert content["@schema"].endswith("markups-schema-v1.0.3.json#")
    (curve,) = content["markups"]
    assert (curve["type"], curve["coordinateSystem"]) == ("Curve", "LPS")
    positions = [point["position"] for point in curve["controlPoints"]]
    np.testing.assert_allclose(positions, arc(50, 90).sample(20), atol=1e-9)
    measured = {each["name"]: each["controlPointValues"] for each in curve["measurements"]}
    assert measured["Radius"] == [1.2] * 20
    assert len(measured["StandardDeviation"]) == 20


# ---- whole or not at all -------------------------------------------------------------


@pytest.mark.parametrize("where", ["missing/c.vtp", "file/c.vtp", "folder"])
def test_what_cannot_be_written_is_told_and_leaves_nothing(tmp_path, where):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    before = sorted(tmp_path.rglob("*"))
    for write in (polydata.write_vtp, polydata.write_markups):
        with pytest.raises(InputError, match="cannot be written"):
            write(quarter_circle(), tmp_path / where)
    with pytest.raises(InputError, match="cannot be written"):
        polydata.write_pvd([(0.0, "a.vtp")], tmp_path / where)
    assert sorted(tmp_path.rglob("*")) == before


def test_full_disk_keeps_the_old_file(tmp_path):
    def fill(part):
        part.write_text("half")
        raise OSError(28, "No space left on device")

    (tmp_path / "c.txt").write_text("old")
    with pytest.raises(InputError, match="No space left"), write_whole(tmp_path / "c.txt") as part:
        fill(part)
    assert [file.read_text() for file in tmp_path.iterdir()] == ["old"]


def test_interrupted_writing_leaves_nothing(tmp_path):
    with pytest.raises(KeyboardInterrupt), write_whole(tmp_path / "c.txt") as part:
        raise KeyboardInterrupt
    assert not part.exists()
    assert not list(tmp_path.iterdir())


def test_sweep_removes_leftovers_only(tmp_path):
    with write_whole(tmp_path / "c.txt") as part:
        part.write_text("new")
        leftover = tmp_path / part.name
    leftover.write_text("half")
    sweep(tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["c.txt"]


def test_names_and_words_of_others_are_kept(tmp_path):
    """Quotes, other letters, nothing at all: a sequence holds what a foreign file held."""
    field = {'a "b" <c>': np.ones((2, 3)), "words": ("ä", "", "&"), "none": ()}
    text = vtp_text(np.eye(3), {"1 & 2": np.arange(3.0)}, field)
    (tmp_path / "c.vtp").write_text(text, encoding="utf-8")
    read = content_of(vtk_read(tmp_path / "c.vtp"))
    assert read.point_data["1 & 2"].tolist() == [0, 1, 2]
    assert read.described['a "b" <c>'].shape == (2, 3)
    assert (read.described["words"], read.described["none"]) == (("ä", "", "&"), ())
