"""The cheapest way through two sequences: both implementations give the same."""

from __future__ import annotations

import numpy as np
import pytest

from stereosom.monotone import reference

compiled = pytest.importorskip("stereosom.monotone.compiled")


@pytest.mark.parametrize("seed", range(20))
def test_compiled_gives_the_same(seed):
    rng = np.random.default_rng(seed)
    one = np.cumsum(rng.normal(0.5, 2, rng.integers(1, 60)))
    two = np.cumsum(rng.normal(0.5, 2, rng.integers(1, 60)))
    prices = [tuple(rng.choice([0.45, 25.0], 2)) for _ in range(2)]
    (way, price), (expected, cost) = (
        loops.cheapest_way(one, two, *prices) for loops in (compiled, reference)
    )
    assert price == pytest.approx(cost)
    assert np.array_equal(way, expected)
