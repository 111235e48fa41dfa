"""Materials judged as a whole: by all probes that are on them, and only as far as that foretells these."""

import numpy as np
import pytest

from stereo_reproject.estimate.shown_materials import ShownMaterials, materials_by_tile

TILES = 200


def pixels_of_tiles(rng, *, pixels=16, kinds=12):
    """Tile, material and contrast of the pixels of tiles, and what their probes are on: some materials are rare."""
    tile = np.repeat(np.arange(TILES), pixels)
    main = rng.integers(0, kinds, TILES) ** 2 // kinds
    material = np.where(rng.random(tile.size) < 0.8, np.repeat(main, pixels), rng.integers(0, kinds, tile.size))
    contrast = np.where(tile == 7, 0.0, rng.random(tile.size) * 10.0 ** rng.uniform(-4.0, 0.0, TILES)[tile])
    return tile, material, contrast, main


def by_the_book(tile, material, contrast, of_probe, found, nearby):
    """What `ShownMaterials.expected` says, tile for tile from its definition."""
    count = material.max() + 1
    contrasts = np.array([[contrast[(tile == t) & (material == m)].sum() for m in range(count)] for t in range(TILES)])
    totals = contrasts.sum(axis=1)
    told, parts = np.zeros((TILES, count)), np.zeros((TILES, count))
    for t, m in zip(*np.nonzero(contrasts), strict=True):
        others = (of_probe == m) & (np.arange(TILES) != t)
        elsewhere = np.delete(contrasts[:, m], t).sum()
        parts[t, m] = told[t, m] = nearby[t] * contrasts[t, m] / totals[t]
        if others.any() and elsewhere >= contrasts[t, m]:
            told[t, m] = found[others].sum() * contrasts[t, m] / elsewhere
    apart = told - parts
    likely = nearby.copy()
    for t, m in zip(*np.nonzero(contrasts), strict=True):
        others = (of_probe == m) & (np.arange(TILES) != t)
        scale = 1.0 / np.maximum(totals, totals[of_probe == m].mean() if (of_probe == m).any() else 0.0)[others]
        x, y = scale * apart.sum(axis=1)[others], scale * (found - nearby)[others]
        slope = (x @ y) / (x @ x) if (x**2).sum() > 0.0 else 0.0
        likely[t] += np.clip(slope, 0.0, 1.0) * apart[t, m]
    return likely


def test_as_defined():
    rng = np.random.default_rng(9)
    tile, material, contrast, of_probe = pixels_of_tiles(rng)
    rows = [(tile[tile // 50 == row], material[tile // 50 == row], contrast[tile // 50 == row]) for row in range(4)]
    found, nearby = rng.normal(size=(2, TILES))
    materials = ShownMaterials(*materials_by_tile(rows), of_probe=of_probe, found=found)
    likely, error = materials.expected(nearby)
    np.testing.assert_allclose(likely, by_the_book(tile, material, contrast, of_probe, found, nearby), atol=1e-12)
    assert likely[7] == nearby[7], "nothing is at contrast there"
    assert (error >= 0.0).all()
    assert error.any()


def test_a_tile_s_own_probe_has_no_say():
    rng = np.random.default_rng(3)
    tile, material, contrast, of_probe = pixels_of_tiles(rng)
    found, nearby = rng.normal(size=(2, TILES))
    pairs = materials_by_tile([(tile, material, contrast)])
    before = ShownMaterials(*pairs, of_probe=of_probe, found=found).expected(nearby)[0]
    # Through what others are told it has a little; more than that would have the estimate flatter.
    own, others = [], []
    for t in range(0, TILES, 5):
        louder = found.copy()
        louder[t] += 1.0
        change = ShownMaterials(*pairs, of_probe=of_probe, found=louder).expected(nearby)[0] - before
        own.append(change[t])
        others.append(change[of_probe == of_probe[t]].sum() - change[t])
    assert np.abs(own).mean() < 0.02
    assert np.mean(others) > 0.1


@pytest.mark.parametrize("alike", [True, False])
def test_a_material_is_believed_as_far_as_it_foretells_its_probes(alike):
    """The same error in all of its tiles; or in half of them, which lie together and know it of each other."""
    rng = np.random.default_rng(4)
    true = np.ones(TILES) if alike else np.repeat([0.0, 2.0], TILES // 2)
    # A few probes around each: of the same kind, and noisy.
    nearby = true + rng.normal(0.0, 0.5, TILES)
    one = np.zeros(TILES, np.intp)
    found = true + rng.normal(0.0, 1.0, TILES)
    likely = ShownMaterials(np.arange(TILES), one, np.ones(TILES), one, found).expected(nearby)[0]
    off, off_nearby = np.abs(likely - true).mean(), np.abs(nearby - true).mean()
    if alike:
        assert off < 0.4 * off_nearby
    else:
        assert off < 1.1 * off_nearby


def test_flat_tiles_do_not_decide_for_the_others():
    """A few in which hardly anything is, beside wrong ones: what is nearby tells too much of them, but of no other."""
    rng = np.random.default_rng(6)
    true = np.repeat([0.0, 2.0], TILES // 2)
    contrast = np.ones(TILES)
    contrast[:5] = 1e-6
    nearby = true + rng.normal(0.0, 0.3, TILES)
    nearby[:5] = 1.0
    found = true + rng.normal(0.0, 1.0, TILES)
    one = np.zeros(TILES, np.intp)
    likely = ShownMaterials(np.arange(TILES), one, contrast, one, found).expected(nearby)[0]
    assert np.abs(likely - true)[5:].mean() < 1.1 * np.abs(nearby - true)[5:].mean()


def test_nothing_shown_nothing_told():
    pairs = materials_by_tile([])
    nearby = np.array([1.0, 2.0, -1.0])
    likely, error = ShownMaterials(*pairs, of_probe=np.zeros(3, np.intp), found=np.ones(3)).expected(nearby)
    np.testing.assert_array_equal(likely, nearby)
    np.testing.assert_array_equal(error, np.zeros(3))
    none = ShownMaterials(*pairs, of_probe=np.zeros(0, np.intp), found=np.zeros(0)).expected(np.zeros(0))
    assert none[0].size == none[1].size == 0
