"""What counts as changed between two frames of a scene, besides its camera."""

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.scene.changes import state_of
from stereo_reproject.blender.scene.movers import pixels_of_shapes, shapes_of
from stereo_reproject.blender.scene.rig import stereo_cameras
from stereo_reproject.blender.scene.working import evaluated, move_to, working_scene
from stereo_reproject.settings.frame import SceneOverrides
from tests.render.test_trace_requests import small_studio


def keyed(owner, path, first, last, index=-1):
    """Animate a property from frame 1 to frame 4."""
    for frame, value in ((1, first), (4, last)):
        if index < 0:
            setattr(owner, path, value)
        else:
            getattr(owner, path)[index] = value
        owner.keyframe_insert(path, index=index, frame=frame)


def moving_camera(scene):
    keyed(scene.camera, "location", scene.camera.location[0], scene.camera.location[0] + 0.3, 0)
    keyed(scene.camera.data, "lens", 40.0, 45.0)


def moving_box(scene):
    keyed(bpy.data.objects["Box"], "location", -1.0, 0.5, 0)


def box_on_a_moving_empty(scene):
    empty = bpy.data.objects.new("Cart", None)
    scene.collection.objects.link(empty)
    bpy.data.objects["Box"].parent = empty
    keyed(empty, "location", 0.0, 0.5, 0)


def bent_box(scene):
    box = bpy.data.objects["Box"]
    box.shape_key_add(name="Basis")
    bent = box.shape_key_add(name="Bent")
    bent.data[0].co.x += 0.5
    keyed(bent, "value", 0.0, 1.0)


def hidden_box(scene):
    box = bpy.data.objects["Box"]
    for frame, hidden in ((1, False), (2, True)):
        box.hide_render = box.hide_viewport = hidden
        box.keyframe_insert("hide_render", frame=frame)
        box.keyframe_insert("hide_viewport", frame=frame)


def brighter_lamp(scene):
    lamp = next(item for item in bpy.data.objects if item.type == "LIGHT")
    keyed(lamp.data, "energy", 100.0, 50.0)


def moving_lamp(scene):
    lamp = next(item for item in bpy.data.objects if item.type == "LIGHT")
    keyed(lamp, "location", 0.0, 1.0, 0)


def changing_colour(scene):
    material = next(material for material in bpy.data.materials if material.node_tree and material.users)
    node = next(node for node in material.node_tree.nodes if node.type.startswith("BSDF"))
    socket = node.inputs[0]
    for frame, value in ((1, 0.1), (4, 0.9)):
        socket.default_value[0] = value
        socket.keyframe_insert("default_value", index=0, frame=frame)


def other_seeds(scene):
    keyed(scene.cycles, "seed", 1, 20)


def driven_seed(scene):
    """`#frame` in the field, as most people animate it."""
    scene.cycles.driver_add("seed").driver.expression = "frame"


def pulled_focus(scene):
    camera = scene.camera.data
    camera.dof.use_dof = True
    keyed(camera.dof, "focus_distance", 1.0, 5.0)


def animated_but_still(scene):
    keyed(bpy.data.objects["Box"], "location", 0.25, 0.25, 0)


def states(tmp_path, *changes):
    scene = small_studio(tmp_path, *changes, lit=True)
    with working_scene(scene, SceneOverrides(frame=1)) as working:
        found = [state_of(working)]
        for frame in (3, 1):
            move_to(working, frame)
            found.append(state_of(working))
    return found


@pytest.mark.parametrize("change", [moving_camera, other_seeds, driven_seed, animated_but_still])
def test_camera_and_noise_are_no_change(tmp_path, change):
    first, later, _ = states(tmp_path, change)
    assert (later.moved_since(first), later.changed_since(first)) == ([], [])


def test_a_pulled_focus_is_a_change(tmp_path):
    first, later, again = states(tmp_path, pulled_focus)
    assert [name.split()[0] for name in later.changed_since(first)] == ["lens"]
    assert again.changed_since(first) == []


@pytest.mark.parametrize("change", [moving_box, box_on_a_moving_empty, bent_box, hidden_box])
def test_what_moves_is_named(tmp_path, change):
    first, later, again = states(tmp_path, change)
    assert later.moved_since(first) == ["Box"]
    assert later.changed_since(first) == []
    assert again == first


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (brighter_lamp, "light "),
        (moving_lamp, "light "),
        (changing_colour, "material "),
    ],
)
def test_what_else_changes_is_named(tmp_path, change, what):
    first, later, again = states(tmp_path, change)
    [name] = later.changed_since(first)
    assert name.startswith(what)
    assert later.moved_since(first) == []
    assert again == first


def test_the_triangles_of_what_moves_are_where_it_is(tmp_path):
    scene = small_studio(tmp_path, moving_box, lit=True)
    with working_scene(scene, SceneOverrides(frame=1)) as working:
        eye = stereo_cameras(evaluated(working.camera, working), working.render)["left"]
        masks = []
        for frame in (1, 4):
            move_to(working, frame)
            shapes = shapes_of(working, ["Box"])
            assert len(shapes) == 1
            low, high = shapes[0].box
            corners = np.array(_world_corners("Box", working))
            np.testing.assert_allclose((low, high), (corners.min(axis=0), corners.max(axis=0)), atol=1e-5)
            masks.append(pixels_of_shapes(shapes, eye))
        assert all(mask.any() for mask in masks)
        assert (masks[0] & ~masks[1]).any()
        assert shapes_of(working, ["nothing of this name"]) == []


def _world_corners(name, working):
    thing = evaluated(bpy.data.objects[name], working)
    return [thing.matrix_world @ vertex.co for vertex in thing.data.vertices]


def test_hair_has_no_triangles_that_tell_where_it_is(tmp_path):
    def haired(scene):
        moving_box(scene)
        box = bpy.data.objects["Box"]
        box.modifiers.new("Hair", "PARTICLE_SYSTEM")
        box.particle_systems[0].settings.type = "HAIR"

    scene = small_studio(tmp_path, haired, lit=True)
    with working_scene(scene, SceneOverrides(frame=1)) as working:
        assert shapes_of(working, ["Box"]) is None
