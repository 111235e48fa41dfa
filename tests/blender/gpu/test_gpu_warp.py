"""The warp on the GPU: what numpy's is, wherever there is a GPU; where there is none, numpy's itself.

Without a window Blender has a GPU from 5.2 on (a processor that plays one will do); before, these tests hold what falls
back on numpy to being exactly that.
"""

from __future__ import annotations

import bpy  # noqa: F401 - there is no gpu before it
import gpu
import numpy as np
import pytest

from stereo_reproject.blender.gpu import warp as gpu_warp
from stereo_reproject.images.passes import SOURCE_ONLY_PASSES
from stereo_reproject.views.camera import target_px_from_source_px
from stereo_reproject.views.motion import moving
from tests.bench.warp.scenes import SCENES as SCENES_OF_THE_BENCH
from tests.bench.warp.scenes import eyes, room
from tests.bench.warp.settings import MODES
from tests.blender.gpu.gpu_cases import (
    HAS_GPU,
    RECTIFIED,
    SCENES,
    SIZE,
    TURNED,
    assert_identical,
    assert_keeps_its_promise,
    assert_same,
    both,
    both_wholly,
    pair,
    passes_of,
)
from tests.warp.analytic import pixel_centres, world_rays
from tests.warp.pairs import warp_pair
from tests.warp.test_hard_cases import blocks, chequers, comb, every_step, rows, slats


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scene", list(SCENES_OF_THE_BENCH))
def test_the_whole_stage_has_the_same_mask_and_colours(mode, scene):
    size = (480, 270)
    assert_keeps_its_promise(*both_wholly(SCENES_OF_THE_BENCH[scene](*size), eyes(*size, mode)))


@pytest.mark.parametrize("kind", RECTIFIED + TURNED)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("swapped", [False, True])
def test_it_is_what_numpy_does(kind, scene, swapped, dispatched):
    one, other = pair(kind)[:: -1 if swapped else 1]
    source = passes_of(scene, (one.width, one.height))
    ours, numpys = both(source, one, other, colour_interpolation="cubic")
    assert_same(ours, numpys)
    assert bool(dispatched) == HAS_GPU
    assert scene == "noise" or 0.5 < ours.warp.covered.mean() < 1.0


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("interpolation", ["linear", "cubic", "nearest"])
def test_the_room_of_the_bench(swapped, interpolation):
    size = (480, 270)
    source = room(*size) | {name: passes_of("smooth", size)[name] for name in ("Diffuse Color", "Object Index")}
    assert_same(*both(source, *eyes(*size)[:: -1 if swapped else 1], interpolation=interpolation))


@pytest.mark.parametrize("kind", ["off-axis", "orthographic parallel", "toe-in", "orthographic toe-in"])
@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (2, 3), (15, 16), (17, 33)])
@pytest.mark.parametrize("scene", ["steps", "unknown"])
def test_odd_sizes(kind, size, scene):
    one, other = pair(kind, size)
    # One pixel is a large share of those.
    allowed = 2.0 / (size[0] * size[1]) if scene == "unknown" else 0.0
    assert_same(*both(passes_of(scene, size), one, other), allowed=allowed)


@pytest.mark.parametrize("kind", ["off-axis", *TURNED])
@pytest.mark.parametrize("threshold", [0.0, 1.0, 1000.0])
@pytest.mark.parametrize("scene", ["smooth", "steps"])
def test_coarse_cells_are_what_numpy_s_are(kind, threshold, scene):
    cameras = pair(kind)
    assert_same(*both(passes_of(scene, SIZE), *cameras, grid_threshold=threshold))


PATTERNS = [comb, slats, chequers, blocks, every_step, rows]


@pytest.mark.parametrize("kind", RECTIFIED + TURNED)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("seed", range(3))
def test_the_promise_is_kept_on_scenes_that_are_made_up(kind, scene, seed):
    cameras = pair(kind)
    source = passes_of(scene, (cameras[0].width, cameras[0].height), seed)
    assert_keeps_its_promise(*both_wholly(source, cameras))


@pytest.mark.parametrize("kind", RECTIFIED + TURNED)
@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("swapped", [False, True])
def test_the_promise_is_kept_on_the_hardest_patterns(kind, pattern, swapped):
    size = (93, 62)
    cameras = pair(kind, size)[:: -1 if swapped else 1]
    shape = (cameras[0].width, cameras[0].height)
    source = passes_of("smooth", shape)
    depth = pattern(*np.meshgrid(np.arange(shape[0]), np.arange(shape[1])))
    source["Depth"] = np.broadcast_to(depth, shape[::-1]).astype(np.float32)[..., None]
    assert_keeps_its_promise(*both_wholly(source, cameras, "exact"))


@pytest.mark.parametrize("kind", ["off-axis", "toe-in"])
def test_positions_and_vectors_are_the_target_s_own(kind):
    one, other = pair(kind)
    source = passes_of("steps", SIZE)
    origin, direction = world_rays(one, *(axis.ravel() for axis in pixel_centres(one)))
    position = origin + source["Depth"].reshape(-1, 1) * direction
    source["Position"] = position.reshape(*SIZE[::-1], 3).astype(np.float32)
    source["Vector"] = np.random.default_rng(3).uniform(-4.0, 4.0, (*SIZE[::-1], 4)).astype(np.float32)
    source |= dict.fromkeys(SOURCE_ONLY_PASSES, source["Combined"])
    motion = tuple(moving(eye, eye, eye) for eye in (one, other))
    ours, numpys = both(source, one, other, motion=motion)
    assert_same(ours, numpys)
    there = ours.warp.covered & numpys.warp.covered
    for name, tolerance in (("Position", 1e-3), ("Vector", 1e-2)):
        unlike = np.abs(ours.passes[name] - numpys.passes[name]).max(axis=-1) > tolerance
        assert np.mean(unlike & there) <= 0.01, name


def test_what_it_says_of_a_pixel_lands_on_it():
    """Held against the cameras themselves, not against numpy's warp."""
    one, other = pair("toe-in")
    ours = warp_pair(passes_of("smooth", SIZE), one, other, how=gpu_warp.warp_view, grid_threshold=0.0)
    there = ours.warp.covered
    x, y, near = (values[there].astype(np.float64) for values in (ours.warp.x, ours.warp.y, ours.warp.nearness))
    centres = (axis[there] for axis in pixel_centres(other))
    back_x, back_y, _ = target_px_from_source_px(other, one, *centres, 1.0 / near)
    assert there.mean() > 0.9
    np.testing.assert_allclose(back_x, x, atol=4e-3)
    np.testing.assert_allclose(back_y, y, atol=4e-3)


def test_a_picture_is_folded_into_textures_of_the_largest_size(monkeypatch, dispatched):
    size = (96, 32)
    source = passes_of("steps", size)
    monkeypatch.setattr(gpu.capabilities, "max_texture_size_get", lambda: 98)
    assert_same(*both(source, *pair("off-axis", size)))
    assert bool(dispatched) == HAS_GPU


def test_what_is_as_near_is_settled_by_no_race():
    """Layers that cross, over and over: of two quads that are as near, the same one has the pixel each time."""
    source = passes_of("noise", SIZE)
    source["Depth"] = np.round(source["Depth"])
    for kind in ("toe-in", "orthographic toe-in"):
        first, *others = (warp_pair(source, *pair(kind), how=gpu_warp.warp_view) for _ in range(4))
        for other in others:
            assert_identical(other, first)
