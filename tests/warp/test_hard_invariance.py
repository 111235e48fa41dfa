"""What should not matter does not: which way round, there and back, how much is drawn at a time, what else runs."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.holes import silhouettes
from stereo_reproject.images import bands
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.camera import ViewPlane
from stereo_reproject.warp import quads
from tests.warp.analytic import Plane, Sphere, World, pixel_centres
from tests.warp.bounds import ROUNDINGS, spread
from tests.warp.exact import Rig, passes_of, reprojected
from tests.warp.judging import judged
from tests.warp.pairs import reproject_pair

MODES = ["off-axis", "parallel", "toe-in"]

ROUNDING = ROUNDINGS * np.finfo(np.float32).eps
"""Of a float32 position, in parts of the largest number that it is made of."""


WORLDS = {
    "all": World(
        (
            Plane((0.0, -1.5, 0.0), (0.0, 1.0, 0.0)),
            Plane((0.0, 0.0, -8.0)),
            Sphere((0.3, 0.1, -3.0), 0.6),
            Plane((-0.4, 0.1, -2.0), half=0.25),
        )
    ),
    "slanted": World((Plane((0.0, 0.0, -4.0), (0.5, 0.2, 1.0)),)),
}


def flipped(eye):
    """The same camera in a mirror that swaps left and right."""
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    plane = eye.plane
    return replace(
        eye,
        world_from_camera=mirror @ eye.world_from_camera @ mirror,
        plane=ViewPlane(-plane.right, -plane.left, plane.bottom, plane.top),
    )


MIRRORED = {0.0: 0.008, 1.0: 0.06}
"""Source pixels by threshold: twice what the triangles of quads, and of coarse cells, cut the other way differ by."""


@pytest.mark.parametrize("mode", ["off-axis", "parallel"])
@pytest.mark.parametrize("scale", [None, 5.0])
@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("threshold", [0.0, 1.0])
def test_the_mirrored_pair_is_the_pair_mirrored(world, mode, scale, threshold):
    size = (191, 120)  # whole cells, and their ring: they are the same ones from either side
    source, target = Rig(size=size, mode=mode, scale=scale, ipd=0.2, convergence=3.3).eyes
    depth, index = WORLDS[world].hit(source, *pixel_centres(source))
    passes = passes_of(depth, IndexOB=np.float32(index)[..., None])
    turned = {name: image[:, ::-1].copy() for name, image in passes.items()}
    turned["Combined"][..., 0] = passes["Combined"][..., 0][:, ::-1]
    one = reprojected(passes, source, target, grid_threshold=threshold)
    other = reprojected(turned, flipped(source), flipped(target), grid_threshold=threshold)
    allowed = 2.0 * ROUNDING * size[0]
    np.testing.assert_array_equal(other.reasons[:, ::-1], one.reasons)
    told = one.reasons == 0
    np.testing.assert_allclose(size[0] - other.warp.x[:, ::-1][told], one.warp.x[told], rtol=0, atol=allowed)
    # A position to rounding is a value to as much of what the next pixel differs by.
    for name, change in (("Combined", 1.0), ("IndexOB", 0.0)):
        np.testing.assert_allclose(
            other.passes[name][:, ::-1][told], one.passes[name][told], rtol=0, atol=change * allowed
        )


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("threshold", MIRRORED)
def test_the_mirrored_pair_of_eyes_that_are_toed_in(world, threshold):
    """Its quads are cut along one diagonal: what is mirrored is off by what the two triangles are."""
    size = (191, 120)
    source, target = Rig(size=size, mode="toe-in", ipd=0.2, convergence=3.3).eyes
    mirrored = replace(WORLDS[world], surfaces=tuple(_in_the_mirror(s) for s in WORLDS[world].surfaces))
    both = [(WORLDS[world], source, target), (mirrored, flipped(source), flipped(target))]
    one, other = (judged(*case, threshold=threshold) for case in both)
    assert not one.wrong.any(), one.worst
    assert not other.wrong.any(), other.worst
    assert np.mean(one.flagged != other.flagged[:, ::-1]) < 0.002, "ties"
    warps = []
    for place, *eyes in both:
        depth, _ = place.hit(eyes[0], *pixel_centres(eyes[0]))
        warps.append(reprojected(passes_of(depth), *eyes, grid_threshold=threshold).warp)
    told = one.told & other.told[:, ::-1]
    assert told.mean() > 0.7
    across = (warps[0].x - (size[0] - warps[1].x[:, ::-1]))[told]
    down = (warps[0].y - warps[1].y[:, ::-1])[told]
    apart, allowed = np.hypot(across, down), (one.beside_limit + other.beside_limit[:, ::-1])[told]
    assert np.all(apart <= allowed)
    assert apart.max() <= MIRRORED[threshold]


def _in_the_mirror(surface):
    if isinstance(surface, Sphere):
        return replace(surface, centre=(-surface.centre[0], *surface.centre[1:]))
    turned = {name: (-getattr(surface, name)[0], *getattr(surface, name)[1:]) for name in ("point", "normal")}
    return replace(surface, **turned)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("world", WORLDS)
def test_there_and_back_again(world, mode):
    """The target's warp, warped back: what neither way flags is where it was, to what both ways may be off."""
    source, target = Rig(size=(190, 120), mode=mode, ipd=0.1, convergence=3.3).eyes
    there, back_again = (judged(WORLDS[world], *pair) for pair in ((source, target), (target, source)))
    depth, _ = WORLDS[world].hit(source, *pixel_centres(source))
    first = reprojected(passes_of(depth), source, target)
    # A tracer fills what is flagged: here the world itself.
    seen, _ = WORLDS[world].hit(target, *pixel_centres(target))
    filled = np.where(first.reasons == 0, first.passes["Depth"][..., 0], np.float32(seen))
    x, y = (np.where(first.reasons == 0, p, np.nan) for p in (first.warp.x, first.warp.y))
    back = reprojected(passes_of(filled), target, source)
    # Which source position does the target have where the way back looks? Beyond its pixels' centres it has none.
    told, at = back.reasons == 0, []
    for place, size in ((back.warp.y, 120), (back.warp.x, 190)):
        place = np.nan_to_num(place) - 0.5
        told &= (place >= 0.0) & (place < size - 1.0)
        at.append(np.clip(place, 0.0, size - 1.001))
    again = [_bilinear(p, *at) for p in (x, y)]
    centre_x, centre_y = pixel_centres(source)
    far = np.hypot(again[0] - centre_x, again[1] - centre_y)[told]
    known = np.isfinite(far)
    assert known.mean() > 0.5
    # What the way there may be off, around; and of the way back, as it is in the source.
    around = [
        spread(values, 1)[tuple(np.round(p).astype(int) for p in at)] for values in (there.beside_limit, _rate(x, y))
    ]
    allowed = around[0] + around[1] * back_again.beside_limit
    assert np.all(far[known] <= 2.0 * allowed[told][known])
    assert far[known].mean() < 0.02


