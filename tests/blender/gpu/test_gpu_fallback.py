"""Whether there is a GPU that can be used, found out in silence; where there is none, or none for this, numpy warps."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import bpy  # noqa: F401 - there is no gpu before it
import gpu
import pytest

from stereo_reproject.blender.gpu import shaders as gpu_shaders
from stereo_reproject.blender.gpu import textures as gpu_textures
from stereo_reproject.blender.gpu import warp as gpu_warp
from stereo_reproject.blender.gpu.shaders import PROGRAMS
from stereo_reproject.images import bands
from stereo_reproject.views.camera import OrthographicCamera
from tests.blender.gpu.gpu_cases import HAS_GPU, SIZE, assert_identical, assert_same, both, pair, passes_of
from tests.warp.pairs import warp_pair

ROOT = Path(__file__).resolve().parents[3]

GROWTH = 24 * 2**20
"""Bytes that a process may grow by over many warps: less than a tenth of what their textures hold together."""


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
from stereo_reproject.blender.gpu import warp as gpu_warp
first = gpu_warp.usable()
assert gpu_warp.usable() is first
os.write(2, b"still heard")
"""
    assert in_another_process(program) == (0, "", "still heard")


def test_without_a_driver_there_is_none_and_no_crash(tmp_path):
    program = "from stereo_reproject.blender.gpu import warp as gpu_warp; os.write(1, repr(gpu_warp.usable()).encode())"
    assert in_another_process(program, __EGL_VENDOR_LIBRARY_DIRS=str(tmp_path)) == (0, "None", "")


def test_a_process_ends_well_whatever_still_holds_the_shaders():
    program = """
import gpu
from stereo_reproject.blender.gpu import warp as gpu_warp
dispatch, runs = gpu.compute.dispatch, []
def counted(*arguments):
    runs.append(len(arguments))
    return dispatch(*arguments)
gpu.compute.dispatch = counted
os.write(1, str(bool(gpu_warp.usable()) and bool(runs)).encode())
"""
    assert in_another_process(program) == (0, str(HAS_GPU), "")


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
    monkeypatch.setattr(gpu_warp, "_warp_on_gpu", lost)
    assert_identical(*both(passes_of("steps", SIZE), *pair("off-axis")))
    assert gpu_warp.usable() is None
    assert gpu_warp._given_up == ["the device is lost"] * HAS_GPU


def test_numpy_warps_in_any_thread_but_the_main_one(dispatched):
    assert (gpu_warp.usable() is not None) == HAS_GPU
    dispatched.clear()
    with ThreadPoolExecutor(1) as threads:
        assert threads.submit(gpu_warp.usable).result() is None
        results = threads.submit(both, passes_of("steps", SIZE), *pair("off-axis")).result()
    assert_identical(*results)
    assert not dispatched


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
    few = gpu_shaders.COMMON.replace(f"#define MOST {bands.BAND_PIXELS}\n", "#define MOST 150\n")
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


def test_numpy_warps_between_cameras_of_two_kinds(dispatched):
    assert (gpu_warp.usable() is not None) == HAS_GPU
    dispatched.clear()
    one, other = pair("off-axis")[0], pair("orthographic general")[1]
    assert isinstance(other, OrthographicCamera)
    assert_identical(*both(passes_of("smooth", SIZE), one, other))
    assert not dispatched


def test_many_warps_leave_no_memory_behind():
    size = (256, 144)
    source, eyes = passes_of("steps", size), pair("off-axis", size)
    toed_in = pair("toe-in", size)

    def warp_often(times):
        for _ in range(times):
            warp_pair(source, *eyes, how=gpu_warp.warp_view)
            warp_pair(source, *toed_in, how=gpu_warp.warp_view)
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
    warp_pair(source, *eyes, how=gpu_warp.warp_view)
    assert state() == before


def resident():
    """Bytes that this process holds in memory, textures included where a processor plays the GPU."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")
