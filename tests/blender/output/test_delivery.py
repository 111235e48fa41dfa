"""Finished eyes handed back to Blender: its own view transform and stereo format, and no engine left registered."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
import pytest

from stereo_reproject.blender.output.delivery import deliver_side_by_side, deliver_to_result
from stereo_reproject.blender.output.delivery_engine import ENGINE
from stereo_reproject.blender.output.image_settings import copy_settings
from stereo_reproject.blender.output.pictures import read_png
from stereo_reproject.blender.scene.stand_ins import new_names, renamed_metadata
from stereo_reproject.blender.scene.working import open_blend
from stereo_reproject.errors import StereoReprojectError
from stereo_reproject.images.passes import COLOUR_PASS
from tests.blender.toolbox import add_camera, add_plane, add_sun, diffuse, empty_scene, noise_image, render_plain

ROOT = Path(__file__).resolve().parents[3]
WIDTH, HEIGHT = 48, 27

ROUNDING = 1.01 / 255.0
"""A PNG of 8 bits: a value may fall on either side of a step."""

SECONDS = 60.0
"""Far more than a process takes that comes to its end; 4.5 did not, with an engine registered."""


@pytest.fixture
def scene(tmp_path):
    """A lit floor, seen with noise and with lights brighter than white. Dithering is off: it is random."""
    scene = empty_scene(WIDTH, HEIGHT, samples=4)
    add_plane(scene, diffuse(image=noise_image(tmp_path)), size=(30, 20), location=(0, 0, -8), rotation=(-0.5, 0, 0))
    add_sun(scene, strength=1.5)
    add_camera(scene)
    scene.render.dither_intensity = 0.0
    return scene


def flat(colour):
    return np.broadcast_to(np.array([*colour, 1.0], np.float32), (HEIGHT, WIDTH, 4))


def halves(path):
    return np.split(read_png(path), 2, axis=1)


def test_left_is_on_the_left(scene, tmp_path):
    scene.view_settings.view_transform = "Raw"
    eyes = {"right": flat((0.0, 0.5, 0.0)), "left": flat((0.8, 0.0, 0.0))}
    deliver_side_by_side(scene, eyes, tmp_path / "stereo.png")
    left, right = halves(tmp_path / "stereo.png")
    np.testing.assert_allclose(left, flat((0.8, 0.0, 0.0))[..., :3], atol=ROUNDING)
    np.testing.assert_allclose(right, flat((0.0, 0.5, 0.0))[..., :3], atol=ROUNDING)


def test_rows_stand_upright(scene, tmp_path):
    scene.view_settings.view_transform = "Raw"
    ramp = np.zeros((HEIGHT, WIDTH, 4), np.float32)
    ramp[..., 0] = np.linspace(0.0, 1.0, HEIGHT)[:, None]
    ramp[..., 1] = np.linspace(0.0, 1.0, WIDTH)[None, :]
    ramp[..., 3] = 1.0
    deliver_side_by_side(scene, {"left": ramp, "right": ramp[::-1]}, tmp_path / "stereo.png")
    left, right = halves(tmp_path / "stereo.png")
    np.testing.assert_allclose(left, ramp[..., :3], atol=ROUNDING)
    np.testing.assert_allclose(right, ramp[::-1, :, :3], atol=ROUNDING)


def test_animated_colours_are_those_of_the_frame(scene, tmp_path):
    scene.view_settings.view_transform = "Raw"
    for frame, exposure in ((1, 0.0), (100, -1.0)):
        scene.view_settings.exposure = exposure
        scene.keyframe_insert("view_settings.exposure", frame=frame)
    scene.frame_set(1)
    eyes = {"left": flat((0.8, 0.4, 0.2)), "right": flat((0.8, 0.4, 0.2))}
    for frame, times in ((100, 0.5), (1, 1.0), (None, 1.0)):
        deliver_side_by_side(scene, eyes, tmp_path / "stereo.png", frame=frame)
        for half in halves(tmp_path / "stereo.png"):
            np.testing.assert_allclose(half, times * flat((0.8, 0.4, 0.2))[..., :3], atol=ROUNDING)
        assert (scene.frame_current, scene.view_settings.exposure) == (1, 0.0)


def as_it_is(scene):
    pass


def graded(scene):
    view = scene.view_settings
    view.view_transform = "Filmic"
    view.look, view.exposure, view.gamma = "High Contrast", 1.3, 0.8


def curved(scene):
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.use_curve_mapping = True
    curve = scene.view_settings.curve_mapping.curves[3]
    curve.points.new(0.3, 0.6)
    scene.view_settings.curve_mapping.update()


def exposed(scene):
    scene.view_settings.exposure = -1.7


def with_gamma(scene):
    scene.view_settings.gamma = 1.8


def with_a_look(scene):
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - Punchy"


def white_balanced(scene):
    scene.view_settings.use_white_balance = True
    scene.view_settings.white_balance_temperature = 3200


def another_display(scene):
    scene.display_settings.display_device = "Display P3"


def transparent(scene):
    scene.render.film_transparent = True
    scene.camera.data.lens = 12.0


def blenders_own_side_by_side(scene, path):
    render = scene.render
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth = "PNG", "8"
    settings.color_mode = "RGBA" if scene.render.film_transparent else "RGB"
    settings.views_format = "STEREO_3D"
    settings.stereo_3d_format.display_mode = "SIDEBYSIDE"
    render.use_multiview, render.views_format = True, "STEREO_3D"
    for view in render.views:
        view.use = view.name in ("left", "right")
    render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


COLOURS = [
    as_it_is,
    exposed,
    with_gamma,
    with_a_look,
    graded,
    curved,
    white_balanced,
    another_display,
    transparent,
]


@pytest.mark.parametrize("change", COLOURS)
def test_the_view_transform_is_the_scenes_own(scene, tmp_path, change):
    plain = render_plain(scene, tmp_path)
    change(scene)
    blenders_own_side_by_side(scene, tmp_path / "own.png")
    rendered = render_plain(scene, tmp_path)
    eyes = {view: passes[COLOUR_PASS] for view, passes in rendered.items()}
    if change is not transparent:
        # What is rendered is the same: only its display is another.
        np.testing.assert_array_equal(eyes["left"], plain["left"][COLOUR_PASS])
    deliver_side_by_side(scene, eyes, tmp_path / "ours.png")
    own, ours = read_png(tmp_path / "own.png"), read_png(tmp_path / "ours.png")
    assert own.std() > 0.03, "a picture with something to see"
    np.testing.assert_allclose(ours, own, atol=ROUNDING)


@pytest.mark.parametrize("change", COLOURS[1:-1])
def test_each_of_them_shows(scene, tmp_path, change):
    """Else the test above would hold whatever is done with them."""
    eyes = {view: passes[COLOUR_PASS] for view, passes in render_plain(scene, tmp_path).items()}
    deliver_side_by_side(scene, eyes, tmp_path / "before.png")
    change(scene)
    deliver_side_by_side(scene, eyes, tmp_path / "after.png")
    difference = np.abs(read_png(tmp_path / "after.png") - read_png(tmp_path / "before.png"))
    assert difference.mean() > ROUNDING


def test_the_pictures_colours_are_the_scenes_and_not_those_of_its_output(scene, tmp_path):
    """Output may have a view of its own, for the files of a render."""
    eyes = {view: passes[COLOUR_PASS] for view, passes in render_plain(scene, tmp_path).items()}
    deliver_side_by_side(scene, eyes, tmp_path / "before.png")
    settings = scene.render.image_settings
    settings.color_management = "OVERRIDE"
    settings.view_settings.exposure = 4.0
    deliver_side_by_side(scene, eyes, tmp_path / "after.png")
    np.testing.assert_array_equal(read_png(tmp_path / "after.png"), read_png(tmp_path / "before.png"))


def test_transparent_film_stays_transparent(scene, tmp_path):
    transparent(scene)
    eyes = {view: passes[COLOUR_PASS] for view, passes in render_plain(scene, tmp_path).items()}
    deliver_side_by_side(scene, eyes, tmp_path / "stereo.png")
    image = bpy.data.images.load(str(tmp_path / "stereo.png"))
    alpha = np.array(image.pixels[:]).reshape(HEIGHT, 2 * WIDTH, 4)[::-1, :, 3]
    expected = np.concatenate([eyes["left"][..., 3], eyes["right"][..., 3]], axis=1)
    assert 0.1 < expected.mean() < 0.9
    np.testing.assert_allclose(alpha, expected, atol=ROUNDING)


def contrary_settings(scene):
    """What would make another picture of it, had it a say."""
    render = scene.render
    render.resolution_percentage, render.pixel_aspect_x = 50, 2.0
    render.use_border = render.use_crop_to_border = True
    render.border_max_x = 0.5
    render.use_stamp = True
    render.use_file_extension, render.use_overwrite, render.use_placeholder = True, False, True
    render.views_format = "MULTIVIEW"
    render.views["left"].use = False
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "IMAGE"
    render.image_settings.file_format = "JPEG"
    stereo = render.image_settings.stereo_3d_format
    stereo.display_mode = "TOPBOTTOM"
    stereo.use_sidebyside_crosseyed = stereo.use_squeezed_frame = True
    scene.view_layers.new("Other")
    scene.sequence_editor_create()
    strips = scene.sequence_editor
    effects = strips.strips if hasattr(strips, "strips") else strips.sequences
    arguments = {"length": 10} if bpy.app.version >= (5, 0, 0) else {"frame_end": 10}
    effects.new_effect(name="Colour", type="COLOR", channel=1, frame_start=1, **arguments)


def test_settings_of_the_scene_that_do_not_apply(scene, tmp_path):
    eyes = {view: passes[COLOUR_PASS] for view, passes in render_plain(scene, tmp_path).items()}
    deliver_side_by_side(scene, eyes, tmp_path / "before.png")
    contrary_settings(scene)
    deliver_side_by_side(scene, eyes, tmp_path / "after.png")
    np.testing.assert_array_equal(read_png(tmp_path / "after.png"), read_png(tmp_path / "before.png"))


def test_a_scene_whose_camera_comes_from_a_marker(scene, tmp_path):
    scene.timeline_markers.new("Camera", frame=1).camera = scene.camera
    scene.camera = None
    deliver_side_by_side(scene, {"left": flat((0.5,) * 3), "right": flat((0.5,) * 3)}, tmp_path / "stereo.png")
    assert read_png(tmp_path / "stereo.png").shape == (HEIGHT, 2 * WIDTH, 3)


def engine_is_registered():
    engines = bpy.types.RenderEngine.__subclasses__()
    return any(engine.is_registered for engine in engines if getattr(engine, "bl_idname", None) == ENGINE)


def test_the_engine_is_gone_afterwards(scene, tmp_path):
    scenes = set(bpy.data.scenes.keys())
    deliver_side_by_side(scene, {"left": flat((1, 1, 1)), "right": flat((0, 0, 0))}, tmp_path / "stereo.png")
    assert not engine_is_registered()
    assert set(bpy.data.scenes.keys()) == scenes
    assert scene.render.engine == "CYCLES"


def test_the_engine_is_gone_after_a_failure(scene, tmp_path):
    scenes = set(bpy.data.scenes.keys())
    (tmp_path / "stereo.png").mkdir()
    with pytest.raises(StereoReprojectError) as failure:
        deliver_side_by_side(scene, {"left": flat((1, 1, 1)), "right": flat((0, 0, 0))}, tmp_path / "stereo.png")
    assert "\n" not in str(failure.value)
    assert not engine_is_registered()
    assert set(bpy.data.scenes.keys()) == scenes


def layers_of_result(scene, folder):
    """The view layers that the Render Result has, with the mean of what each shows to either eye."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.views_format = "OPEN_EXR_MULTILAYER", "INDIVIDUAL"
    scene.render.use_multiview = True
    # Blender looks for a file without a view's suffix when it has saved.
    with contextlib.suppress(RuntimeError):
        bpy.data.images["Render Result"].save_render(str(folder / "result.exr"), scene=scene)
    found = {}
    for path in sorted(folder.glob("result*.exr")):
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: channel for part in file.parts for name, channel in part.channels.items()}
        for layer in scene_layers(channels):
            reds = [name for name in channels if name.startswith(f"{layer}.Combined") and name.endswith("R")]
            found.setdefault(layer, []).append(round(float(channels[reds[0]].pixels.mean()), 2))
    return found


