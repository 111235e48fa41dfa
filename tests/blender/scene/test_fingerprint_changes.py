"""A scene's fingerprint is another after whatever may be seen, and as before when that is undone."""

from pathlib import Path

import bpy
import pytest

from stereo_reproject.blender.scene.fingerprint import scene_fingerprint, scene_fingerprints, what_changed
from tests.blender.scene_of_all_kinds import geometry_input, node, scene_with_everything, tree_of
from tests.blender.toolbox import Material, add_cube, fcurves


@pytest.fixture
def scene(tmp_path):
    return scene_with_everything(tmp_path)


VALUES = {
    "place": (lambda s: (s.objects["Cube"], "location"), (1.0, 0.0, 0.0)),
    "rotation of what is animated elsewhere": (lambda s: (s.objects["Sun"], "rotation_euler"), (0.0, 1.0, 1.0)),
    "vertex": (lambda s: (s.objects["Cube"].data.vertices[0], "co"), (1.0, 0.0, 0.0)),
    "uv": (lambda s: (s.objects["Cube"].data.uv_layers[0].data[0], "uv"), (0.3, 0.3)),
    "material of a face": (lambda s: (s.objects["Cube"].data.polygons[0], "material_index"), 1),
    "weight": (lambda s: (s.objects["Cube"].data.vertices[0].groups[0], "weight"), 0.25),
    "shape key": (lambda s: (s.objects["Cube"].data.shape_keys.key_blocks["Key"], "value"), 0.75),
    "shape": (lambda s: (s.objects["Cube"].data.shape_keys.key_blocks["Key"].data[0], "co"), (1.0, 0.0, 0.0)),
    "modifier": (lambda s: (s.objects["Cube"].modifiers["Subdivision"], "render_levels"), 1),
    "modifier rendered": (lambda s: (s.objects["Cube"].modifiers["Subdivision"], "show_render"), False),
    "constraint": (lambda s: (s.objects["Cube"].constraints[0], "influence"), 0.5),
    "target of a constraint": (lambda s: (s.objects["Cube"].constraints[0], "target"), lambda s: s.objects["Plane"]),
    "parent": (lambda s: (s.objects["Cube"], "parent"), lambda s: s.objects["Plane"]),
    "hidden": (lambda s: (s.objects["Cube"], "hide_render"), True),
    "seen by rays": (lambda s: (s.objects["Cube"], "visible_glossy"), False),
    "Cycles' own": (lambda s: (s.objects["Cube"].cycles, "shadow_terminator_offset"), 0.5),
    "material": (lambda s: (s.objects["Cube"].material_slots[0], "material"), lambda _: bpy.data.materials["wall"]),
    "point of a curve": (lambda s: (s.objects["Curve"].data.splines[0].points[1], "co"), (1.0, 2.0, 3.0, 1.0)),
    "handle": (lambda s: (s.objects["Curve"].data.splines[1].bezier_points[0], "handle_left"), (1.0, 2.0, 3.0)),
    "bevel": (lambda s: (s.objects["Curve"].data, "bevel_depth"), 0.3),
    "words": (lambda s: (s.objects["Words"].data, "body"), "other words"),
    "metaball": (lambda s: (s.objects["Ball"].data.elements[0], "radius"), 3.0),
    "lattice": (lambda s: (s.objects["Lattice"].data.points[0], "co_deform"), (1.0, 2.0, 3.0)),
    "hair": (lambda s: (s.objects["Hair"].data.attributes["position"].data[0], "vector"), (1.0, 2.0, 3.0)),
    "pose": (lambda s: (s.objects["Armature"].pose.bones["Bone"], "location"), (1.0, 2.0, 3.0)),
    "constraint of a bone": (lambda s: (s.objects["Armature"].pose.bones[0].constraints[0], "use_limit_x"), True),
    "custom property": (lambda s: (s.objects["Cube"], '["custom"]'), 2.0),
    "particles": (lambda s: (s.objects["Plane"].particle_systems[0].settings, "count"), 7),
    "seed of particles": (lambda s: (s.objects["Plane"].particle_systems[0], "seed"), 7),
    "node": (lambda _: (node("BsdfDiffuse").inputs["Roughness"], "default_value"), 0.7),
    "node muted": (lambda _: (node("BsdfDiffuse"), "mute"), True),
    "image of a node": (lambda _: (node("TexImage"), "image"), lambda _: bpy.data.images["generated"]),
    "interpolation": (lambda _: (node("TexImage"), "interpolation"), "Closest"),
    "colour ramp": (lambda _: (tree_of().nodes["Ramp"].color_ramp.elements[0], "position"), 0.3),
    "group in a group": (
        lambda _: (bpy.data.node_groups["Inner"].nodes["Value"].outputs[0], "default_value"),
        0.3,
    ),
    "colour space": (lambda _: (bpy.data.images["noise.png"].colorspace_settings, "name"), "sRGB"),
    "generated": (lambda _: (bpy.data.images["generated"], "generated_color"), (1.0, 0.0, 0.0, 1.0)),
    "geometry nodes' input": (lambda s: geometry_input(s, "Size"), 3.0),
    "geometry nodes' object": (lambda s: geometry_input(s, "Which"), lambda s: s.objects["Cube"]),
    "light": (lambda s: (s.objects["Sun"].data, "angle"), 0.3),
    "world": (lambda s: (s.world.node_tree.nodes["Background"].inputs["Strength"], "default_value"), 0.3),
    "lens": (lambda s: (s.camera.data, "lens"), 50.0),
    "eyes": (lambda s: (s.camera.data.stereo, "interocular_distance"), 0.1),
    "aperture": (lambda s: (s.camera.data.dof, "aperture_fstop"), 1.0),
    "camera": (lambda s: (s, "camera"), lambda _: None),
    "instanced": (lambda _: (bpy.data.objects["Instanced"].data.vertices[0], "co"), (1.0, 0.0, 0.0)),
    "offset of an instance": (lambda _: (bpy.data.collections["Inside"], "instance_offset"), (1.0, 0.0, 0.0)),
    "pass": (lambda s: (s.view_layers[0], "use_pass_mist"), True),
    "excluded": (lambda s: (s.view_layers[1].layer_collection.children[0], "exclude"), True),
    "holdout": (lambda s: (s.view_layers[1].layer_collection.children[0], "holdout"), True),
    "override": (lambda s: (s.view_layers[0], "material_override"), lambda _: bpy.data.materials["wall"]),
    "size": (lambda s: (s.render, "resolution_x"), 64),
    "samples": (lambda s: (s.cycles, "samples"), 9),
    "film": (lambda s: (s.render, "film_transparent"), True),
    "EEVEE": (lambda s: (s.eevee, "taa_render_samples"), 9),
    "exposure": (lambda s: (s.view_settings, "exposure"), 1.0),
    "marker": (lambda s: (s.timeline_markers[0], "frame"), 6),
    "background set": (lambda s: (s, "background_set"), lambda _: bpy.data.scenes.new("Set")),
    "key": (lambda s: (fcurves(s.objects["Sun"])[0].keyframe_points[0], "co"), (2.0, 3.0)),
    "curve muted": (lambda s: (fcurves(s.objects["Sun"])[0], "mute"), True),
    "driver": (lambda s: (s.objects["Sun"].animation_data.drivers[0].driver, "expression"), "frame * 0.02"),
    "strip": (lambda s: (s.camera.animation_data.nla_tracks[0].strips[0], "influence"), 0.5),
}


