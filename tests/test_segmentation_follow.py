"""A device that moved is found about where it was; the best way is the best there is."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial import cKDTree

from stereosom_plugin.segmentation.follow import _PRICE, MOST_TURN, TURN, follow
from stereosom_plugin.segmentation.tube import Tube
from stereosom_plugin.segmentation.way import best_way
from stereosom_plugin.segmentation.xray import prepare

SIZE = 256


def line(bend=0.0, shift=0.0, top=60.0):
    y = np.arange(SIZE - 1, top, -0.5)
    x = 128 + shift + bend * ((SIZE - y) / SIZE) ** 2
    return np.column_stack([x, y])


def picture(axis, width=6.0):
    row, column = np.indices((SIZE, SIZE))
    distance, _ = cKDTree(axis).query(np.stack([column, row], axis=-1).reshape(-1, 2))
    share = np.sqrt(np.clip(1 - (2 * distance / width) ** 2, 0, None)).reshape(SIZE, SIZE)
    light = ndimage.gaussian_filter(2000 * np.exp(-1.5 * share), 0.7)
    return np.random.default_rng(0).poisson(light).astype(float)


LAST = Tube(line(), np.full(len(line()), 3.0), 1.5, 0.7, (True, False))


@pytest.mark.parametrize("now", [line(), line(shift=12), line(bend=30), line(top=45), line(top=75)])
def test_it_is_found_where_it_moved(now):
    found = follow(prepare(picture(now)), LAST, LAST.line)
    assert found.enters == (True, False)
    assert 0.8 < found.absorption < 1.7  # a mean over the width
    assert cKDTree(now).query(found.points)[0].max() < 2.5
    assert cKDTree(found.points).query(now)[0].max() < 8


def test_nothing_is_found_where_nothing_is():
    blank = np.random.default_rng(0).poisson(2000, (SIZE, SIZE)).astype(float)
    assert follow(prepare(blank), LAST, LAST.line) is None


def test_no_way_collects_more():
    score = np.random.default_rng(3).random((5, 4))

    def worth(way):
        turns = np.abs(np.diff(way))
        if turns.max() > MOST_TURN:
            return -np.inf
        return score[np.arange(5), way].sum() - TURN * (turns**2).sum()

    best = max(product(range(4), repeat=5), key=lambda way: worth(np.array(way)))
    assert tuple(best_way(score, _PRICE)) == best
