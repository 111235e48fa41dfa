"""The warp on the GPU: what numpy's is, wherever there is a GPU; where there is none, numpy's itself.

Without a window Blender has a GPU from 5.2 on (a processor that plays one will do); before, these tests hold what falls
back on numpy to being exactly that.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import bpy
import gpu
import numpy as np
import pytest

from stereo_reproject import bands, carrying
from stereo_reproject.accuracy import SETTINGS
from stereo_reproject.bench import MODES
from stereo_reproject.blender import gpu_shaders, gpu_textures, gpu_warp
from stereo_reproject.blender.gpu_shaders import PROGRAMS
from stereo_reproject.camera import OrthographicCamera, target_px_from_source_px
from stereo_reproject.made_up import SCENES as SCENES_OF_THE_BENCH
from stereo_reproject.made_up import eyes, room
from stereo_reproject.motion import moving
from stereo_reproject.passes import OF_SOURCE
from stereo_reproject.reprojection import reproject
from tests.core.analytic import camera, pixel_centres, pose, stereo_rig, world_rays
from tests.core.test_hard_cases import blocks, chequers, comb, every_step, rows, slats

HAS_GPU = bpy.app.version >= (5, 2)
ROOT = Path(__file__).resolve().parents[2]

APART = 5e-4
"""Share of the pixels on which rounding may decide otherwise: whether anything lands there, and what."""

SAME_COLOUR = 1e-3
"""Between colours from 0 to 1: positions agree to some 1e-4 px, and noise changes by 1 from a pixel to the next."""

SAME_PLACE = 3e-4
"""Pixels: float32 positions up to some hundreds, a few roundings."""

SAME_DEPTH = 1e-4
"""Of nearness, relative to the nearest there is."""

GROWTH = 24 * 2**20
"""Bytes that a process may grow by over many warps: less than a tenth of what their textures hold together."""

SAME_MASK, SAME_COLOURS = 5e-4, 1e-3
"""What is promised: the share of pixels that are traced by one alone, and the largest difference of a colour."""

TIES = 1e-3
"""Share of the pixels, between cameras that are no pair of eyes: where a coarse cell that is turned every way is not
quite where the fine one beside it is, and rounding decides which has a pixel that lies in both."""

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
    return gpu_warp.carry(source, one, other, **options), carrying.carry(source, one, other, **options)


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


@pytest.fixture
def dispatched(monkeypatch):
    """The runs of shaders, as they come in."""
    runs, dispatch = [], gpu.compute.dispatch

    def counted(*arguments):
        runs.append(arguments)
        return dispatch(*arguments)

    monkeypatch.setattr(gpu.compute, "dispatch", counted)
    return runs


def test_there_is_a_gpu_from_blender_5_2_on():
    assert (gpu_warp.usable() is not None) == HAS_GPU


def in_another_process(program, **environment):
    """What Python ends with, and what the program says on stdout (from "Loaded" on) and stderr."""
    result = subprocess.run(
        [sys.executable, "-c", f"import os, sys, bpy\nos.write(1, b'Loaded.')\n{program}"],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return result.returncode, result.stdout.partition("Loaded.")[2], result.stderr


def test_whether_there_is_one_is_found_out_in_silence():
    program = """
from stereo_reproject.blender import gpu_warp
first = gpu_warp.usable()
assert gpu_warp.usable() is first
os.write(2, b"still heard")
"""
    assert in_another_process(program) == (0, "", "still heard")


def test_without_a_driver_there_is_none_and_no_crash(tmp_path):
    program = "from stereo_reproject.blender import gpu_warp; os.write(1, repr(gpu_warp.usable()).encode())"
    assert in_another_process(program, __EGL_VENDOR_LIBRARY_DIRS=str(tmp_path)) == (0, "None", "")


def test_a_process_ends_well_whatever_still_holds_the_shaders():
    program = """
import gpu
from stereo_reproject.blender import gpu_warp
dispatch, runs = gpu.compute.dispatch, []
def counted(*arguments):
    runs.append(len(arguments))
    return dispatch(*arguments)
