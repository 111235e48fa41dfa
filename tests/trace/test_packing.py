"""The packed picture holds every pixel once, and blocks of the target as blocks."""

import numpy as np
import pytest

from stereo_reproject.trace.packing import pack
from stereo_reproject.trace.tuning import TUNING

BLOCK = TUNING.block_side_pixels

TARGET = (100, 150)


def scattered(share, seed=1):
    return np.argwhere(np.random.default_rng(seed).random(TARGET) < share)


def picture(packing, places):
    """(height, width, 2) target row and column of each packed pixel, -1 where there is none."""
    result = np.full((packing.height * packing.width, 2), -1)
    result[packing.at[0]] = places
    return result.reshape(packing.height, packing.width, 2)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.05, 0.5, 1.0])
def test_every_pixel_has_a_place_of_its_own(share):
    places = scattered(share)
    packing = pack([places])
    (at,) = packing.at
    assert np.unique(at).size == len(places)
    assert at.max(initial=0) < packing.width * packing.height
    shown = picture(packing, places).reshape(-1, 2)
    np.testing.assert_array_equal(np.unique(shown[shown[:, 0] >= 0], axis=0), places)


@pytest.mark.parametrize("count", [3000, 20000, 20001, 123456])
def test_hardly_a_pixel_is_wasted(count):
    places = np.argwhere(np.ones((400, 400), bool))[:count]
    packing = pack([places])
    assert packing.width * packing.height - count < max(0.03 * count, 2 * BLOCK**2)
    assert 0.5 < packing.width / packing.height < 2.0


@pytest.mark.parametrize("size", [2, 4, 8, 16])
def test_a_whole_block_of_the_target_is_one_of_the_packed_picture(size):
    """However much is scattered around it."""
    mask = np.random.default_rng(size).random(TARGET) < 0.02
    top, left = 2 * size, 3 * size
    mask[top : top + size, left : left + size] = True
    places = np.argwhere(mask)
    shown = picture(pack([places]), places)
    row, column = (int(axis[0]) for axis in np.nonzero(np.all(shown == (top, left), axis=-1)))
    block = np.stack(np.mgrid[top : top + size, left : left + size], axis=-1)
    np.testing.assert_array_equal(shown[row : row + size, column : column + size], block)
    assert row % size == column % size == 0


def block_of(packing, at):
    """(N,): which block of the packed picture each pixel is in."""
    return at // packing.width // BLOCK * (packing.width // BLOCK) + at % packing.width // BLOCK


def place_in_block(packing, at):
    return at % packing.width % BLOCK, at // packing.width % BLOCK


def test_views_have_blocks_of_their_own():
    """However few of its pixels are wanted; and each lies within its blocks as it does alone."""
    views = [scattered(0.3, seed=1), scattered(0.0), scattered(0.001, seed=2), scattered(0.2, seed=3)]
    packing = pack(views)
    blocks = [set(block_of(packing, at)) for at in packing.at]
    assert sum(map(len, blocks)) == len(set.union(*blocks))
    for places, at in zip(views, packing.at, strict=True):
        alone = pack([places])
        np.testing.assert_array_equal(place_in_block(packing, at), place_in_block(alone, alone.at[0]))
    together = np.concatenate(packing.at)
    assert np.unique(together).size == len(together) == sum(map(len, views))
    assert together.max() < packing.width * packing.height


def test_what_is_traced_again_comes_after_all_else():
    mask = np.random.default_rng(2).random(TARGET) < 0.3
    first = np.argwhere(mask)
    twins = first[::6]
    packing = pack([np.concatenate([first, twins])])
    block = block_of(packing, packing.at[0])
    assert block[len(first) :].min() >= block[: len(first)].max()
    both = picture(packing, np.concatenate([first, twins]))
    for twin in twins[::20]:
        (row, again), (column, aside) = np.nonzero(np.all(both == twin, axis=-1))
        assert max(abs(row - again), abs(column - aside)) > BLOCK // 2


def test_large_frames_have_room():
    places = np.array([[0, 0], [65535, 65535], [65535, 0], [0, 65535]])
    assert np.unique(pack([places]).at[0]).size == 4
