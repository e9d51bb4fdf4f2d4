"""`vtkStereoSOM` in ParaView: load this file with Tools > Manage Plugins, or `LoadPlugin`.

ParaView's own Python runs it, so `stereosom`, numpy and scipy must be on its path:
docs/in-paraview.md.
"""

# mypy: disable-error-code="import-not-found,untyped-decorator"
from __future__ import annotations

from typing import Any

from paraview.util.vtkAlgorithm import smdomain, smhint, smproperty, smproxy

from stereosom.reconstruct import DEFAULT_METHOD, METHODS
from stereosom_plugin.vtk_filter import SEGMENTERS, vtkStereoSOM


def _choices(names: Any) -> str:
    entries = "".join(f'<String value="{name}"/>' for name in names)
    return f'<StringListDomain name="choices">{entries}</StringListDomain>'


@smproxy.filter(name="StereoSOM", label="Stereo SOM")
@smhint.xml('<ShowInMenu category="Medical"/>')
@smproperty.input(name="ViewB", port_index=1)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
@smproperty.input(name="ViewA", port_index=0)
@smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
class StereoSOM(vtkStereoSOM):
    """Reconstruct the backbone of a thin flexible device from two pictures."""

    @smproperty.stringvector(name="RigFile", default_values="")
    @smdomain.filelist()
    @smhint.filechooser(extensions="json", file_description="Rig: geometry of both views")
    def SetRigFile(self, path: str | None) -> None:
        """Take the geometry of both views from a `rig.json`."""
        super().SetRigFile(None if path in ("", "None") else path)

    @smproperty.xml(
        f"""<StringVectorProperty name="Segmenter" command="SetSegmenter"
            number_of_elements="1" default_values="mask">{_choices(SEGMENTERS)}
            <Documentation>mask: above half of the range; xray: dark tubes.</Documentation>
            </StringVectorProperty>"""
    )
    def SetSegmenter(self, segmenter: Any) -> None:
        """Choose how pixels of the device are found."""
        super().SetSegmenter(segmenter)

    @smproperty.xml(
        f"""<StringVectorProperty name="Method" command="SetMethod"
            number_of_elements="1" default_values="{DEFAULT_METHOD}">{_choices(METHODS)}
            </StringVectorProperty>"""
    )
    def SetMethod(self, name: str) -> None:
        """Choose the method."""
        super().SetMethod(name)

    @smproperty.intvector(name="Samples", default_values=200)
    @smdomain.intrange(min=2, max=2000)
    def SetSamples(self, count: int) -> None:
        """Set the number of points of the centerline."""
        super().SetSamples(count)

    @smproperty.doublevector(name="Radius", label="Radius (mm)", default_values=0.0)
    def SetRadius(self, radius: float) -> None:
        """Radius of the device, mm; 0: unknown."""
        super().SetRadius(radius)

    @smproperty.doublevector(name="Length", label="Deployed length (mm)", default_values=0.0)
    def SetLength(self, length: float) -> None:
        """Deployed arc length, mm; 0: unknown."""
        super().SetLength(length)

    @smproperty.intvector(name="BaseIsKnown", default_values=0, panel_visibility="advanced")
    @smdomain.xml('<BooleanDomain name="bool"/>')
    def SetBaseIsKnown(self, known: int) -> None:
        """Whether `Base` says where the device begins."""
        self._base_is_known = bool(known)
        super().SetBase(self._base_given if known else None)

    @smproperty.doublevector(
        name="Base", label="Base (mm)", default_values=[0.0, 0.0, 0.0], panel_visibility="advanced"
    )
    def SetBase(self, x: float, y: float, z: float) -> None:
        """Where the device begins, mm."""
        self._base_given = (x, y, z)
        super().SetBase(self._base_given if self._base_is_known else None)

    @smproperty.intvector(name="TopDown", default_values=0, panel_visibility="advanced")
    @smdomain.xml('<BooleanDomain name="bool"/>')
    def SetTopDown(self, top_down: int) -> None:
        """Whether the first row is the top; ParaView's readers of pictures begin at the bottom."""
        super().SetTopDown(bool(top_down))

    def __init__(self) -> None:
        super().__init__()
        self._base_is_known, self._base_given = False, (0.0, 0.0, 0.0)
