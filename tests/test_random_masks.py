"""Masks that no device ever made: a result or a reason, soon, and nothing that is not a number."""

import faulthandler

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from stereosom import Observation, reconstruct
from stereosom.synthetic import arc, converging_rig, silhouette

pytestmark = pytest.mark.usefixtures("compiled_loops")
WIDTH, HEIGHT = 96, 72
X, Y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
ANGLES = (5, 20, 45, 60, 90, 170)
# Generous: the slowest of 10,000 takes a second.
LONGEST_S = 60


def blocks(rng):
    mask = np.zeros((HEIGHT, WIDTH), dtype=bool)
    for _ in range(rng.integers(1, 10)):
        row, column = rng.integers(0, HEIGHT), rng.integers(0, WIDTH)
        high, wide = rng.integers(1, 30, 2)
        mask[row : row + high, column : column + wide] = rng.random() < 0.8
    return mask


def clouds(rng):
    noise = gaussian_filter(rng.normal(size=(HEIGHT, WIDTH)), rng.uniform(0.5, 8))
    return noise > np.quantile(noise, rng.uniform(0.3, 0.99))


def lines(rng):
    mask = np.zeros((HEIGHT, WIDTH), dtype=bool)
    for _ in range(rng.integers(1, 5)):
        start, stop = rng.uniform(-10, [WIDTH + 10, HEIGHT + 10], (2, 2))
        length = np.linalg.norm(stop - start)
        way = (stop - start) / length
        along = (X - start[0]) * way[0] + (Y - start[1]) * way[1]
        beside = np.abs((X - start[0]) * way[1] - (Y - start[1]) * way[0])
        mask |= (beside < rng.uniform(0.5, 5)) & (along > 0) & (along < length)
    return mask


def rings(rng):
    mask = np.zeros((HEIGHT, WIDTH), dtype=bool)
    for _ in range(rng.integers(1, 3)):
        column, row = rng.uniform(0, [WIDTH, HEIGHT])
        away = np.hypot(X - column, Y - row)
        mask |= np.abs(away - rng.uniform(3, 50)) < rng.uniform(0.5, 5)
    return mask


def specks(rng):
    return rng.random((HEIGHT, WIDTH)) < rng.choice([0.001, 0.01, 0.05, 0.3, 0.7, 0.99])


def full(rng):
    return rng.random((HEIGHT, WIDTH)) >= rng.choice([0, 0.01])


def tiny(rng):
    mask = np.zeros((HEIGHT, WIDTH), dtype=bool)
    row, column = rng.integers(0, HEIGHT - 1), rng.integers(0, WIDTH - 1)
    high, wide = rng.integers(1, 8, 2)
    mask[row : row + high, column : column + wide] = True
    return mask


def worms(rng):
    steps = gaussian_filter(rng.normal(size=(300, 2)), (rng.uniform(5, 40), 0))
    way = np.cumsum(steps, axis=0)
    way *= rng.uniform(5, 60) / np.abs(way).max()
    way += rng.uniform(0, [WIDTH, HEIGHT])
    mask, radius = np.zeros((HEIGHT, WIDTH), dtype=bool), rng.uniform(0.6, 6)
    for column, row in way[::2]:
        mask |= (X - column) ** 2 + (Y - row) ** 2 < radius**2
    return mask


def borders(rng):
    wide = rng.integers(1, 6)
    mask = np.zeros((HEIGHT, WIDTH), dtype=bool)
    mask[:wide] = True
    mask[:, -wide:] |= rng.random() < 0.5
    mask[HEIGHT // 2 : HEIGHT // 2 + wide] |= rng.random() < 0.5
    return mask


KINDS = (blocks, clouds, lines, rings, specks, full, tiny, worms, borders)


def random_pair(seed):
    """Both views of any kind; at times the same; at times a device with that much dirt."""
    rng = np.random.default_rng(seed)
    rig = converging_rig(float(rng.choice(ANGLES)), focal_length=225, image_size=(WIDTH, HEIGHT))
    masks = [KINDS[rng.integers(len(KINDS))](rng) for _ in "ab"]
    choice = rng.random()
    if choice < 0.1:
        masks[1] = masks[0]
    elif choice < 0.4:
        curve = arc(rng.uniform(15, 80), rng.uniform(20, 120))
        curve = curve.transformed(np.eye(3), rng.uniform(-20, 60, 3))
        radius = rng.choice([0.5, 2.0, 6.0])
        shown = [silhouette(curve, radius, camera) for camera in (rig.a, rig.b)]
        hurt = [rng.random() < 0.5 for _ in "ab"]
        kept = rng.random() < 0.5  # dirt that adds, or that takes away
        masks = [
            (view | mask if kept else view & ~mask) if damaged else view
            for view, mask, damaged in zip(shown, masks, hurt, strict=True)
        ]
    return Observation.from_masks(*masks, rig)


def try_pair(seed):
    """Whether there is a curve; a hang ends the run and shows where it was."""
    faulthandler.dump_traceback_later(LONGEST_S, exit=True)
    try:
        result = reconstruct(random_pair(seed))
    finally:
        faulthandler.cancel_dump_traceback_later()
    assert result.status in ("ok", "failed")
    if not result.ok:
        assert result.reason, f"seed {seed}"
        return False
    curve = result.backbone
    s = curve.arc_lengths(50)
    found = (
        curve(s), curve.tangent(s), curve.curvature(s), result.standard_deviation_at(s),
        result.covariance, result.residuals, curve.length, result.radius,
    )  # fmt: skip
    assert all(np.isfinite(numbers).all() for numbers in found), f"seed {seed}"
    assert curve.length > 0, f"seed {seed}"
    assert result.radius > 0, f"seed {seed}"
    least = np.linalg.eigvalsh(result.covariance).min()
    assert least > -1e-6 * np.abs(result.covariance).max(), f"seed {seed}"
    return True


def test_random_masks_end_in_a_result_or_a_reason():
    found = [try_pair(seed) for seed in range(200)]
    assert 5 < sum(found) < 150  # both ways of ending are tried


@pytest.mark.parametrize("seed", [1843, 5588])
def test_a_curve_whose_outline_is_nowhere_seen_is_refused(seed):
    # Of both, the fit from afar was cut down to no points at all.
    assert not try_pair(seed)


@pytest.mark.slow
@pytest.mark.parametrize("thousand", range(10))
def test_ten_thousand_random_masks_end_in_a_result_or_a_reason(thousand):
    found = [try_pair(seed) for seed in range(1000 * thousand, 1000 * (thousand + 1))]
    assert 20 < sum(found) < 750
