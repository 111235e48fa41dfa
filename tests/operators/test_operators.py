"""The extension in Blender: registered, run from a script, and gone again without a trace."""

import contextlib
import re

import bpy
import numpy as np
import OpenEXR
import pytest

from tests.blender.snapshot import everything
from tests.blender.toolbox import (
    add_camera,
    add_compositor,
    add_plane,
    add_sun,
    diffuse,
    emission,
    empty_scene,
    noise_image,
    render_plain,
)

SIZE = (64, 36)

OLD = bpy.app.version < (5, 0)


@pytest.fixture
def scene(tmp_path):
    scene = empty_scene(*SIZE, samples=4)
    add_plane(scene, diffuse(image=noise_image(tmp_path)), size=(30, 20), location=(0, 0, -8), rotation=(-0.5, 0, 0))
    add_plane(scene, diffuse(colour=(0.8, 0.2, 0.1)), size=(1, 2), location=(0.3, 0.2, -4))
    add_sun(scene, strength=1.5)
    add_camera(scene)
    return scene


def views_of_result(scene, folder):
    """The scene's Render Result as Blender saves it: each view's picture, by what its file's name ends with."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.views_format = "OPEN_EXR", "32", "INDIVIDUAL"
    scene.render.use_multiview = True
    # After a plain multiview render as well, Blender looks for a file without a view's suffix when it has saved.
    with contextlib.suppress(RuntimeError):
        bpy.data.images["Render Result"].save_render(str(folder / "result.exr"), scene=scene)
    found = {}
    for path in sorted(folder.glob("result*.exr")):
        with OpenEXR.File(str(path)) as file:
            found[path.stem.removeprefix("result")] = next(iter(file.channels().values())).pixels
    return found


def test_registers_and_goes_without_a_trace_twice(package):
    for _ in range(2):
        package.register()
        assert hasattr(bpy.types, "RENDER_PT_stereo_reproject")
        assert "stereo_reproject_image" in dir(bpy.ops.render)
        package.unregister()
        assert not hasattr(bpy.types.Scene, "stereo_reproject")
        assert not hasattr(bpy.types, "RENDER_PT_stereo_reproject")
        assert "stereo_reproject_image" not in dir(bpy.ops.render)


def test_the_pair_is_the_render_result_and_the_scene_as_it_was(extension, scene, tmp_path):
    before = everything()
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert everything() == before
    views = views_of_result(scene, tmp_path)
    assert sorted(views) == ["_L", "_R"]
    left, right = views["_L"], views["_R"]
    plain = render_plain(scene, tmp_path)
    np.testing.assert_array_equal(left[..., :3], plain["left"]["Combined"][..., :3])
    difference = np.abs(right[..., :3] - plain["right"]["Combined"][..., :3]).mean()
    assert 0.0 < difference < 0.5 * np.abs(right[..., :3] - left[..., :3]).mean()


@pytest.mark.parametrize(
    ("size", "percentage", "rendered"),
    [
        # The longer side has 480 pixels at least, or those of the full picture.
        ((1920, 1080), 25, (480, 270)),
        ((1920, 1080), 50, (960, 540)),
        ((1000, 500), 25, (480, 240)),
        ((500, 1000), 25, (240, 480)),
        ((64, 36), 25, (64, 36)),
    ],
)
def test_a_preview_is_small_and_large_enough_to_look_at(extension, scene, size, percentage, rendered):
    from stereo_reproject_extension.operators.render import settings_of

    scene.render.resolution_x, scene.render.resolution_y = size
    scene.stereo_reproject.preview_percentage = percentage
    assert settings_of(scene, preview=True).scene.size == rendered
    assert settings_of(scene, preview=False).scene.size is None


def test_a_preview_of_a_part_is_large_enough_to_look_at(extension, scene):
    from stereo_reproject_extension.operators.render import settings_of

    scene.render.resolution_x, scene.render.resolution_y, scene.render.use_border = 1920, 1080, True
    scene.render.border_min_x, scene.render.border_max_x = 0.0, 0.5
    assert settings_of(scene, preview=True).scene.size == (854, 480)
    scene.render.border_max_x = 0.125
    scene.render.border_min_y, scene.render.border_max_y = 0.0, 0.125
    assert settings_of(scene, preview=True).scene.size == (1920, 1080)


def test_a_preview_is_denoised_where_there_is_a_denoiser(extension, scene):
    from stereo_reproject_extension.operators import render

    assert not scene.cycles.use_denoising
    assert render.settings_of(scene, preview=True).scene.denoise
    assert render.settings_of(scene, preview=False).scene.denoise is None
    scene.stereo_reproject.source_engine = "eevee"
    assert render.settings_of(scene, preview=True).scene.denoise is None
    scene.stereo_reproject.source_engine, scene.render.engine = (
        "scene",
        "BLENDER_EEVEE_NEXT" if OLD else "BLENDER_EEVEE",
    )
    assert render.settings_of(scene, preview=True).scene.denoise is None
    scene.stereo_reproject.source_engine = "cycles"
    assert render.settings_of(scene, preview=True).scene.denoise


def test_a_preview_claims_no_gain_of_its_own_and_is_named(extension, scene, tmp_path):
    from stereo_reproject_extension.operators.drawing import verdicts_on
    from stereo_reproject_extension.operators.results import result_of

    scene.render.resolution_x, scene.render.resolution_y, scene.cycles.samples = 640, 360, 64
    scene.stereo_reproject.preview_samples = 2
    assert bpy.ops.render.stereo_reproject_image(preview=True) == {"FINISHED"}
    views = views_of_result(scene, tmp_path)
    assert {name: eye.shape[:2] for name, eye in views.items()} == dict.fromkeys(("_L", "_R"), (270, 480))
    result = result_of(scene)
    assert result.report["seconds"]["denoise_source"] > 0.0
    assert (result.delivery.frame, result.delivery.preview) == (scene.frame_current, True)
    assert verdicts_on(scene, result)[1].words.startswith("A full render is predicted to ")


def test_a_preview_of_a_panorama_predicts_the_gain_of_the_panorama(extension, scene):
    """And not of the camera's own picture, which is smaller than the preview here."""
    from stereo_reproject_extension.operators import prediction, results

    stages = {"plan": 0.0, "source": 10.0, "fill": 4.0, "total": 14.0}
    costs = {"render_call_seconds": 1.5, "resync_share": 0.25}
    report = {"size": [480, 480], "samples": 8, "seconds": stages, "predicted_speedup": 18.0 / 14.0}
    report |= {"fill": {"costs": costs}, "engine": "CYCLES"}
    result = results.result_of(scene)
    result.report, result.delivery = report, results.Delivery(None, 1, "12:00", preview=True)
    scene.stereo_reproject.headset, scene.stereo_reproject.headset_height = "vr180", 4096
    scene.cycles.samples = 8
    work = 4096**2 / 480**2
    assert prediction.full_gain_of(scene) == pytest.approx((2 + 16 * work) / (2 + 8 * work + 2 + 2 * work))
    scene.stereo_reproject.headset = "camera"
    assert prediction.full_gain_of(scene) < 1.05
    results.forget_all()


