"""What reads the picture's size or the camera is found, because a packed render has others."""

import bpy
import pytest

from stereo_reproject.blender.engines.packed_trace import CAMERAS, packed_blocker
from stereo_reproject.blender.scene.rig import stereo_cameras
from stereo_reproject.blender.scene.working import evaluated, rendered_layer, working_scene
from stereo_reproject.settings.frame import SceneOverrides
from tests.blender.toolbox import add, add_camera, add_cube, diffuse, empty_scene

AHEAD = (0.0, 0.0, -6.0)


@pytest.fixture
def scene():
    scene = empty_scene(64, 36)
    add_camera(scene)
    add_cube(scene, diffuse(), location=AHEAD).name = "Box"
    return scene


def drive(owner, path, *, index=-1, read=None, of=None, expression="v"):
    """Drive a property by a path of a datablock, or of the scene that is rendered; without a path, by Python alone."""
    driver = owner.driver_add(path, index).driver
    if read is not None:
        variable = driver.variables.new()
        variable.name = "v"
        variable.type = "CONTEXT_PROP" if of is None else "SINGLE_PROP"
        target = variable.targets[0]
        if of is None:
            target.context_property = "ACTIVE_SCENE"
        else:
            target.id_type, target.id = ("SCENE" if isinstance(of, bpy.types.Scene) else "OBJECT"), of
        target.data_path = read
    driver.expression = expression


def found(scene):
    with working_scene(scene, SceneOverrides()) as working:
        eyes = stereo_cameras(evaluated(working.camera, working), working.render)
        return packed_blocker(working, eyes.values(), 10.0, CAMERAS["osl"])


def of_the_box(scene, **how):
    drive(scene.objects["Box"], "location", index=0, **how)


def of_a_material(scene):
    tree = scene.objects["Box"].data.materials[0].node_tree
    node = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfDiffuse")
    drive(tree, f'nodes["{node.name}"].inputs["Roughness"].default_value', read="render.pixel_aspect_x")


def of_the_scene(scene):
    drive(scene, "cycles.samples", read="render.resolution_y", of=scene)


def by_python(scene):
    of_the_box(scene, expression="bpy.context.scene.render.resolution_percentage / 100")


def camera_info(scene):
    tree = bpy.data.node_groups.new("nodes", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    info, cube, result = (tree.nodes.new(k) for k in (CAMERA_INFO, "GeometryNodeMeshCube", "NodeGroupOutput"))
    tree.links.new(info.outputs["Shift"], cube.inputs["Size"])
    tree.links.new(cube.outputs[0], result.inputs[0])
    scene.objects["Box"].modifiers.new("nodes", "NODES").node_group = tree


CAMERA_INFO = "GeometryNodeCameraInfo"


def follows_a_track(scene):
    scene.objects["Box"].constraints.new("FOLLOW_TRACK")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda scene: of_the_box(scene, read="render.resolution_x"), "driver of object 'Box'"),
        (lambda scene: of_the_box(scene, read="camera.data.shift_x"), "driver of object 'Box'"),
        (of_a_material, "driver of material"),
        (of_the_scene, "driver of scene"),
        (by_python, "driver of object 'Box'"),
        (camera_info, "'nodes' read the camera by Camera Info"),
        (follows_a_track, "'Box' follows a track"),
    ],
)
def test_what_reads_is_named(scene, change, told):
    if change is camera_info and not hasattr(bpy.types, CAMERA_INFO):
        pytest.skip("this Blender has no Camera Info")
    change(scene)
    assert told in found(scene)


def test_what_reads_nothing_of_it_is_left_alone(scene):
    of_the_box(scene, read="frame_current")
    box = scene.objects["Box"]
    drive(box, "location", index=1, read="data.lens", of=scene.camera)
    drive(box, "location", index=2, expression="frame / 10 + bpy.context.scene.frame_start")
    assert found(scene) is None


def test_a_named_scene_is_the_users(scene):
    """Its driver sees what nothing changes, whatever size is rendered: it needs no other way."""
    of_the_box(scene, read="render.resolution_x", of=scene)
    other = add(scene, bpy.data.objects.new("Other", None))
    drive(other, "location", index=0, read="render.resolution_x")
    with working_scene(scene, SceneOverrides()) as working:
        working.render.resolution_x = 33
        rendered_layer(working).update()
        seen = [evaluated(item, working).location.x for item in (scene.objects["Box"], other)]
    assert seen == [64.0, 33.0]
    other.animation_data_clear()
    assert found(scene) is None