gpu.compute.dispatch = counted
os.write(1, str(bool(gpu_warp.usable()) and bool(runs)).encode())
"""
    assert in_another_process(program) == (0, str(HAS_GPU), "")


@pytest.fixture
def untried():
    """As if no one had asked for the GPU yet."""

    def forget():
        gpu_warp._tried.cache_clear()
        gpu_warp._given_up.clear()
        gpu_textures.shader.cache_clear()

    forget()
    yield
    forget()


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        pytest.param("total += value * weight", "total += value", id="that computes something else"),
        pytest.param("total += value * weight", "total += nonsense", id="that compiles nothing"),
    ],
)
def test_a_gpu_is_of_no_use(right, wrong, untried, monkeypatch, capfd):
    program = PROGRAMS["cubic 4"]
    assert right in program.source
    monkeypatch.setitem(PROGRAMS, "cubic 4", replace(program, source=program.source.replace(right, wrong)))
    assert gpu_warp.usable() is None
    assert_identical(*both(passes_of("steps", SIZE), *pair("off-axis"), interpolation="cubic"))
    assert capfd.readouterr() == ("", "")


def test_one_that_fails_later_on_is_asked_no_more(untried, monkeypatch):
    def lost(*_, **__):
        raise RuntimeError("the device is lost")

    assert (gpu_warp.usable() is not None) == HAS_GPU
    monkeypatch.setattr(gpu_warp, "_carried", lost)
    assert_identical(*both(passes_of("steps", SIZE), *pair("off-axis")))
    assert gpu_warp.usable() is None
    assert gpu_warp._given_up == ["the device is lost"] * HAS_GPU


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scene", list(SCENES_OF_THE_BENCH))
def test_the_whole_stage_has_the_same_mask_and_colours(mode, scene):
    size = (480, 270)
    assert_keeps_its_promise(*both_wholly(SCENES_OF_THE_BENCH[scene](*size), eyes(*size, mode)))


def test_numpy_warps_in_any_thread_but_the_main_one(dispatched):
    assert (gpu_warp.usable() is not None) == HAS_GPU
    dispatched.clear()
    with ThreadPoolExecutor(1) as threads:
        assert threads.submit(gpu_warp.usable).result() is None
        results = threads.submit(both, passes_of("steps", SIZE), *pair("off-axis")).result()
    assert_identical(*results)
    assert not dispatched


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


@pytest.mark.parametrize("threshold", [0.0, 1.0, 1000.0])
@pytest.mark.parametrize("scene", ["smooth", "steps"])
def test_coarse_cells_are_what_numpy_s_are(threshold, scene):
    # The rows of an orthographic pair that is toed in stay where they are: every centre that lies where a coarse cell
    # meets a subdivided one is in both, and rounding says which of them has it.
    untied = ("orthographic toe-in",) if threshold <= 1.0 else ()
    for kind in ("off-axis", "toe-in", *untied):
        assert_same(*both(passes_of(scene, SIZE), *pair(kind), grid_threshold=threshold))


PATTERNS = [comb, slats, chequers, blocks, every_step, rows]


def both_wholly(source, cameras, accuracy="balanced"):
    """The whole stage by the GPU and by numpy."""
    options = {"accuracy": SETTINGS[accuracy], "invalid": np.zeros(source["Combined"].shape[:2], bool)}
    ours, numpys = (reproject(source, *cameras, carry=how, **options) for how in (gpu_warp.carry, carrying.carry))
    assert ours.carried_by == ("gpu" if HAS_GPU else "numpy")
    return ours, numpys


def assert_keeps_its_promise(ours, numpys, ties=0.0):
    """Of the mask, and of the colours of all that is not in it: no pixel is left out, but for this share of them."""
    assert np.mean((ours.reasons != 0) != (numpys.reasons != 0)) <= SAME_MASK
    told = (ours.reasons == 0) & (numpys.reasons == 0)
    apart = np.abs(ours.passes["Combined"] - numpys.passes["Combined"]).max(axis=-1)
    assert np.mean(told & (apart > SAME_COLOURS)) <= ties


@pytest.mark.parametrize("kind", RECTIFIED + TURNED)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("seed", range(3))
def test_the_promise_is_kept_on_scenes_that_are_made_up(kind, scene, seed):
    cameras = pair(kind)
    source = passes_of(scene, (cameras[0].width, cameras[0].height), seed)
    assert_keeps_its_promise(*both_wholly(source, cameras), TIES if kind.endswith("general") else 0.0)


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
    assert_keeps_its_promise(*both_wholly(source, cameras, "exact"), TIES if kind.endswith("general") else 0.0)


def test_no_depth_disturbs_it():
    """Side by side: next to nothing, denormal, far, the sky, and nothing that is known."""
    values = np.array([1e-45, 1e-6, 1e-3, 1.0, 3.5, 1e4, 1e9, 3e38, np.inf, np.nan], np.float32)
    source = passes_of("smooth", SIZE)
    source["Depth"] = np.random.default_rng(2).choice(values, source["Depth"].shape).astype(np.float32)
    for kind in ("off-axis", "toe-in", "orthographic parallel"):
        with np.errstate(over="ignore"):
            ours = gpu_warp.carry(source, *pair(kind))
        assert np.array_equal(np.isnan(ours.warp.x), ~ours.warp.covered)
        assert not np.isnan(ours.warp.nearness).any()
        assert np.isfinite(ours.passes["Combined"]).all()


@pytest.mark.parametrize("kind", ["off-axis", "toe-in"])
def test_positions_and_vectors_are_the_target_s_own(kind):
    one, other = pair(kind)
    source = passes_of("steps", SIZE)
    origin, direction = world_rays(one, *(axis.ravel() for axis in pixel_centres(one)))
    position = origin + source["Depth"].reshape(-1, 1) * direction
    source["Position"] = position.reshape(*SIZE[::-1], 3).astype(np.float32)
    source["Vector"] = np.random.default_rng(3).uniform(-4.0, 4.0, (*SIZE[::-1], 4)).astype(np.float32)
    source |= dict.fromkeys(OF_SOURCE, source["Combined"])
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
    ours = gpu_warp.carry(passes_of("smooth", SIZE), one, other, grid_threshold=0.0)
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


@pytest.mark.parametrize(
    ("limit", "size"),
    [
        pytest.param(97, (96, 32), id="wider"),
        pytest.param(97, (32, 96), id="higher"),
        pytest.param(99, (97, 40), id="of a width that cannot be folded"),
        pytest.param(98, (60, 96), id="higher, once it is folded"),
    ],
)
def test_numpy_warps_what_no_texture_holds(limit, size, monkeypatch, dispatched):
    assert (gpu_warp.usable() is not None) == HAS_GPU
    dispatched.clear()
    monkeypatch.setattr(gpu.capabilities, "max_texture_size_get", lambda: limit)
    ours, numpys = both(passes_of("steps", size), *pair("off-axis", size))
    assert not dispatched
    assert_identical(ours, numpys)


def test_numpy_warps_what_the_memory_has_no_room_for(monkeypatch):
    usable = gpu_warp.usable()

    def full(*_, **__):
        raise RuntimeError("gpu.texture.new(...) failed")

    monkeypatch.setattr(gpu.types, "GPUTexture", full)
    ours, numpys = both(passes_of("steps", SIZE), *pair("off-axis"))
    assert_identical(ours, numpys)
    assert gpu_warp.usable() == usable


def test_numpy_warps_what_one_invocation_would_take_too_long_for(untried, monkeypatch, dispatched):
    """A quad near the plane in which the target's camera stands covers the picture; drivers end what does not end."""
    few = gpu_shaders.COMMON.replace(f"#define MOST {bands.PIXELS}\n", "#define MOST 150\n")
    assert few != gpu_shaders.COMMON
    # Its trial is of pictures that have such quads, too.
    assert (gpu_warp.usable() is not None) == HAS_GPU
    gpu_textures.shader.cache_clear()
    monkeypatch.setattr(gpu_shaders, "COMMON", few)
    ours, numpys = both(passes_of("steps", SIZE), *pair("toe-in"), grid_threshold=0.0)
    assert_same(ours, numpys)
    assert ours.by == ("gpu" if HAS_GPU else "numpy")
    dispatched.clear()
    ours, numpys = both(passes_of("smooth", SIZE), *pair("toe-in"), grid_threshold=1000.0)
    assert not numpys.grid.subdivided.all()
    assert_identical(ours, numpys)
    assert (ours.by, bool(dispatched)) == ("numpy", HAS_GPU)
    assert (gpu_warp.usable() is not None) == HAS_GPU


