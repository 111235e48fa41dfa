"""Materials judged as a whole: by all probes that are on them, and only as far as that foretells these."""

import numpy as np
import pytest

from stereo_reproject.shown_materials import FEWEST, ShownMaterials

TILES = 200


def shown(rng, *, pixels=16, kinds=12):
    """Tiles of a few pixels each; materials of which most tiles have one or two, and some are rare."""
    tile = np.repeat(np.arange(TILES), pixels)
    main = rng.integers(0, kinds, TILES) ** 2 // kinds
    material = np.where(rng.random(tile.size) < 0.8, np.repeat(main, pixels), rng.integers(0, kinds, tile.size))
    return tile, material.astype(np.intp), rng.random(tile.size), main.astype(np.intp)


def test_a_tile_is_told_by_the_other_tiles_that_show_its_materials():
    rng = np.random.default_rng(9)
    tile, material, risk, of_probe = shown(rng)
    kept = tile != 7
    materials = ShownMaterials.of_pixels(tile[kept], material[kept], risk[kept], of_probe)
    excess, otherwise = rng.normal(size=(2, TILES))
    told = materials.excess(excess, otherwise)
    rare = 0
    for number in range(TILES):
        expected = 0.0 if number != 7 else otherwise[7]
        here = kept & (tile == number)
        for kind in np.unique(material[here]):
            of_kind = kept & (material == kind)
            others = (of_probe == kind) & (np.arange(TILES) != number)
            share = risk[here & of_kind].sum()
            if others.sum() >= FEWEST:
                expected += excess[others].sum() * share / risk[of_kind & ~here].sum()
            else:
                expected += otherwise[number] * share / risk[here].sum()
                rare += 1
        assert told[number] == pytest.approx(expected), number
    assert rare > 10, "or the materials are all well known"


@pytest.mark.parametrize("alike", [True, False])
def test_a_material_is_believed_as_far_as_it_foretells_its_probes(alike):
    """The same error in all of its tiles; or in half of them, which lie together and know it of each other."""
    rng = np.random.default_rng(4)
    tile, risk = np.arange(TILES), np.ones(TILES)
    materials = ShownMaterials.of_pixels(tile, np.zeros(TILES, np.intp), risk, np.zeros(TILES, np.intp))
    true = np.ones(TILES) if alike else np.repeat([0.0, 2.0], TILES // 2)
    excess = true + rng.normal(0.0, 1.0, TILES)
    # A few probes around each: of the same kind, and noisy.
    nearby = true + rng.normal(0.0, 0.5, TILES)
    likely = materials.likely(excess, nearby)
    off, off_nearby = np.abs(likely - true).mean(), np.abs(nearby - true).mean()
    if alike:
        assert off < 0.4 * off_nearby
    else:
        assert off < 1.1 * off_nearby
        assert off < 0.5 * np.abs(materials.excess(excess, nearby) - true).mean()


def test_nothing_shown_nothing_told():
    none = np.zeros(0, np.intp)
    materials = ShownMaterials.of_pixels(none, none, np.zeros(0), np.zeros(3, np.intp))
    np.testing.assert_array_equal(materials.likely(np.ones(3), np.array([1.0, 2.0, -1.0])), [1.0, 2.0, -1.0])
    empty = ShownMaterials.of_pixels(none, none, np.zeros(0), none)
    assert empty.likely(np.zeros(0), np.zeros(0)).size == 0