def test_a_result_is_known_by_its_slot_until_something_else_is_shown(extension, scene):
    from stereo_reproject_extension.operators.drawing import _is_shown, verdicts_on
    from stereo_reproject_extension.operators.results import result_of

    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    result = result_of(scene)
    assert re.search(r"saved|longer", verdicts_on(scene, result)[1].words)
    assert result.delivery.content.name == "Slot 1"
    assert _is_shown(bpy.context, result.delivery)
    slots = bpy.data.images["Render Result"].render_slots
    slots.active_index = 1
    assert not _is_shown(bpy.context, result.delivery)
    slots.active_index = 0
    assert _is_shown(bpy.context, result.delivery)
    bpy.ops.render.render()
    assert not _is_shown(bpy.context, result.delivery)
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert _is_shown(bpy.context, result_of(scene).delivery)


def test_each_button_has_a_tooltip_of_its_own(extension):
    from types import SimpleNamespace

    from stereo_reproject_extension.operators.render import RENDER_OT_stereo_reproject_image as image
    from stereo_reproject_extension.operators.stereo import STEREO_REPROJECT_OT_set_convergence as convergence

    preview, full = (image.description(None, SimpleNamespace(preview=preview)) for preview in (True, False))
    assert "small" in preview
    assert "both eyes" in full.lower()
    texts = {convergence.description(None, SimpleNamespace(target=target)) for target in ("OBJECT", "FOCUS")}
    assert len(texts) == 2