def read(owner, name):
    value = owner.path_resolve(name) if name.startswith("[") else owner.get(name) if name not in dir(owner) else None
    if value is None and hasattr(owner, name):
        value = getattr(owner, name)
    return value[:] if hasattr(value, "__len__") and not isinstance(value, str) else value


def write(owner, name, value):
    if name in dir(owner):
        setattr(owner, name, value)
    else:
        owner[name.strip('[]"')] = value


@pytest.mark.parametrize("what", VALUES)
def test_a_change_that_can_be_seen_changes_it_and_undone_it_is_as_before(scene, what):
    find, value = VALUES[what]
    before = scene_fingerprints(scene)
    owner, name = find(scene)
    old = read(owner, name)
    write(owner, name, value(scene) if callable(value) else value)
    assert what_changed(before, scene_fingerprints(scene)) != []
    write(*find(scene), old)
    assert what_changed(before, scene_fingerprints(scene)) == []


def link_nodes(scene):
    tree = tree_of()
    link = tree.links.new(node("TexImage").outputs["Alpha"], node("BsdfDiffuse").inputs["Roughness"])
    yield
    tree.links.remove(link)


def another_object(scene):
    item = add_cube(scene, Material("new"), location=(2.0, 0.0, -5.0))
    yield
    bpy.data.objects.remove(item)