def scene_layers(channels):
    return sorted({name.partition(".")[0] for name in channels} - {"Composite"})


@pytest.mark.parametrize(
    ("change", "gone", "named"),
    [
        (lambda layers: setattr(layers["Front"], "name", "Fore"), [], ["Back", "Fore"]),
        (lambda layers: layers.remove(layers["Back"]), ["Back"], ["Back", "Front"]),
    ],
    ids=["renamed", "deleted"],
)
def test_view_layers_that_were_changed_since_and_no_camera(scene, tmp_path, change, gone, named):
    scene.view_layers[0].name = "Front"
    scene.view_layers.new("Back")
    then = [layer.name for layer in scene.view_layers]
    eyes = {
        view: {name: {COLOUR_PASS: flat((value + shift, 0, 0))} for name, value in (("Front", 0.2), ("Back", 0.6))}
        for view, shift in (("left", 0.0), ("right", 0.1))
    }
    change(scene.view_layers)
    bpy.data.objects.remove(scene.camera)
    now, cameras = [layer.name for layer in scene.view_layers], len(bpy.data.cameras)
    assert deliver_to_result(scene, eyes, layers_then=then) == gone
    assert [layer.name for layer in scene.view_layers] == now
    assert (scene.camera, len(bpy.data.cameras)) == (None, cameras)
    found = layers_of_result(scene, tmp_path)
    assert found == {name: [0.6, 0.7] if name == "Back" else [0.2, 0.3] for name in named}