class Drawn:
    """A layout that notes what is drawn into it, in order; it stands for the parts of itself too."""

    def __init__(self):
        self.items = []

    def __getattr__(self, name):
        def note(*given, **named):
            self.items.append((name, *given[1:], named.get("text", "")) if name == "prop" else (name, *given, named))
            return self

        return note


def test_the_buttons_come_first_and_prose_does_not_stand_there(extension, scene):
    from types import SimpleNamespace

    from stereo_reproject_extension.operators import panels

    drawn = Drawn()
    context = SimpleNamespace(scene=scene, region=None, space_data=None, preferences=bpy.context.preferences)
    panels._Main.draw(SimpleNamespace(layout=drawn), context)
    commands = [item[1] for item in drawn.items if item[0] in ("operator", "prop")]
    render = "render.stereo_reproject"
    assert commands == [f"{render}_image", f"{render}_image", f"{render}_animation", "accuracy", "source"]
    assert [item for item in drawn.items if item[0] == "label"] == []


@pytest.mark.parametrize(
    ("size", "percentage", "said"),
    [
        ((96, 54), 100, "96 x 54 pixels for each eye."),
        ((96, 54), 25, "96 x 54 pixels for each eye, as many as the whole picture has."),
        ((1600, 900), 25, "480 x 270 pixels for each eye, the least that the preferences allow."),
        ((1600, 900), 50, "800 x 450 pixels for each eye."),
    ],
)
def test_the_preview_s_panel_tells_its_pixels(extension, scene, size, percentage, said):
    from types import SimpleNamespace

    from stereo_reproject_extension.operators import panels

    scene.stereo_reproject.preview_percentage = percentage
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *size, 100
    drawn = Drawn()
    context = SimpleNamespace(scene=scene, region=None, preferences=bpy.context.preferences)
    panels._Preview.draw(SimpleNamespace(layout=drawn), context)
    texts = [item[-1]["text"] for item in drawn.items if item[0] == "label"]
    assert said in " ".join(texts)


@pytest.mark.parametrize(("full", "said"), [(8, "8 samples, as many as the whole picture has."), (64, None)])
@pytest.mark.parametrize("engine", ["cycles", "eevee"])
def test_a_preview_takes_no_more_samples_than_the_scene_and_its_panel_says_so(extension, scene, engine, full, said):
    from stereo_reproject_extension.operators import render

    scene.cycles.samples = scene.eevee.taa_render_samples = full
    scene.stereo_reproject.source_engine, scene.stereo_reproject.preview_samples = engine, 16
    assert render.settings_of(scene, preview=True).scene.samples == min(full, 16)
    assert render.settings_of(scene, preview=False).scene.samples is None
    assert render.fewer_samples_words(scene) == said


def test_what_is_seldom_set_is_in_closed_panels(extension):
    closed = {"details", "engine", "layout", "preview", "advanced"}
    for prefix in ("RENDER", "VIEW3D"):
        for name in closed:
            assert "DEFAULT_CLOSED" in getattr(bpy.types, f"{prefix}_PT_stereo_reproject_{name}").bl_options
    assert "DEFAULT_CLOSED" in bpy.types.IMAGE_PT_stereo_reproject_details.bl_options


