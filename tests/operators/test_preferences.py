"""Preferences of the extension: scenes follow them until something is chosen there, scripts have their defaults."""

from pathlib import Path

import bpy
import pytest

from stereo_reproject.blender.scene import user_folder as user_folder_module
from stereo_reproject.blender.scene.user_folder import USER_FOLDER_VARIABLE
from tests.operators.conftest import PACKAGE


@pytest.fixture
def preferences(extension):
    """The extension's preferences as in a Blender in which it is switched on."""
    addon = bpy.context.preferences.addons.new()
    addon.module = PACKAGE
    yield addon.preferences
    bpy.context.preferences.addons.remove(addon)


def chosen():
    return bpy.context.scene.stereo_reproject


@pytest.fixture(autouse=True)
def fresh_scene():
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)


FOLLOWING = {
    "accuracy": ("high", "exact"),
    "preview_samples": (32, 8),
    "screen_width": (4.0, 12.0),
    "eye_distance": (0.05, 0.06),
    "viewing_distance": (1.2, 2.5),
}
"""Settings that follow the preferences: a value for the preferences, and another for the scene."""


@pytest.mark.parametrize("name", FOLLOWING)
def test_a_scene_follows_the_preferences_until_something_is_chosen_there(preferences, name):
    preferred, own = FOLLOWING[name]
    setattr(preferences, name, preferred)
    assert getattr(chosen(), name) == pytest.approx(preferred) if name != "accuracy" else preferred
    setattr(chosen(), name, own)
    setattr(preferences, name, preferences.bl_rna.properties[name].default)
    assert getattr(chosen(), name) == (own if name == "accuracy" else pytest.approx(own))


@pytest.mark.parametrize("name", FOLLOWING)
def test_without_preferences_a_scene_has_their_defaults(extension, name):
    from stereo_reproject_extension.operators.preferences import StereoReprojectPreferences

    default = StereoReprojectPreferences.bl_rna.properties[name].default
    assert getattr(chosen(), name) == default


def test_what_was_chosen_in_a_scene_is_saved_and_what_was_not_still_follows(preferences, tmp_path):
    chosen().accuracy = "exact"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    preferences.accuracy, preferences.preview_samples = "high", 5
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert (chosen().accuracy, chosen().preview_samples) == ("exact", 5)


def test_a_render_is_made_by_the_preferred_accuracy_and_smallest_preview(preferences):
    from stereo_reproject_extension.operators.render import settings_of

    preferences.accuracy, preferences.preview_pixels = "high", 600
    scene = bpy.context.scene
    assert settings_of(scene, preview=False).accuracy == "high"
    assert max(settings_of(scene, preview=True).scene.size) == 600


def test_temporary_files_go_where_the_preferences_say(preferences, tmp_path):
    from stereo_reproject_extension.operators.preferences import temporary_folder

    blender_s = temporary_folder()
    preferences.temporary_folder = str(tmp_path)
    assert temporary_folder() == tmp_path
    preferences.temporary_folder = str(tmp_path / "gone")
    assert temporary_folder() == blender_s


def test_measured_times_are_kept_where_the_preferences_say(preferences, tmp_path, monkeypatch):
    extension = "bl_ext.user_default.stereo_reproject"
    monkeypatch.delenv(USER_FOLDER_VARIABLE, raising=False)
    monkeypatch.setattr(user_folder_module, "__name__", f"{extension}.stereo_reproject.blender.scene.user_folder")
    addon = next(addon for addon in bpy.context.preferences.addons if addon.module == PACKAGE)
    preferences.costs_folder = str(tmp_path)
    assert user_folder_module._folder_of_extension(addon.module) == tmp_path
    preferences.costs_folder = ""
    assert user_folder_module.user_folder() == Path(bpy.utils.extension_path_user(extension))
