"""Depths, colours, eyes and lenses at their worst: the GPU's mask and colours are numpy's, either way between the eyes.

What numpy's are worth is for `tests/warp/test_hard_cases.py` and `tests/warp/test_hard_rigs.py`
to say, whose cases these are.
"""

from __future__ import annotations

import bpy  # noqa: F401 - there is no gpu before it
import numpy as np
import pytest

from stereo_reproject.blender.gpu import warp as gpu_warp
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.warp import warper
from stereo_reproject.warp.composite import replace_non_finite
from tests.blender.gpu.gpu_cases import HAS_GPU, assert_keeps_its_promise
from tests.warp.analytic import Plane, Sphere, World, pixel_centres
from tests.warp.exact import Rig, nothing_said, passes_of
from tests.warp.pairs import reproject_pair
from tests.warp.test_hard_cases import BROKEN, DEPTHS, SIZES
from tests.warp.test_hard_rigs import MODES, SIZE, room, scaled, seen_by

SHAPE = SIZE[::-1]


def alike(rig, depth, colour=None, accuracy="balanced", **options):
    """depth (H, W), or the world that has it; colours are noise."""
    for source, target in (rig.eyes, rig.eyes[::-1]):
        seen = depth.hit(source, *pixel_centres(source))[0] if isinstance(depth, World) else depth
        if colour is None:
            colour = np.random.default_rng(0).random((*seen.shape, 4))
        with nothing_said():
            passes, invalid = replace_non_finite(passes_of(seen, colour))
            ours, numpys = (
                reproject_pair(
                    passes, source, target, accuracy=SETTINGS[accuracy], invalid=invalid, how=warp_view, **options
                )
                for warp_view in (gpu_warp.warp_view, warper.warp_view)
            )
            assert ours.warped_by == ("gpu" if HAS_GPU else "numpy")
            assert_keeps_its_promise(ours, numpys)


def picked(values, seed, shape=SHAPE, side=1):
    """(H, W) of them at random, in blocks so wide."""
    count = [-(-length // side) for length in shape]
    depth = np.random.default_rng(seed).choice(np.float32(values), count).repeat(side, axis=0).repeat(side, axis=1)
    return depth[: shape[0], : shape[1]]


# Depths


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [None, 5.0])
@pytest.mark.parametrize("accuracy", ["balanced", "exact"])
@pytest.mark.parametrize("side", [1, 12])
def test_all_depths_in_one_picture(mode, scale, accuracy, side):
    alike(Rig(size=SIZE, mode=mode, scale=scale), picked(DEPTHS, 3, side=side), accuracy=accuracy)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [None, 5.0])
def test_broken_depths_and_those_at_the_ends_of_float32(mode, scale):
    broken = np.where(np.random.default_rng(4).random(SHAPE) < 0.1, picked(BROKEN, 4), np.float32(3.0))
    alike(Rig(size=SIZE, mode=mode, scale=scale), broken)
    ends = picked([1.2e-38, 1e-37, 1e-30, 1.0, 1e30, 3e38, np.inf], 5)
    for ipd in (0.065, 1e3):
        alike(Rig(size=SIZE, mode=mode, scale=scale, ipd=ipd, lens=5000.0), ends)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("depth", [1e-6, 3.0, 1e9])
def test_depths_one_ulp_apart(mode, depth):
    steps = np.random.default_rng(6).integers(0, 2, SHAPE).astype(np.float32)
    rig = Rig(size=SIZE, mode=mode, convergence=1.2 * depth, ipd=0.05 * depth)
    alike(rig, np.float32(depth) + steps * np.spacing(np.float32(depth)))


@pytest.mark.parametrize("mode", MODES)
def test_nothing_is_known_and_a_floor_to_the_horizon(mode):
    alike(Rig(size=SIZE, mode=mode), np.full(SHAPE, np.nan))
    alike(Rig(size=SIZE, mode=mode), World((Plane((0.0, -1.5, 0.0), (0.0, 1.0, 0.0)),)))


# Colours


@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
@pytest.mark.parametrize("value", [1e30, -1e30, 0.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_colours(mode, value, interpolation):
    colour = np.random.default_rng(7).random((*SHAPE, 4))
    colour[np.random.default_rng(8).random(SHAPE) < 0.05] = value
    depth = np.where(np.arange(SIZE[0]) < 60, 1.5, 4.0) + np.zeros(SHAPE)
    alike(Rig(size=SIZE, mode=mode), depth, colour, interpolation=interpolation)


# Sizes


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
@pytest.mark.parametrize("scale", [None, 5.0])
def test_sizes(size, mode, scale):
    """Of so few pixels none may differ."""
    alike(Rig(size=size, mode=mode, scale=scale), np.random.default_rng(8).uniform(1.0, 5.0, size[::-1]))


# Eyes


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [None, 4.0])
@pytest.mark.parametrize("ipd", [0.0, 1e-9, 1e-3, 1.0, 20.0, 1e6, -0.065])
def test_interocular_distances(mode, scale, ipd):
    alike(Rig(size=SIZE, mode=mode, scale=scale, ipd=ipd, convergence=max(3.0, ipd)), room())


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("convergence", [1e-6, 0.1, 1e9, np.inf, -2.0, -0.1])
def test_convergences(mode, convergence):
    alike(Rig(size=SIZE, mode=mode, convergence=convergence), room())


@pytest.mark.parametrize("degrees", [1.0, 10.0, 30.0, 44.0, 45.0, 46.0, 53.0, 80.0])
@pytest.mark.parametrize("lens", [8.0, 20.0])
def test_toe_in(degrees, lens):
    rig = Rig(size=SIZE, mode="toe-in", lens=lens, ipd=6.0 * np.tan(np.radians(degrees)), convergence=3.0)
    alike(rig, World((Plane((0.0, 0.0, -8.0)), Sphere((0.1, 0.1, -3.0), 0.6))))


# Lenses, and scale


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("lens", [1.0, 50.0, 5000.0])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (1.5, -0.7)])
def test_lenses(mode, lens, shift):
    alike(*seen_by(lens, mode, shift))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [None, 4.0])
@pytest.mark.parametrize("aspect", [0.1, 10.0])
def test_pixels_that_are_not_square(mode, scale, aspect):
    alike(Rig(size=SIZE, mode=mode, scale=scale, aspect=aspect), room())


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", 10.0 ** np.arange(-6, 7))
@pytest.mark.parametrize("size", [SIZE, (640, 360)])
def test_orthographic_scales(mode, scale, size):
    """What is a few units deep, and what is as deep as it is wide."""
    rig = Rig(size=size, mode=mode, scale=scale, ipd=0.02 * scale, convergence=max(3.0, scale))
    for depth in (4.0, scale):
        wall = Plane((0.0, 0.0, -2.0 * depth), (0.1, 0.05, 1.0))
        alike(rig, World((wall, Plane((0.1 * scale, 0.0, -depth), half=0.2 * scale))))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("factor", [0.01, 1.25e6])
def test_scenes_of_8_cm_and_of_10_000_km(mode, factor):
    alike(scaled(Rig(size=SIZE, mode=mode, convergence=2.9), factor), room(factor))
