"""Pictures and cameras that the GPU and numpy are to warp alike, and what alike is. Not a test itself."""

from __future__ import annotations

import bpy
import numpy as np
from scipy.ndimage import maximum_filter

from stereo_reproject.blender.gpu import warp as gpu_warp
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.warp import warper
from tests.warp.analytic import camera, pose, stereo_rig
from tests.warp.pairs import reproject_pair, warp_pair

HAS_GPU = bpy.app.version >= (5, 2)

APART = 5e-4
"""Share of the pixels on which rounding may decide otherwise: whether anything lands there, and what."""

SAME_COLOUR = 1e-3
"""Between colours from 0 to 1: positions agree to some 1e-4 px, and noise changes by 1 from a pixel to the next."""

SAME_PLACE = 3e-4
"""Pixels: float32 positions up to some hundreds, a few roundings."""

SAME_DEPTH = 1e-4
"""Of nearness, relative to the nearest there is."""

SAME_MASK, SAME_COLOURS = 5e-4, 1e-3
"""What is promised: the share of pixels that are traced by one alone, and the largest difference of a colour; of one
above 1 in parts of it."""

RECTIFIED = ["off-axis", "parallel", "orthographic parallel"]

TURNED = ["toe-in", "orthographic toe-in", "general", "orthographic general"]

SCENES = ["smooth", "steps", "noise", "sky", "unknown", "frontal"]

SIZE = (333, 97)


def pair(kind, size=SIZE):
    """Two cameras; of the general kind, the second is turned every way, and has more pixels."""
    orthographic = kind.startswith("orthographic")
    mode = kind.removeprefix("orthographic ")
    if mode == "general":
        larger = (size[0] + 5, size[1] + 3)
        turned = pose((0.07, -0.05, 0.06), yaw=0.03, pitch=-0.02, roll=0.08)
        return camera(size, orthographic=orthographic), camera(larger, turned, orthographic=orthographic)
    rig = stereo_rig(size, mode=mode, ipd=0.12, convergence=3.5, orthographic=orthographic)
    return rig["left"], rig["right"]


def passes_of(kind, size, seed=0):
    """Noisy colours, three channels of them, an index, and a depth of the kind."""
    width, height = size
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    depth = 5.0 + 0.6 * np.sin(9.0 * x + rng.uniform(0.0, 6.0)) + 0.5 * np.cos(7.0 * y) + rng.uniform(-1.0, 1.0) * x
    if kind in ("steps", "sky", "unknown"):
        for _ in range(9):
            left, top, wide = rng.uniform(0, 0.9), rng.uniform(-0.2, 0.8), rng.uniform(0.02, 0.3)
            inside = (x > left) & (x < left + wide) & (y > top) & (y < top + rng.uniform(0.1, 1.0))
            depth = np.where(inside, np.minimum(depth, rng.uniform(1.0, 4.0) + 0.5 * (x - left)), depth)
    if kind == "noise":
        depth = rng.uniform(0.8, 9.0, depth.shape)
    if kind == "sky":
        depth = np.where(y < 0.3 + 0.1 * np.sin(12.0 * x), np.inf, depth)
    if kind == "unknown":
        depth = np.where(rng.random(depth.shape) < 0.02, np.nan, depth)
        depth = np.where(rng.random(depth.shape) < 0.01, np.inf, depth)
    if kind == "frontal":
        depth = np.where((x > 0.3) & (x < 0.5), 1.7, 6.0)
    colour = rng.random((height, width, 4), np.float32)
    return {
        "Combined": colour,
        "Depth": depth.astype(np.float32)[..., None],
        "Diffuse Color": np.ascontiguousarray(colour[..., 1:]),
        "Object Index": np.floor(8.0 * colour[..., :1]),
    }


def both(source, one, other, **options):
    """By the GPU and by numpy."""
    return tuple(warp_pair(source, one, other, how=how, **options) for how in (gpu_warp.warp_view, warper.warp_view))


