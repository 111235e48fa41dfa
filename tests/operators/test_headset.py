"""The panel's pairs for headsets: a perspective scene rendered as VR180 or 360°, and its camera as it was."""

from dataclasses import asdict
from types import SimpleNamespace

import bpy
import pytest

from stereo_reproject.blender.scene.rig import stereo_cameras
from stereo_reproject.settings.frame import SceneOverrides
from tests.blender.snapshot import everything
from tests.blender.toolbox import add_camera, add_plane, add_sun, diffuse, empty_scene, set_border
from tests.delivery.movies import described, sphere, stereo
from tests.operators.test_operators import Drawn

SIZE = (64, 36)


@pytest.fixture
def scene():
    scene = empty_scene(*SIZE, samples=1)
    for place in ((0, 0, -4), (3, 1, -3)):
        add_plane(scene, diffuse(colour=(0.8, 0.2, 0.1)), size=(2, 2), location=place)
    add_sun(scene, strength=1.5)
    add_camera(scene, interocular=0.06, convergence=2.0)
    scene.camera.data.clip_start = 0.01
    return scene


def choose(scene, headset, height=32):
    scene.stereo_reproject.headset, scene.stereo_reproject.headset_height = headset, height


def settings(scene, *, preview=False):
    from stereo_reproject_extension.operators.render import settings_of

    return asdict(settings_of(scene, preview=preview).scene)


def panorama(scene, kind="EQUIRECTANGULAR"):
    scene.camera.data.type, scene.camera.data.panorama_type = "PANO", kind
    return scene.camera.data


@pytest.mark.parametrize(
    ("headset", "height", "size"), [("vr180", 32, (32, 32)), ("vr360", 32, (64, 32)), ("vr180", 4096, (4096, 4096))]
)
def test_the_settings_are_those_of_the_command_line(extension, scene, headset, height, size):
    choose(scene, headset, height)
    assert settings(scene) == asdict(SceneOverrides(frame=scene.frame_current, panorama=headset, size=size))


def test_a_preview_is_as_much_smaller_as_any_other(extension, scene):
    choose(scene, "vr360", 4096)
    scene.stereo_reproject.preview_percentage = 10
    found = settings(scene, preview=True)
    assert (found["panorama"], found["size"]) == ("vr360", (820, 410))


def test_without_it_nothing_is_changed(extension, scene):
    assert scene.stereo_reproject.headset == "camera"
    assert settings(scene) == asdict(SceneOverrides(frame=scene.frame_current))


def test_a_camera_that_is_a_panorama_already_is_left_as_it_is(extension, scene):
    choose(scene, "vr180")
    panorama(scene)
    assert settings(scene) == asdict(SceneOverrides(frame=scene.frame_current))


def test_a_pair_and_its_preview(extension, scene):
    from stereo_reproject_extension.operators.results import result_of

    choose(scene, "vr180")
    for preview in (False, True):
        before = everything()
        assert bpy.ops.render.stereo_reproject_image(preview=preview) == {"FINISHED"}
        assert everything() == before
        report = result_of(scene).report
        assert (report["panorama"], report["size"]) == ("vr180", [32, 32])
        assert result_of(scene).picture("CUTOUTS").exists()
    choose(scene, "camera")
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert "panorama" not in result_of(scene).report
    assert result_of(scene).picture("CUTOUTS") is None


def test_an_animation_s_movie_says_what_it_shows(extension, scene, tmp_path):
    choose(scene, "vr180", 64)
    scene.frame_end = 2
    render = scene.render
    render.filepath, render.pixel_aspect_x, render.use_multiview = str(tmp_path / "shot.mp4"), 2.0, True
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "VIDEO"
    render.image_settings.file_format = "FFMPEG"
    render.ffmpeg.format, render.ffmpeg.codec = "MPEG4", "H264"
    render.image_settings.views_format = "STEREO_3D"
    render.image_settings.stereo_3d_format.display_mode = "TOPBOTTOM"
    assert bpy.ops.render.stereo_reproject_animation() == {"FINISHED"}
    assert (scene.camera.data.type, render.pixel_aspect_x) == ("PERSP", 2.0)
    (movie,) = tmp_path.glob("*.mp4")
    assert (stereo(movie), sphere(movie)[:21]) == ("top and bottom", "tiled equirectangular")
    assert "64x128 [SAR 1:1" in described(movie)


# The camera's panel


@pytest.mark.parametrize("by", ["panel", "camera"])
@pytest.mark.parametrize(("mode", "degrees"), [("OFFAXIS", "1.7"), ("PARALLEL", None)])
def test_the_camera_s_panel_tells_what_a_headset_needs_and_nothing_of_a_screen(extension, scene, by, mode, degrees):
    from stereo_reproject_extension.operators import panels

    def drawn():
        layout = Drawn()
        context = SimpleNamespace(scene=scene, region=None, space_data=None, preferences=bpy.context.preferences)
        panels._Camera.draw(SimpleNamespace(layout=layout), context)
        texts = [item[-1]["text"] for item in layout.items if item[0] == "label"]
        return [item[1] for item in layout.items if item[0] == "operator"], " ".join(texts)

    scene.camera.data.stereo.convergence_mode = mode
    operators, text = drawn()
    assert "stereo_reproject.fit_to_comfort" in operators
    assert "headset" not in text
    if by == "panel":
        choose(scene, "vr180")
    else:
        panorama(scene)
    operators, text = drawn()
    assert operators == []
    assert "there is no screen" in text
    # A camera that the panel sets up for a headset gets parallel eyes.
    told = degrees is not None and by == "camera"
    assert text.count("turn apart") == told
    assert not told or f"by {degrees}°" in text
    says = "only the interocular distance counts" if by == "panel" else "What is grey does not count"
    assert says in text