def test_settings_are_named_for_artists(extension):
    properties = bpy.context.scene.stereo_reproject.bl_rna.properties
    names = {name: properties[name].name for name in ("source", "fill")}
    assert names == {"source": "Rendered Eye", "fill": "Hole Rendering"}
    assert properties["accuracy"].enum_items["draft"].name == "Fast"


def test_the_scene_that_is_looked_at_is_rendered(extension, scene, tmp_path):
    other = bpy.data.scenes.new("Other")
    everything()  # a new scene's layers are not there before they are asked for
    before = everything()
    with bpy.context.temp_override(scene=other), pytest.raises(RuntimeError, match="has no camera"):
        bpy.ops.render.stereo_reproject_image()
    assert everything() == before
    with bpy.context.temp_override(scene=scene):
        assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    bpy.data.scenes.remove(other)


def mirror_ball(scene):
    scene.camera.data.type, scene.camera.data.panorama_type = "PANO", "MIRRORBALL"


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda scene: setattr(scene, "camera", None), "has no camera"),
        (mirror_ball, "panoramic mirror ball"),
        (lambda scene: setattr(scene.render, "engine", "BLENDER_WORKBENCH"), "set Cycles or EEVEE"),
        (lambda scene: setattr(scene.view_layers[0], "use", False), "view layer"),
        (lambda scene: setattr(scene.render, "resolution_percentage", 1), "pixels are to be rendered"),
    ],
    ids=["no camera", "mirror ball", "workbench", "no view layer", "tiny"],
)
def test_what_cannot_be_rendered_is_said_and_changes_nothing(extension, scene, spoil, message):
    spoil(scene)
    before = everything()
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.render.stereo_reproject_image()
    assert everything() == before
    assert bpy.ops.render.stereo_reproject_image.poll()


def test_a_linked_scene_is_rendered(extension, scene, tmp_path):
    scene.name = "Twin"
    library = tmp_path / "library.blend"
    bpy.data.libraries.write(str(library), {scene}, path_remap="ABSOLUTE")
    # The one of this file has the same name, and shows nothing.
    for item in list(scene.collection.objects):
        if item.type == "MESH":
            bpy.data.objects.remove(item)
    with bpy.data.libraries.load(str(library), link=True) as (_, linked):
        linked.scenes = ["Twin"]
    (linked,) = linked.scenes
    before = everything()
    with bpy.context.temp_override(scene=linked):
        assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert everything() == before
    assert views_of_result(linked, tmp_path)["_L"][..., :3].max() > 0.1


def test_the_camera_of_a_marker_is_enough(extension, scene):
    marker = scene.timeline_markers.new("cut", frame=scene.frame_current)
    marker.camera, scene.camera = scene.camera, None
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}