def test_what_is_as_near_is_settled_by_no_race():
    """Layers that cross, over and over: of two quads that are as near, the same one has the pixel each time."""
    source = passes_of("noise", SIZE)
    source["Depth"] = np.round(source["Depth"])
    for kind in ("toe-in", "orthographic toe-in"):
        first, *others = (gpu_warp.carry(source, *pair(kind)) for _ in range(4))
        for other in others:
            assert_identical(other, first)


def test_numpy_warps_between_cameras_of_two_kinds(dispatched):
    assert (gpu_warp.usable() is not None) == HAS_GPU
    dispatched.clear()
    one, other = pair("off-axis")[0], pair("orthographic general")[1]
    assert isinstance(other, OrthographicCamera)
    assert_identical(*both(passes_of("smooth", SIZE), one, other))
    assert not dispatched


def assert_identical(ours, numpys):
    assert np.array_equal(ours.empty, numpys.empty)
    for name, image in numpys.passes.items():
        np.testing.assert_array_equal(ours.passes[name], image)


def test_many_warps_leave_no_memory_behind():
    size = (256, 144)
    source, eyes = passes_of("steps", size), pair("off-axis", size)
    toed_in = pair("toe-in", size)

    def warp_often(times):
        for _ in range(times):
            gpu_warp.carry(source, *eyes)
            gpu_warp.carry(source, *toed_in)
        gc.collect()
        return resident()

    before = warp_often(10)
    assert warp_often(100) - before < GROWTH


def test_the_gpu_s_state_is_left_alone():
    def state():
        names = ("blend_get", "depth_test_get", "depth_mask_get", "viewport_get", "scissor_get", "line_width_get")
        return {name: getattr(gpu.state, name)() for name in names}

    source, eyes = passes_of("steps", SIZE), pair("toe-in")
    if not HAS_GPU:
        with pytest.raises(SystemError):
            state()
        return
    assert gpu_warp.usable()
    before = state()
    gpu_warp.carry(source, *eyes)
    assert state() == before


def resident():
    """Bytes that this process holds in memory, textures included where a processor plays the GPU."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")
