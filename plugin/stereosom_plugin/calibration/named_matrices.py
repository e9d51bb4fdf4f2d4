"""Matrices by name: OpenCV's FileStorage (YAML, XML, JSON), SCARED, Bouguet's toolbox, MATLAB.

All of them hold K, the distortion and X_b = R X_a + T; they differ in what they call them.
"""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from stereosom.arrays import Floats

from .content import Content, numbers, plain_keys
from .model import Calibration, View, assemble, lens_of
from .settings import Settings
from .size import ordered_size

# Without case, and without what stands between words.
_SIDES = (("1", "2"), ("left", "right"), ("l", "r"), ("0", "1"))
_INTRINSICS = ("m", "k", "kk", "cameramatrix", "intrinsicmatrix", "intrinsics", "cm")
_DISTORTION = (
    "d", "kc", "dist", "distcoeffs", "distcoeff", "distortion", "distortioncoefficients",
)  # fmt: skip
_ROTATION = ("r", "rotation", "rotationofcamera2", "rotationmatrix")
_TRANSLATION = ("t", "translation", "translationofcamera2", "translationvector")
_SIZE = ("imagesize", "imgsize", "size", "resolution")
_WIDTH_HEIGHT = (("imagewidth", "imageheight"), ("width", "height"), ("nx", "ny"))
_FISHEYE = ("fisheye", "equidistant", "kannala")


def read_named_matrices(contents: list[Content], settings: Settings) -> Calibration | None:
    """Read one file, or two that complete each other (intrinsics.yml and extrinsics.yml)."""
    trees = [_tree(content) for content in contents]
    if any(tree is None for tree in trees):
        return None
    named: dict[str, Any] = {}
    for tree in trees:
        named.update(tree or {})
    raw = _pair(named, _INTRINSICS)
    rectified = _pair(named, ("p", "projection", "projectionmatrix"))
    if raw is None and rectified is None:
        return None
    source = _source(contents[0], named)
    if raw is None or settings.rectified:
        if rectified is None:
            raise ValueError("holds no projections P1 and P2 of rectified pictures")
        return _rectified(rectified, named, source, settings)
    rotation = _first(named, _ROTATION) or _first(named, ("om",))
    translation = _first(named, _TRANSLATION)
    if rotation is None or translation is None:
        raise ValueError(
            "holds no rotation R and translation T between the cameras; "
            "give the stereo calibration, not that of single cameras"
        )
    matrices = [numbers(node, "camera matrix", (3, 3)) for node in raw]
    given = _pair(named, _DISTORTION) or ([0.0] * 5, [0.0] * 5)
    coefficients = [numbers(node, "distortion").ravel() for node in given]
    said = " ".join(str(value).lower() for key, value in named.items() if "model" in key)
    fisheye = settings.fisheye or any(word in said for word in _FISHEYE)
    notes = []
    if not fisheye and all(len(each) == 4 and np.any(each) for each in coefficients):
        notes.append("4 coefficients are read as k1, k2, p1, p2; with --fisheye as k1 to k4")
    size, noted = _size(named, matrices, settings)
    lenses = [lens_of(k, d, fisheye) for k, d in zip(matrices, coefficients, strict=True)]
    a = View(matrices[0], np.eye(3), np.zeros(3), size, lenses[0])
    moved = numbers(translation, "T", (3,))
    b = View(matrices[1], _rotation(rotation), moved, size, lenses[1])
    return assemble(
        a, b, source, units=settings.units or "mm", image_size=settings.image_size,
        notes=(*notes, *noted),
    )  # fmt: skip


def _rectified(
    nodes: tuple[Any, Any], named: dict[str, Any], source: str, settings: Settings
) -> Calibration:
    """P1, P2 = K [I | t] of a rectified pair (OpenCV, `stereoRectify`): no lens, no rotation."""
    projections = [numbers(node, "projection", (3, 4)) for node in nodes]
    size, notes = _size(named, [matrix[:, :3] for matrix in projections], settings)
    views = [
        View(matrix[:, :3], np.eye(3), np.linalg.solve(matrix[:, :3], matrix[:, 3]), size)
        for matrix in projections
    ]
    return assemble(
        views[0], views[1], f"{source}, rectified", units=settings.units or "mm",
        image_size=settings.image_size,
        notes=("P1 and P2 are for rectified pictures, free of lens distortion", *notes),
    )  # fmt: skip


def _tree(content: Content) -> dict[str, Any] | None:
    tree = content.tree
    if content.kind == "xml":
        if tree.tag != "opencv_storage":
            return None
        tree = _of_xml(tree)
    if not isinstance(tree, dict) or content.kind == "ini":
        return None
    if isinstance(tree.get("camera-calibration"), dict):  # SCARED's frame_data
        tree = tree["camera-calibration"]
    return plain_keys(tree.items())


def _of_xml(element: Element) -> Any:
    if len(element) == 0:
        return element.text or ""
    return {child.tag: _of_xml(child) for child in element}


def _source(content: Content, named: dict[str, Any]) -> str:
    if content.kind == "mat":
        bouguet = "om" in named and "kkleft" in named
        return "Calib_Results_stereo.mat" if bouguet else "MATLAB matrices"
    if content.kind == "json" and "kl" in named:
        return "SCARED frame_data"
    return f"OpenCV FileStorage, {content.kind.upper()}"


def _pair(named: dict[str, Any], stems: tuple[str, ...]) -> tuple[Any, Any] | None:
    for sides in _SIDES:
        for stem in stems:
            for names in ([stem + side for side in sides], [side + stem for side in sides]):
                if all(named.get(name) is not None for name in names):
                    return named[names[0]], named[names[1]]
    return None


def _first(named: dict[str, Any], names: tuple[str, ...]) -> Any:
    return next((named[name] for name in names if named.get(name) is not None), None)


def _rotation(node: Any) -> Floats:
    """R, given as a matrix or as Rodrigues' vector."""
    values = numbers(node, "R")
    if values.size == 3:
        return np.asarray(Rotation.from_rotvec(values.ravel()).as_matrix())
    return numbers(node, "R", (3, 3))


def _size(
    named: dict[str, Any], matrices: list[Floats], settings: Settings
) -> tuple[tuple[int, int] | None, tuple[str, ...]]:
    for names in _WIDTH_HEIGHT:
        if all(name in named for name in names):
            width, height = (int(numbers(named[name], name, ())) for name in names)
            return (width, height), ()
    node = _first(named, _SIZE)
    if node is None:
        return None, ()
    if isinstance(node, dict) and {"width", "height"} <= set(node):
        node = [node["width"], node["height"]]
    return ordered_size(numbers(node, "image size", (2,)), matrices, settings.image_size)