@pytest.mark.parametrize(
    ("then", "now", "names"),
    [
        (["A", "B"], ["A", "C"], {"A": "A", "B": "C"}),
        (["A", "B"], ["A"], {"A": "A", "B": "B"}),
        (["A", "B"], ["B", "C"], {"A": "A", "B": "B"}),
        (["A", "B"], ["B", "A"], {"A": "A", "B": "B"}),
    ],
    ids=["renamed", "deleted", "deleted and another made", "moved"],
)
def test_which_view_layer_is_which(then, now, names):
    assert new_names(then, then, now) == names


def test_cryptomattes_are_those_of_a_renamed_view_layer():
    texts = {"cryptomatte/1234567/name": "A.CryptoObject", "cryptomatte/1234567/hash": "A.CryptoObject"}
    assert renamed_metadata(texts, {"A": "B"}) == {**texts, "cryptomatte/1234567/name": "B.CryptoObject"}


DELIVERING = """
import sys
from pathlib import Path
import bpy
import numpy as np
from stereo_reproject.blender.output.delivery import deliver_side_by_side

camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
bpy.context.scene.camera = camera
grey = np.full((8, 12, 4), 0.5, np.float32)
deliver_side_by_side(bpy.context.scene, {"left": grey, "right": grey}, Path(sys.argv[1]))
"""


def test_a_process_that_delivered_comes_to_its_end(tmp_path):
    path = tmp_path / "stereo.png"
    finished = subprocess.run(
        [sys.executable, "-c", DELIVERING, path],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        timeout=SECONDS,
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    assert path.exists()


def test_settings_of_an_old_file_are_copied_though_one_is_a_choice_that_is_gone(shared_scenes):
    """Its Sequencer Preview Shading, which Blender reads as no choice and does not take back."""
    scene = open_blend(shared_scenes / "bmw27" / "bmw27.blend")
    assert scene.render.sequencer_gl_preview == "", "or nothing is shown here"
    other = bpy.data.scenes.new("other")
    copy_settings(scene, other)
    assert other.render.resolution_x == scene.render.resolution_x
    assert other.view_settings.view_transform == scene.view_settings.view_transform
