"""Presets and manual links, by Blender's own mechanisms: each setting and button of ours leads to a section that is
there, and a preset brings back what it was made of."""

import re
from pathlib import Path

import bpy
import pytest
from bl_operators.wm import WM_OT_doc_view_manual, _wm_doc_get_id

from tests.operators.conftest import PACKAGE, ROOT


def settings():
    return bpy.context.scene.stereo_reproject


def presets():
    """The presets that Blender's menu lists, by the name of their file."""
    return {
        path.stem: path for folder in bpy.utils.preset_paths("stereo_reproject") for path in Path(folder).glob("*.py")
    }


def execute(path):
    bpy.ops.script.execute_preset(filepath=str(path), menu_idname="STEREO_REPROJECT_PT_presets")


def test_the_extension_s_own_presets_are_listed_and_gone_with_it(package):
    package.register()
    own = {"Final_Frames", "Quick_Look_with_EEVEE", "VR180", "VR_360"}
    assert own <= presets().keys()
    package.unregister()
    assert presets().keys().isdisjoint(own)


def test_the_extension_s_own_presets_set_what_they_are_named_for(extension):
    own = presets()
    execute(own["Quick_Look_with_EEVEE"])
    assert settings().source_engine == "eevee"
    execute(own["Final_Frames"])
    assert (settings().accuracy, settings().source_engine) == ("high", "scene")


@pytest.mark.parametrize(("name", "panorama"), [("VR180", "vr180"), ("VR_360", "vr360")])
def test_a_preset_for_headsets_asks_for_the_size_that_the_command_line_takes(extension, name, panorama):
    from stereo_reproject_extension.operators.headset import asked_panorama, panorama_size
    from stereo_reproject_extension.stereo_reproject.settings.frame import SceneOverrides

    scene = bpy.context.scene
    settings().headset, settings().headset_height = "camera", 512
    assert asked_panorama(scene) is None
    before = {key: getattr(settings(), key) for key in ("accuracy", "source_engine", "fill", "packed_by")}
    execute(presets()[name])
    assert asked_panorama(scene) == panorama
    assert panorama_size(scene, panorama) == SceneOverrides(panorama=panorama).size
    assert {key: getattr(settings(), key) for key in before} == before


def test_a_preset_brings_back_what_was_set_and_no_more(extension, tmp_path, monkeypatch):
    from stereo_reproject_extension.operators.preset_menu import KEPT

    monkeypatch.setattr(bpy.utils, "user_resource", lambda *_, **__: str(tmp_path))
    chosen = {"accuracy": "exact", "fill": "card", "preview_samples": 7, "screen_width": 9.0, "source": "left"}
    for name, value in chosen.items():
        setattr(settings(), name, value)
    assert bpy.ops.stereo_reproject.add_preset(name="Mine") == {"FINISHED"}
    for name, value in {"accuracy": "draft", "fill": "full", "preview_samples": 1, "source": "right"}.items():
        setattr(settings(), name, value)
    execute(tmp_path / "Mine.py")
    found = {name: getattr(settings(), name) for name in chosen}
    assert found == {**chosen, "source": "right"}
    assert "source" not in KEPT


def names_of_ours():
    """Blender's names of all our properties and operators, as its menus ask for their manual."""
    package = __import__(f"{PACKAGE}.operators.properties", fromlist=["properties"])
    preferences = __import__(f"{PACKAGE}.operators.preferences", fromlist=["preferences"])
    # Blender 4.5 looks up the manual of no add-on's preferences.
    groups = [preferences.StereoReprojectPreferences] * (bpy.app.version >= (5, 0))
    for group in (package.StereoReprojectSettings, *groups):
        own = [name for name in group.__annotations__ if not name.startswith("own_")]
        yield from (f"{group.__name__}.{name}" for name in own)
    for category in ("render", "stereo_reproject"):
        for name in dir(getattr(bpy.ops, category)):
            if category == "stereo_reproject" or "stereo_reproject" in name:
                yield f"{category}.{name}"


def anchors(page):
    """The anchors of a page's headings, as web pages of Markdown have them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_setting_and_button_has_a_section_of_the_manual(extension):
    names = list(names_of_ours())
    assert len(names) > 20
    for name in names:
        url = WM_OT_doc_view_manual._lookup_rna_url(_wm_doc_get_id(name, do_url=False), verbose=False)
        assert url is not None, name
        assert url.startswith(f"{(ROOT / 'docs').as_uri()}/"), name
        page, _, section = url.partition("#")
        assert section in anchors(ROOT / "docs" / page.rpartition("/")[2]), name


@pytest.mark.parametrize("button", ["show_view", "show_side", "wiggle", "export_wiggle"])
def test_buttons_for_looking_at_a_pair_open_the_section_about_that(extension, button):
    name = _wm_doc_get_id(f"stereo_reproject.{button}", do_url=False)
    url = WM_OT_doc_view_manual._lookup_rna_url(name, verbose=False)
    assert url.endswith("/artists.md#looking-at-it-without-glasses")


def test_the_manual_of_blender_s_own_settings_is_blender_s(extension):
    url = WM_OT_doc_view_manual._lookup_rna_url("bpy.types.rendersettings.resolution_x", verbose=False)
    assert url.startswith("https://docs.blender.org/")


def test_the_manual_is_gone_with_the_extension(package):
    package.register()
    before = len(list(bpy.utils.manual_map()))
    package.unregister()
    assert len(list(bpy.utils.manual_map())) == before - 1
