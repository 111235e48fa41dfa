"""Costs of a scene of many objects, counted and not timed: `make objects` measures them."""

import sys
from contextlib import contextmanager

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.engines.packed_trace import CAMERAS, trace_packed
from stereo_reproject.blender.engines.packed_views import PackedPixels
from stereo_reproject.blender.engines.render import render_views
from stereo_reproject.blender.output.delivery import deliver_side_by_side
from stereo_reproject.blender.scene.effects import plan_effects
from stereo_reproject.blender.scene.fingerprint import scene_fingerprints
from stereo_reproject.blender.scene.rig import stereo_cameras
from stereo_reproject.blender.scene.working import evaluated, working_scene
from stereo_reproject.settings.frame import SceneOverrides
from tests.blender.toolbox import add_camera, add_cube, diffuse, empty_scene

FEW, MANY = 10, 30

CALLS_TO_PLAN = 230
"""For each object with a mesh and a material of its own; 212 in Blender 5.2, 180 in 4.5."""

CALLS_TO_FINGERPRINT = 1100
"""The same; 857 and 918."""

WIDTH, HEIGHT = 24, 16


def scene_of(count):
    """Cubes with meshes and materials of their own."""
    scene = empty_scene(WIDTH, HEIGHT, samples=1)
    add_camera(scene)
    for k in range(count):
        add_cube(scene, diffuse(f"matte {k}"), location=(0.1 * k, 0.0, -9.0))
    return scene


@contextmanager
def listening(handlers, handler):
    handlers.append(handler)
    try:
        yield
    finally:
        handlers.remove(handler)


def updated_by_a_packed_fill(count, folder):
    """How many datablocks Blender evaluates again around a packed render."""
    updates = []
    places = np.argwhere(np.arange(WIDTH * HEIGHT).reshape(HEIGHT, WIDTH) % 7 == 0)

    def count_updates(_, depsgraph):
        updates.append(len(depsgraph.updates))

    with working_scene(scene_of(count), SceneOverrides()) as working:
        cameras = stereo_cameras(evaluated(working.camera, working), working.render)
        render_views(working, ("left",), folder)
        with listening(bpy.app.handlers.depsgraph_update_post, count_updates):
            pixels = PackedPixels(cameras["right"], places)
            trace_packed(working, "right", pixels.camera, [pixels], folder, seed=1, by=CAMERAS["osl"])
    return sum(updates)


def calls(function, *arguments, **options):
    """How many functions are called, those that are not Python's own included."""
    found = 0

    def count(_, event, __):
        nonlocal found
        found += event in ("call", "c_call")

    sys.setprofile(count)
    try:
        function(*arguments, **options)
    finally:
        sys.setprofile(None)
    return found


def planning(count):
    scene = scene_of(count)
    with working_scene(scene, SceneOverrides()) as working:
        return calls(plan_effects, working, user_scene=scene)


def fingerprinting(count):
    return calls(scene_fingerprints, scene_of(count))


def in_the_scene_that_is_rendered(path, count):
    """Objects that Blender has to evaluate for the picture of a finished pair."""
    scene, found = scene_of(count), []
    picture = np.full((HEIGHT, WIDTH, 4), 0.5, np.float32)
    with listening(bpy.app.handlers.render_pre, lambda rendered, _: found.append(len(rendered.objects))):
        deliver_side_by_side(scene, {"left": picture, "right": picture}, path)
    return found


def test_a_packed_fill_has_no_object_evaluated_again(tmp_path):
    """Blender evaluates, and Cycles syncs, all objects when a camera is given another lens."""
    few, many = (updated_by_a_packed_fill(count, tmp_path) for count in (FEW, MANY))
    assert 0 < few == many < FEW


def test_the_picture_of_the_pair_has_no_object_evaluated(tmp_path):
    assert in_the_scene_that_is_rendered(tmp_path / "stereo.png", FEW) == [0]


@pytest.mark.parametrize(("work", "most"), [(planning, CALLS_TO_PLAN), (fingerprinting, CALLS_TO_FINGERPRINT)])
def test_work_grows_by_a_few_calls_with_each_object(work, most):
    # The first call looks at types, and imports.
    work(1)
    few, more, many = (work(count) for count in (FEW, 2 * FEW, 3 * FEW))
    assert many - more == pytest.approx(more - few, rel=0.05), "more than linear"
    assert 0 < (many - more) / FEW <= most