def parallel(data):
    data.stereo.convergence_mode = "PARALLEL"


def toed_in(data):
    data.stereo.convergence_mode = "TOE"


def spherical(data):
    data.stereo.use_spherical_stereo = True


MODE, PIVOT, DISTANCE = "convergence_mode", "pivot", "convergence_distance"
COUNT = {
    "a screen": ("PERSP", [], {MODE, PIVOT, DISTANCE}),
    "a screen, parallel": ("PERSP", [parallel], {MODE, PIVOT}),
    "orthographic": ("ORTHO", [], {MODE, PIVOT, DISTANCE}),
    "panorama": ("PANO", [], {MODE, PIVOT}),
    "panorama, toed in": ("PANO", [toed_in], {MODE, PIVOT, DISTANCE}),
    "spherical": ("PANO", [spherical], {MODE, DISTANCE}),
    "spherical, parallel": ("PANO", [spherical, parallel], {MODE}),
    "spherical, in perspective": ("PERSP", [spherical], {MODE, DISTANCE}),
}


@pytest.mark.parametrize(("kind", "changes", "count"), COUNT.values(), ids=COUNT.keys())
def test_the_stereo_settings_that_count_are_those_that_move_an_eye(extension, scene, kind, changes, count):
    """Those of a camera itself: each is changed by itself, and either moves what the eyes see or does not."""
    from stereo_reproject_extension.operators.headset import stereo_settings_that_count

    data = scene.camera.data
    data.type = kind
    if kind == "PANO":
        panorama(scene)
    for change in changes:
        change(data)
    assert stereo_settings_that_count(scene) == {"interocular_distance", *count}
    before = rays(scene)
    data.stereo.pivot = "CENTER" if data.stereo.pivot != "CENTER" else "RIGHT"
    moved = {PIVOT} if rays(scene) != before else set()
    before = rays(scene)
    data.stereo.convergence_distance *= 2.0
    moved |= {DISTANCE} if rays(scene) != before else set()
    assert moved == count - {MODE}


def rays(scene):
    """All that both eyes of the scene's camera are told by, as text."""
    bpy.context.view_layer.update()
    return repr(stereo_cameras(scene.camera, scene.render))


def test_only_the_interocular_distance_counts_for_what_the_panel_asks(extension, scene):
    from stereo_reproject_extension.operators.headset import stereo_settings_that_count

    choose(scene, "vr360")
    assert stereo_settings_that_count(scene) == {"interocular_distance"}


def test_the_verdict_says_that_the_headset_setting_was_changed_and_not_the_camera_s(extension, scene):
    from stereo_reproject_extension.operators.results import result_of
    from stereo_reproject_extension.operators.stereo import set_anew_words

    stereo = scene.camera.data.stereo
    choose(scene, "vr180")
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    report = result_of(scene).report
    assert set_anew_words(scene, report) is None
    stereo.convergence_distance, stereo.pivot = 3.0, "RIGHT"
    assert set_anew_words(scene, report) is None
    stereo.interocular_distance *= 2.0
    assert set_anew_words(scene, report).startswith("The camera's stereo settings were changed since")
    stereo.interocular_distance *= 0.5
    for other in ("camera", "vr360"):
        choose(scene, other)
        assert set_anew_words(scene, report).startswith("The headset setting was changed since")


# Bad input


def orthographic(scene):
    choose(scene, "vr180")
    scene.camera.data.type = "ORTHO"


def by_eevee(scene):
    choose(scene, "vr180")
    scene.stereo_reproject.source_engine = "eevee"


def cropped(scene):
    choose(scene, "vr180")
    set_border(scene, (0.25, 0.75, 0.0, 1.0))


def crossed_poles(scene):
    data = panorama(scene)
    data.stereo.use_spherical_stereo = data.stereo.use_pole_merge = True
    # In this order: Blender moves the other one with it.
    data.stereo.pole_merge_angle_from, data.stereo.pole_merge_angle_to = 1.2, 0.9


BAD = {
    "orthographic": (orthographic, "Camera 'Camera' is orthographic: a VR180 panorama needs a perspective"),
    "EEVEE": (by_eevee, "A VR180 panorama is rendered by Cycles alone: set Cycles as engine"),
    "crop": (cropped, "A headset shows whole VR180 panoramas: switch Render Region off in Output properties"),
    "crossed poles": (crossed_poles, "The pole merge of the camera starts at 68.8° and ends at 51.6°: set its end"),
}


@pytest.mark.parametrize(("change", "said"), BAD.values(), ids=BAD.keys())
def test_what_cannot_be_rendered_is_one_line(extension, scene, change, said):
    change(scene)
    before = everything()
    with pytest.raises(RuntimeError) as raised:
        bpy.ops.render.stereo_reproject_image()
    (line,) = str(raised.value).strip().splitlines()
    assert line.removeprefix("Error: ").startswith(said)
    assert everything() == before


@pytest.mark.parametrize("name", ["orthographic", "EEVEE", "crop"])
def test_the_panel_says_it_before(extension, scene, name):
    from stereo_reproject_extension.operators.panels import obstacle

    assert obstacle(scene) is None
    change, said = BAD[name]
    change(scene)
    assert obstacle(scene).startswith(said)
    choose(scene, "camera")
    assert obstacle(scene) is None


def test_eyes_that_are_wider_apart_than_something_is_away_are_warned_of(extension, scene):
    from stereo_reproject_extension.operators.results import result_of

    choose(scene, "vr180")
    scene.camera.data.stereo.interocular_distance = 5.0
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    (line,) = [line for line in result_of(scene).warnings if "interocular" in line]
    assert "shows what is nearer to the camera than its interocular distance" in line
    assert "\n" not in line
