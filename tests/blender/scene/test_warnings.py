"""What is said before the first render of what a pair lacks, or has otherwise than Blender's own render."""

import wave

import bpy
import pytest

from stereo_reproject.blender.scene.warnings import scene_warnings, warnings_ahead
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.errors import BadInputError
from stereo_reproject.settings.frame import SceneOverrides
from tests.blender.snapshot import everything
from tests.blender.toolbox import add_camera, empty_scene

STRIPS = ["the Video Sequencer's strips are left out: the pair is of the scene itself"]


@pytest.fixture
def scene():
    scene = empty_scene(64, 36, samples=1)
    add_camera(scene)
    return scene


def add_strip(scene):
    length = {"length": 10} if bpy.app.version >= (5, 0) else {"frame_end": 11}
    return scene.sequence_editor_create().strips.new_effect("Colour", "COLOR", 2, 1, **length)


def test_strips_that_blender_would_render_are_named_as_left_out(scene):
    assert warnings_ahead(scene, SceneOverrides()) == []
    add_strip(scene)
    before = everything()
    assert warnings_ahead(scene, SceneOverrides()) == STRIPS
    with pytest.raises(BadInputError, match="Video Sequencer's strips"):
        warnings_ahead(scene, SceneOverrides(), strict=True)
    assert everything() == before


def test_strips_that_blender_would_not_render_are_not(scene, tmp_path):
    strip = add_strip(scene)
    channel = scene.sequence_editor.channels[strip.channel]
    for owner, name, value in ((scene.render, "use_sequencer", False), (strip, "mute", True), (channel, "mute", True)):
        setattr(owner, name, value)
        assert scene_warnings(scene) == [], name
        setattr(owner, name, not value)
        assert scene_warnings(scene) == STRIPS, name
    scene.sequence_editor.strips.remove(strip)
    with wave.open(str(tmp_path / "sound.wav"), "wb") as sound:
        sound.setparams((1, 2, 8000, 8, "NONE", ""))
        sound.writeframes(bytes(16))
    scene.sequence_editor.strips.new_sound("Sound", str(tmp_path / "sound.wav"), 3, 1)
    assert scene_warnings(scene) == []


def set_region(scene, left, right):
    render = scene.render
    render.use_border, render.use_crop_to_border = True, False
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = left, right, 0.0, 1.0


@pytest.mark.parametrize(
    ("overrides", "part", "whole"),
    [
        (SceneOverrides(), "32 x 36", "64 x 36"),
        (SceneOverrides(size=(200, 100)), "100 x 100", "200 x 100"),
    ],
)
def test_a_region_that_crops_against_the_scenes_settings_is_named_with_its_size(scene, overrides, part, whole):
    set_region(scene, 0.25, 0.75)
    before = everything()
    [warning] = warnings_ahead(scene, overrides)
    assert warning.startswith(f"frames are cropped to the Render Region, {part} pixels: Blender's own have {whole},")
    with working_scene(scene, overrides) as working:
        assert working.render.use_crop_to_border
    with pytest.raises(BadInputError, match="Crop to Render Region is off"):
        warnings_ahead(scene, overrides, strict=True)
    assert everything() == before


def test_a_region_that_crops_as_the_scene_says_or_not_at_all_is_not(scene):
    set_region(scene, 0.25, 0.75)
    scene.render.use_crop_to_border = True
    assert scene_warnings(scene) == []
    set_region(scene, 0.0, 1.0)
    assert scene_warnings(scene) == []
