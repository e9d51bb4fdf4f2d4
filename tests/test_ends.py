import numpy as np
import pytest

from stereosom.backbone import Backbone
from stereosom.ends import find_ends, mask_ends, trim_to_shared_stretch
from stereosom.observation import Observation
from stereosom.reconstruction import HardFrame
from stereosom.synthetic import arc, converging_rig, growing_helix, observe, silhouette


def entering(rig):
    """A device that comes from far below both pictures; view b is cut off higher."""
    curve = Backbone.through([[0, 0, -200], [0, 5, -50], [10, 0, 40], [30, 5, 100]])
    mask_a, mask_b = (silhouette(curve, 1.5, camera) for camera in (rig.a, rig.b))
    mask_b[560:] = False
    size = np.array([1024, 560]) - 0.5
    border_b = np.array([[-0.5, -0.5], [size[0], -0.5], size, [-0.5, size[1]]])
    whole = Observation.from_masks(mask_a, mask_b, rig)
    return Observation.from_masks(
        mask_a, mask_b, rig, field_of_view=(whole.field_of_view[0], border_b)
    ), curve


def test_what_one_view_sees_beyond_the_border_of_the_other_is_trimmed():
    rig = converging_rig(60)
    seen, _ = entering(rig)
    trimmed = trim_to_shared_stretch(seen)
    lowest_a = rig.epipolar_angle(rig.a, trimmed.pixels_a)
    lowest_b = rig.epipolar_angle(rig.b, trimmed.pixels_b)
    ends = [min(lowest_a), max(lowest_a)], [min(lowest_b), max(lowest_b)]
    assert ends[0] == pytest.approx(ends[1], abs=2 / 2400)  # two pixels at this focal length
    assert len(trimmed.pixels_a) < len(seen.pixels_a)
    assert len(trimmed.pixels_b) == len(seen.pixels_b)


def test_the_field_of_view_ends_where_it_was_trimmed():
    trimmed = trim_to_shared_stretch(entering(converging_rig(60))[0])
    assert trimmed.distance_to_border("a", trimmed.pixels_a).min() < 1.5


def test_swapping_the_views_swaps_the_trimming():
    from dataclasses import replace

    from stereosom.camera import StereoRig

    seen, _ = entering(converging_rig(60))
    swapped = replace(
        seen,
        pixels_a=seen.pixels_b,
        pixels_b=seen.pixels_a,
        rig=StereoRig(seen.rig.b, seen.rig.a),
        field_of_view=seen.field_of_view[::-1],
    )
    assert len(trim_to_shared_stretch(swapped).pixels_b) == len(
        trim_to_shared_stretch(seen).pixels_a
    )


def test_a_device_inside_both_pictures_is_not_trimmed():
    seen = observe(growing_helix(), 3.2, converging_rig(45))
    assert trim_to_shared_stretch(seen) is seen


def test_the_end_at_the_border_is_the_base():
    seen, curve = entering(converging_rig(60))
    ends = find_ends(trim_to_shared_stretch(seen))
    assert "border" in ends.because
    assert np.linalg.norm(ends.tip - curve.tip) < 3
    assert ends.base[2] < ends.tip[2]


def test_where_nothing_decides_it_says_so():
    curve = arc(60, 90)
    ends = find_ends(observe(curve, 1.0, converging_rig(60)))
    assert "nothing tells" in ends.because
    found = sorted([ends.base.tolist(), ends.tip.tolist()])
    assert np.array(found) == pytest.approx(
        np.array(sorted([curve.base, curve.tip], key=list)), abs=3
    )


def test_ends_of_an_outline_are_the_ends_of_the_device():
    angle = np.linspace(0, np.pi, 600)
    inner, outer = (r * np.column_stack([np.cos(angle), np.sin(angle)]) for r in (190, 210))
    ends = mask_ends(np.vstack([inner, outer]), "edges")
    assert np.sort(ends[:, 0]) == pytest.approx([-200, 200], abs=12)
    assert ends[:, 1] == pytest.approx([0, 0], abs=12)


def test_pixels_in_one_place_have_no_ends():
    with pytest.raises(HardFrame, match="one place"):
        mask_ends(np.full((30, 2), 7.0))