def _rate(x, y):
    """(H, W): how far in the source it is at most from a pixel of the target to its neighbours."""
    result = np.zeros(x.shape)
    for axis in (0, 1):
        apart = np.nan_to_num(np.hypot(np.diff(x, axis=axis), np.diff(y, axis=axis)))
        result = np.maximum(result, np.concatenate([apart, apart.take([-1], axis=axis)], axis=axis))
    return result


def _bilinear(image, i, j):
    top, left = i.astype(int), j.astype(int)
    down, right = i - top, j - left
    return (
        (1 - down) * ((1 - right) * image[top, left] + right * image[top, left + 1])
        + down * ((1 - right) * image[top + 1, left] + right * image[top + 1, left + 1])
    )  # fmt: skip


def same(one, other):
    np.testing.assert_array_equal(one.reasons, other.reasons)
    for name in ("x", "y", "nearness"):
        np.testing.assert_array_equal(getattr(one.warp, name), getattr(other.warp, name))
    assert one.passes.keys() == other.passes.keys()
    for name, image in one.passes.items():
        np.testing.assert_array_equal(image, other.passes[name], err_msg=name)


def noisy_passes(source):
    depth, index = WORLDS["all"].hit(source, *pixel_centres(source))
    colour = np.random.default_rng(10).uniform(0, 2, (*depth.shape, 4))
    return passes_of(depth, colour, IndexOB=np.float32(index)[..., None])


TILES = [(bands, "BAND_PIXELS"), (quads, "CHUNK_CELLS"), (silhouettes, "CHUNK_WINDOWS")]


@pytest.mark.parametrize(("module", "name"), TILES, ids=lambda value: getattr(value, "__name__", value))
@pytest.mark.parametrize("tile", [1, 7, 1000, 1 << 20])
@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
def test_the_size_of_a_tile_does_not_matter(module, name, tile, mode, monkeypatch):
    source, target = Rig(size=(130, 75), mode=mode).eyes
    passes = noisy_passes(source)
    for interpolation in ("linear", "cubic"):
        options = {"accuracy": SETTINGS["high"], "interpolation": interpolation}
        before = reprojected(passes, source, target, **options)
        assert getattr(module, name) != tile
        with monkeypatch.context() as patch:
            patch.setattr(module, name, tile)
            same(reprojected(passes, source, target, **options), before)


@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
def test_neither_does_what_else_runs(mode):
    """Frames warped side by side in threads, each as if it were alone, and what they are made of left as it was."""
    eyes = [Rig(size=(130, 75), mode=mode, ipd=ipd).eyes for ipd in (0.02, 0.065, 0.1, 0.2)]
    passes = noisy_passes(eyes[0][0])
    kept = {name: image.copy() for name, image in passes.items()}

    def warped(pair):
        invalid = np.zeros(passes["Combined"].shape[:2], bool)
        return reproject_pair(passes, *pair, accuracy=SETTINGS["high"], invalid=invalid)

    alone = [warped(pair) for pair in eyes]
    with ThreadPoolExecutor(4) as pool:
        for one, other in zip(pool.map(warped, eyes * 3), alone * 3, strict=True):
            same(one, other)
    for name, image in passes.items():
        np.testing.assert_array_equal(image, kept[name])