def share_apart(ours, numpys):
    """What differs, by name, as a share of the pixels."""
    there = ours.warp.covered & numpys.warp.covered
    result = {"empty": np.mean(ours.empty != numpys.empty)}
    for axis in ("x", "y"):
        place, other = getattr(ours.warp, axis), getattr(numpys.warp, axis)
        assert np.array_equal(np.isnan(place), ~ours.warp.covered)
        result[axis] = np.mean(there & ~(np.abs(place - other) <= SAME_PLACE))
    # The cubic kernel is held within the range of the pixels it looks at: fewer of them on a centre, exactly.
    centred = [abs(axis - np.floor(axis) - 0.5) < SAME_PLACE for axis in (numpys.warp.x, numpys.warp.y)]
    unsure = centred[0] & (ours.warp.x != numpys.warp.x) | centred[1] & (ours.warp.y != numpys.warp.y)
    for name in ("Combined", "Diffuse Color"):
        distance = np.abs(ours.passes[name] - numpys.passes[name]).max(axis=-1)
        result[name] = np.mean(there & (distance > SAME_COLOUR) & ~unsure)
        assert not ours.passes[name][~ours.warp.covered].any()
    # The nearest pixel is another where the place is on its border.
    border = [np.abs(axis - np.round(axis)) < SAME_PLACE for axis in (numpys.warp.x, numpys.warp.y)]
    other = ours.passes["Object Index"][..., 0] != numpys.passes["Object Index"][..., 0]
    result["Object Index"] = np.mean(there & other & ~border[0] & ~border[1])
    depth, expected = ours.passes["Depth"][..., 0], numpys.passes["Depth"][..., 0]
    assert np.isposinf(depth[~ours.warp.covered]).all()
    nearness, other = 1.0 / depth, 1.0 / expected
    unlike = ~(np.abs(nearness - other) <= SAME_DEPTH * np.nanmax(other)) & ~(np.isnan(depth) & np.isnan(expected))
    result["Depth"] = np.mean(there & unlike)
    result["sky"] = np.mean(there & (np.isposinf(depth) != np.isposinf(expected)))
    return result


def assert_same(ours, numpys, allowed=APART):
    assert np.array_equal(ours.grid.subdivided, numpys.grid.subdivided)
    assert [(name, image.shape, image.dtype) for name, image in ours.passes.items()] == [
        (name, image.shape, image.dtype) for name, image in numpys.passes.items()
    ]
    assert ours.empty.dtype == np.uint16
    apart = share_apart(ours, numpys)
    assert max(apart.values()) <= allowed, apart


def both_wholly(source, cameras, accuracy="balanced"):
    """The whole stage by the GPU and by numpy."""
    options = {"accuracy": SETTINGS[accuracy], "invalid": np.zeros(source["Combined"].shape[:2], bool)}
    ours, numpys = (
        reproject_pair(source, *cameras, how=how, **options) for how in (gpu_warp.warp_view, warper.warp_view)
    )
    assert ours.warped_by == ("gpu" if HAS_GPU else "numpy")
    return ours, numpys


def assert_keeps_its_promise(ours, numpys):
    """Of the mask, and of the colours of all that is not in it: no pixel is left out. Returns the share of those."""
    assert np.mean((ours.reasons != 0) != (numpys.reasons != 0)) <= SAME_MASK
    told = (ours.reasons == 0) & (numpys.reasons == 0)
    colours, others = (result.passes["Combined"] for result in (ours, numpys))
    assert np.isfinite(colours).all()
    apart = np.abs(colours - others).max(axis=-1)
    assert not (
        told & ~(apart <= SAME_COLOURS * around(ours.views[0].classifier.source.passes["Combined"], numpys.warp))
    ).any()
    return float(told.mean())


def around(colours, warp):
    """(h, w): the largest number among the pixels that a lookup takes from, or 1 if that is larger."""
    largest = maximum_filter(np.abs(colours).max(axis=-1), size=5, mode="nearest")
    places = ((warp.y, colours.shape[0]), (warp.x, colours.shape[1]))
    i, j = (np.clip(np.nan_to_num(place), 0, size - 1).astype(int) for place, size in places)
    return np.maximum(largest[i, j], 1.0)


def assert_identical(ours, numpys):
    assert np.array_equal(ours.empty, numpys.empty)
    for name, image in numpys.passes.items():
        np.testing.assert_array_equal(ours.passes[name], image)