def another_file(scene):
    path = Path(bpy.path.abspath(bpy.data.images["noise.png"].filepath))
    content = path.read_bytes()
    path.write_bytes(content[:-20] + bytes(4) + content[-16:])
    yield
    path.write_bytes(content)


def missing_file(scene):
    path = Path(bpy.path.abspath(bpy.data.images["noise.png"].filepath))
    content = path.read_bytes()
    path.unlink()
    yield
    path.write_bytes(content)


def another_text(scene):
    text = bpy.data.texts["lamp.ies"]
    old = text.as_string()
    text.write("// more\n")
    yield
    text.from_string(old)


def compositor_value(scene):
    tree = getattr(scene, "compositing_node_group", None) or scene.node_tree
    node = tree.nodes["Blur"]
    node.mute = True
    yield
    node.mute = False


def longer_bone(scene):
    armature = scene.objects["Armature"]
    bpy.context.view_layer.objects.active = armature
    for tail in ((0.0, 0.0, 2.0), (0.0, 0.0, 1.0)):
        bpy.ops.object.mode_set(mode="EDIT")
        armature.data.edit_bones["Bone"].tail = tail
        bpy.ops.object.mode_set(mode="OBJECT")
        yield


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (link_nodes, "materials"),
        (another_object, "objects"),
        (another_file, "files"),
        (missing_file, "files"),
        (another_text, "texts"),
        (compositor_value, None),
        (longer_bone, "armatures"),
    ],
)
def test_a_change_says_what_it_is(scene, change, kind):
    before = scene_fingerprints(scene)
    steps = change(scene)
    next(steps)
    found = what_changed(before, scene_fingerprints(scene))
    assert kind in found if kind else found
    next(steps, None)
    assert what_changed(before, scene_fingerprints(scene)) == []


def test_pixels_that_were_painted_and_not_saved_count(scene):
    image = bpy.data.images["generated"]
    found = [scene_fingerprint(scene)]
    for value in (0.5, 0.6):
        image.pixels[0] = value
        found.append(scene_fingerprint(scene))
    assert len(set(found)) == 3


def test_what_is_packed_counts(scene, tmp_path):
    before = scene_fingerprints(scene)
    image = bpy.data.images["packed.png"]
    data = image.packed_file.data
    image.pack(data=data[:-20] + bytes(4) + data[-16:], data_len=len(data))
    assert what_changed(before, scene_fingerprints(scene)) == ["images"]


def test_an_image_sequence_is_all_of_its_files(scene, tmp_path):
    folder = tmp_path / "textures"
    for number in (1, 2, 3):
        (folder / f"frame{number:03}.png").write_bytes(bytes([number]) * 100)
    image = bpy.data.images.load(str(folder / "frame001.png"))
    image.source = "SEQUENCE"
    node("TexImage").image = image
    before = scene_fingerprints(scene)
    (folder / "frame003.png").write_bytes(bytes(100))
    assert what_changed(before, scene_fingerprints(scene)) == ["files"]


def test_what_is_linked_from_another_file_counts(tmp_path):
    library = tmp_path / "library.blend"
    found = []
    for height in (0.0, 1.0, 0.0):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        mesh = bpy.data.meshes.new("Linked")
        mesh.from_pydata([(0.0, 0.0, height), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)], [], [(0, 1, 2)])
        bpy.data.libraries.write(str(library), {bpy.data.objects.new("Linked", mesh)})
        bpy.ops.wm.read_factory_settings(use_empty=True)
        with bpy.data.libraries.load(str(library), link=True) as (_, linked):
            linked.objects = ["Linked"]
        bpy.context.scene.collection.objects.link(bpy.data.objects["Linked"])
        found.append(scene_fingerprints(bpy.context.scene))
    assert what_changed(found[0], found[1]) == ["meshes"]
    assert found[0] == found[2]
