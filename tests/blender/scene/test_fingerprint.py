"""A scene's fingerprint is the same wherever, whenever and however the scene is looked at."""

import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.scene.file_digest import BLOCK_BYTES, SAMPLED_BLOCKS, file_digest
from stereo_reproject.blender.scene.fingerprint import (
    fingerprint_of,
    scene_fingerprint,
    scene_fingerprints,
    what_changed,
)
from stereo_reproject.blender.scene.working import open_blend
from tests.blender.scene_of_all_kinds import scene_with_everything
from tests.blender.snapshot import everything

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def scene(tmp_path):
    return scene_with_everything(tmp_path)


def test_a_scene_is_the_same_when_it_is_loaded_again(scene, tmp_path):
    before = scene_fingerprints(scene)
    assert scene_fingerprints(open_blend(tmp_path / "scene.blend")) == before
    bpy.ops.wm.save_mainfile()
    assert scene_fingerprints(open_blend(tmp_path / "scene.blend")) == before


def test_a_copy_in_another_folder_at_another_frame_is_the_same(scene, tmp_path):
    before = scene_fingerprints(scene)
    copy = tmp_path / "other" / "deeper" / "copy.blend"
    copy.parent.mkdir(parents=True)
    scene.frame_set(17)
    bpy.ops.wm.save_as_mainfile(filepath=str(copy), copy=True, relative_remap=True)
    scene = open_blend(copy)
    assert scene.frame_current == 17
    assert bpy.data.images["noise.png"].filepath != "//textures/noise.png"
    assert scene_fingerprints(scene) == before


def test_another_process_finds_the_same(scene, tmp_path):
    code = (
        "import os, sys\nfrom pathlib import Path\nfrom stereo_reproject.blender.scene.working import open_blend\n"
        "from stereo_reproject.blender.scene.fingerprint import scene_fingerprint\n"
        "print('found', scene_fingerprint(open_blend(Path(sys.argv[1]))), flush=True)\nos._exit(0)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "scene.blend")]
    told = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert f"found {scene_fingerprint(scene)}" in told


def other_frame(scene):
    scene.frame_set(33)


def there_and_back(scene):
    frame = scene.frame_current
    scene.frame_set(33)
    scene.frame_set(frame)


def rendered(scene):
    bpy.ops.render.render(scene=scene.name)


def selected(scene):
    for item in scene.objects:
        item.select_set(not item.select_get())
    bpy.context.view_layer.objects.active = scene.objects["Curve"]
    tree = bpy.data.materials["textured"].node_tree
    tree.nodes.active = tree.nodes[-1]
    tree.nodes[-1].select = not tree.nodes[-1].select


def hidden_in_the_viewport(scene):
    scene.objects["Cube"].hide_viewport = True
    scene.objects["Plane"].hide_set(True)
    scene.objects["Plane"].show_wire = True


def output(scene):
    scene.render.filepath, scene.render.image_settings.file_format = "//elsewhere/", "TIFF"
    scene.render.use_overwrite = False


def frames(scene):
    scene.frame_start, scene.frame_end, scene.frame_step = 3, 9, 2


def moved_nodes(scene):
    for node in bpy.data.materials["textured"].node_tree.nodes:
        node.location, node.label, node.color = (7.0, 8.0), "label", (1.0, 0.0, 0.0)


def device(scene):
    scene.cycles.device = "GPU"
    scene.cycles.preview_samples += 1
    scene.render.threads = 1


def cursor(scene):
    scene.cursor.location = (1.0, 2.0, 3.0)
    scene.tool_settings.use_snap = not scene.tool_settings.use_snap


def stranger(scene):
    bpy.data.objects.new("Not in the scene", bpy.data.meshes.new("Neither"))
    bpy.data.scenes.new("Another")


@pytest.mark.parametrize(
    "change",
    [
        other_frame,
        there_and_back,
        rendered,
        selected,
        hidden_in_the_viewport,
        output,
        frames,
        moved_nodes,
        device,
        cursor,
        stranger,
    ],
)
def test_what_no_picture_shows_changes_nothing(scene, change):
    before = scene_fingerprints(scene)
    change(scene)
    assert what_changed(before, scene_fingerprints(scene)) == []


def test_asking_changes_nothing(scene):
    image = bpy.data.images["noise.png"]
    assert not image.has_data
    scene_fingerprint(scene)  # Blender makes the settings of its engines when they are first read
    assert not image.has_data
    scene.frame_set(12)
    scene.objects["Sun"].location = (9.0, 9.0, 9.0)  # not keyed: to evaluate the frame would lose it
    before = everything()
    scene_fingerprint(scene)
    assert everything() == before


@pytest.mark.parametrize("place", [0, 1, -1])
def test_a_long_file_is_known_by_samples(tmp_path, place):
    content = np.zeros(BLOCK_BYTES * SAMPLED_BLOCKS * 2, np.uint8)
    path = tmp_path / "long"
    content.tofile(path)
    before = file_digest(path)
    content[place] = 1
    content.tofile(path)
    assert file_digest(path) != before
    assert file_digest(tmp_path / "none") == "missing"


def test_the_whole_is_told_by_its_parts(scene):
    parts = scene_fingerprints(scene)
    assert fingerprint_of(parts) == scene_fingerprint(scene)
    assert {"objects", "meshes", "materials", "scene settings", "files"} <= parts.keys()
    assert what_changed({"a": "1", "b": "2"}, {"a": "1", "c": "2"}) == ["b", "c"]


@pytest.mark.parametrize("name", ["walking-man", "living-room"])
def test_a_real_scene_stays_itself(shared_scenes, tmp_path, name):
    scene = open_blend(shared_scenes / name / f"{name}.blend")
    before = scene_fingerprints(scene)
    scene.frame_set(scene.frame_current + 13)
    copy = tmp_path / "copy.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(copy), copy=True, relative_remap=True)
    assert what_changed(before, scene_fingerprints(scene)) == []
    assert what_changed(before, scene_fingerprints(open_blend(copy))) == []