def test_a_saved_file_is_not_marked_as_changed(extension, scene, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    was_dirty = bpy.data.is_dirty  # 4.5 as a Python module says so of every file
    assert not (was_dirty and bpy.app.version >= (5, 0))
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert bpy.ops.stereo_reproject.check_scene() == {"FINISHED"}
    assert bpy.data.is_dirty == was_dirty


def test_a_simulation_that_is_baked_beside_the_file_is_rendered_as_baked(extension, scene, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=6, y_subdivisions=6, size=1.5, location=(-0.5, 0.6, -3.5))
    cloth = bpy.context.object.modifiers.new("Cloth", "CLOTH")
    cloth.point_cache.frame_end, cloth.point_cache.use_disk_cache = 8, True
    with bpy.context.temp_override(scene=scene, point_cache=cloth.point_cache):
        bpy.ops.ptcache.bake(bake=True)
    bpy.ops.wm.save_mainfile()
    scene.frame_set(8)
    assert list((tmp_path / "blendcache_saved").iterdir())
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    left = views_of_result(scene, tmp_path)["_L"]
    np.testing.assert_array_equal(left[..., :3], render_plain(scene, tmp_path)["left"]["Combined"][..., :3])
    assert list((tmp_path / "blendcache_saved").iterdir())


def test_a_simulation_that_is_not_baked_is_said(extension, scene, capfd):
    bpy.ops.mesh.primitive_grid_add(size=1.5, location=(-0.5, 0.6, -3.5))
    bpy.context.object.modifiers.new("Cloth", "CLOTH")
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert "simulation is not baked, 'Cloth' on 'Grid'" in capfd.readouterr().out


def test_every_view_layer_reaches_the_compositor(extension, scene, tmp_path):
    second = scene.view_layers.new("Second")
    second.material_override = emission("glow", strength=0.75).block
    tree, layers, result = add_compositor(scene)
    layers.layer = "Second"
    tree.links.new(layers.outputs["Image"], result)
    before = everything()
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert everything() == before
    views = views_of_result(scene, tmp_path)
    assert set(views) == {"_L", "_R"}
    for picture in views.values():
        assert np.median(picture[..., 0]) == pytest.approx(0.75)


def test_a_compositor_that_shows_what_is_not_rendered_is_left_out_with_a_word(extension, scene, tmp_path, capfd):
    tree, layers, result = add_compositor(scene)
    exposure = tree.nodes.new("CompositorNodeExposure")
    layers.scene = bpy.data.scenes.new("Second")
    tree.links.new(layers.outputs["Image"], exposure.inputs["Image"])
    tree.links.new(exposure.outputs["Image"], result)
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert "shows the scene 'Second'" in capfd.readouterr().out
    assert views_of_result(scene, tmp_path)["_L"][..., :3].max() > 0.1


@pytest.mark.parametrize("camera", ["osl", "portal"])
def test_the_packed_camera_of_the_panel_traces_the_pair(extension, scene, camera):
    from stereo_reproject_extension.operators.render import settings_of
    from stereo_reproject_extension.operators.results import result_of

    scene.stereo_reproject.fill, scene.stereo_reproject.packed_by = "packed", camera
    assert [settings_of(scene, preview=preview).packed_by for preview in (False, True)] == [camera, camera]
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert result_of(scene).report["fill"]["camera"] == camera


@pytest.mark.parametrize(
    ("device", "kind", "camera", "words"),
    [
        ("CPU", "NONE", "auto", None),
        ("GPU", "CUDA", "auto", None),
        ("GPU", "HIP", "portal", None),
        ("GPU", "HIP", "osl", "device"),
    ],
)
def test_what_cannot_fill_holes_on_a_device_is_said_and_why(extension, scene, device, kind, camera, words):
    from stereo_reproject_extension.operators.panels import obstacle
    from stereo_reproject_extension.stereo_reproject.blender.scene.devices import devices_in_use, use_devices

    kept = devices_in_use()
    try:
        use_devices({"type": kind, "ids": [], "options": {}})
        assert devices_in_use()["type"] == kind
        scene.cycles.device, scene.stereo_reproject.packed_by = device, camera
        found = obstacle(scene)
        assert found is None if words is None else words in found
    finally:
        use_devices(kept)
    assert devices_in_use() == kept


def test_a_missing_texture_is_said(extension, scene, tmp_path, capfd):
    image = next(image for image in bpy.data.images if image.filepath)
    image.filepath = str(tmp_path / "gone.png")
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert "file missing for" in capfd.readouterr().out


def test_a_changed_file_is_rendered_as_it_is_now(extension, scene, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    scene = bpy.context.scene
    for item in list(scene.collection.objects):
        if item.type == "MESH":
            bpy.data.objects.remove(item)
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert views_of_result(scene, tmp_path)["_L"][..., :3].max() == 0.0
    assert bpy.data.filepath == str(tmp_path / "saved.blend")


def test_the_pictures_are_images_when_they_are_asked_for(extension, scene):
    from stereo_reproject_extension.operators.pictures import load_picture
    from stereo_reproject_extension.operators.results import OF_PANORAMAS, PICTURES

    assert load_picture(scene, "HOLES") is None
    scene.stereo_reproject.compare = True
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert load_picture(scene, OF_PANORAMAS) is None
    for which, (_, name, _) in PICTURES.items():
        if which == OF_PANORAMAS:
            continue
        image = load_picture(scene, which)
        assert (image.name, image.packed_file is not None) == (f"Stereo {name}", True)
        assert min(image.size) >= min(SIZE)
    load_picture(scene, "GRID")
    assert sorted(image.name for image in bpy.data.images if image.name.startswith("Stereo")) == [
        "Stereo Difference",
        "Stereo Grid",
        "Stereo Rendered Again",
        "Stereo Uncertain Areas",
    ]


@pytest.mark.parametrize(
    ("accuracy", "more", "complete", "words"),
    [
        ("full", None, True, "It cannot be better: all of it was rendered"),
        ("full", 0.0, True, "Rendering both eyes would take less than 0.1 s more"),
        ("high", 2.04, False, "Accuracy High would take at least 2.0 s more"),
    ],
)
def test_what_is_better_has_its_price(extension, accuracy, more, complete, words):
    from stereo_reproject_extension.operators.details import price_words

    assert price_words({"accuracy": accuracy, "more_seconds": more, "complete": complete}) == words


def test_a_check_says_what_is_to_be_gained(extension, scene):
    from stereo_reproject_extension.operators.prediction import is_current
    from stereo_reproject_extension.operators.results import result_of
    from stereo_reproject_extension.operators.stereo import is_comfortable, parallax_now

    before = everything()
    assert bpy.ops.stereo_reproject.check_scene() == {"FINISHED"}
    assert everything() == before
    assert result_of(scene).inspection["predicted"]["gain"]["high"] > 0.0
    assert is_current(scene, result_of(scene).inspection)
    scene.cycles.samples += 1
    assert not is_current(scene, result_of(scene).inspection)
    (_, near), (_, far) = parallax_now(scene)
    assert near.pixels < 0.0 < far.pixels
    assert near.depth == pytest.approx(4.0, rel=1e-3)
    # A cinema's screen makes the same picture's parallax wider than a viewer's eyes.
    scene.stereo_reproject.screen_width = 0.1
    assert is_comfortable(scene, far)
    scene.stereo_reproject.screen_width = 20.0
    assert not is_comfortable(scene, far)


def test_a_check_says_where_there_is_nothing_to_be_gained(extension, scene):
    from stereo_reproject_extension.operators.prediction import gain_words
    from stereo_reproject_extension.operators.results import result_of

    scene.stereo_reproject.source_engine = "eevee"
    assert bpy.ops.stereo_reproject.check_scene() == {"FINISHED"}
    words = gain_words(result_of(scene).inspection["predicted"])
    assert words == "Predicted: 1.0 to 2.0 times as fast as multiview"


def test_what_a_closed_file_has_left_is_forgotten(extension, scene, tmp_path):
    from stereo_reproject_extension.operators.results import _by_scene, result_of

    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    folder = result_of(scene).run.folder
    bpy.ops.wm.read_homefile(use_empty=True)
    other = empty_scene(*SIZE, samples=1)
    add_camera(other)
    add_plane(other, diffuse(), size=(30, 20), location=(0, 0, -8))
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert (list(_by_scene), folder.exists()) == ([other.session_uid], False)


def test_convergence_is_set_to_an_object_and_to_the_focus(extension, scene):
    stereo = scene.camera.data.stereo
    bpy.context.view_layer.objects.active = next(item for item in scene.objects if item.location.z == -4.0)
    bpy.ops.stereo_reproject.set_convergence(target="OBJECT")
    assert stereo.convergence_distance == pytest.approx(4.0)
    scene.camera.data.dof.focus_distance = 7.5
    bpy.ops.stereo_reproject.set_convergence(target="FOCUS")
    assert stereo.convergence_distance == pytest.approx(7.5)
    bpy.context.view_layer.objects.active = scene.camera
    with pytest.raises(RuntimeError, match="camera itself is active"):
        bpy.ops.stereo_reproject.set_convergence(target="OBJECT")
    assert stereo.convergence_distance == pytest.approx(7.5)
