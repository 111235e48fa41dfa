"""The extension in Blender: registered, run from a script, and gone again without a trace."""

import contextlib
import importlib.util
import sys
import warnings
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
import pytest

from tests.blender.toolbox import add_camera, add_plane, add_sun, diffuse, empty_scene, noise_image, render_plain

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "stereo_reproject_extension"
SIZE = (64, 36)


@pytest.fixture(scope="module")
def package():
    """The extension's root as the package that Blender makes of it."""
    spec = importlib.util.spec_from_file_location(PACKAGE, ROOT / "__init__.py", submodule_search_locations=[str(ROOT)])
    module = importlib.util.module_from_spec(spec)
    sys.modules[PACKAGE] = module
    spec.loader.exec_module(module)
    yield module
    for name in [name for name in sys.modules if name.partition(".")[0] == PACKAGE]:
        del sys.modules[name]


@pytest.fixture
def extension(package):
    package.register()
    yield package
    package.unregister()


@pytest.fixture
def scene(tmp_path):
    scene = empty_scene(*SIZE, samples=4)
    add_plane(scene, diffuse(image=noise_image(tmp_path)), size=(30, 20), location=(0, 0, -8), rotation=(-0.5, 0, 0))
    add_plane(scene, diffuse(colour=(0.8, 0.2, 0.1)), size=(1, 2), location=(0.3, 0.2, -4))
    add_sun(scene, strength=1.5)
    add_camera(scene)
    bpy.context.window_manager.windows[0].scene = scene if bpy.context.window_manager.windows else None
    return scene


def values_of(block, depth=3):
    """All that RNA tells of a datablock, and of what belongs to it."""
    found = {}
    for prop in getattr(block, "bl_rna", block.rna_type).properties:
        name = prop.identifier
        if name in ("rna_type", "original", "depsgraph", "bl_rna") or prop.type == "COLLECTION":
            continue
        value = getattr(block, name)
        if prop.type != "POINTER":
            found[name] = tuple(value) if getattr(prop, "is_array", False) else value
        elif value is None or isinstance(value, bpy.types.ID):
            found[name] = None if value is None else value.name
        elif depth and hasattr(value, "bl_rna"):
            found[name] = values_of(value, depth - 1)
    return found


def everything():
    """All scenes, cameras and objects by value, with what a scene keeps in lists, and the names of all other blocks."""
    found = {}
    with warnings.catch_warnings():
        # Some of what is read is on its way out of Blender.
        warnings.simplefilter("ignore")
        for prop in bpy.data.bl_rna.properties:
            if prop.type == "COLLECTION":
                for block in getattr(bpy.data, prop.identifier):
                    by_value = isinstance(block, bpy.types.Scene | bpy.types.Camera | bpy.types.Object)
                    found[prop.identifier, block.name] = values_of(block) if by_value else None
        for scene in bpy.data.scenes:
            for owner, name in ((scene, "view_layers"), (scene.render, "views"), (scene, "timeline_markers")):
                for item in getattr(owner, name):
                    found[scene.name, name, item.name] = values_of(item, 1)
    for kind in ("images", "all_ids"):
        found.pop((kind, "Render Result"), None)
    return found


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


def test_a_preview_is_small(extension, scene, tmp_path):
    scene.stereo_reproject.preview_percentage = 50
    assert bpy.ops.render.stereo_reproject_image(preview=True) == {"FINISHED"}
    views = views_of_result(scene, tmp_path)
    assert {name: eye.shape[:2] for name, eye in views.items()} == dict.fromkeys(
        ("_L", "_R"), (SIZE[1] // 2, SIZE[0] // 2)
    )


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


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda scene: setattr(scene, "camera", None), "has no camera"),
        (lambda scene: setattr(scene.camera.data, "type", "PANO"), "panoramic"),
        (lambda scene: setattr(scene.render, "engine", "BLENDER_WORKBENCH"), "set Cycles or EEVEE"),
        (lambda scene: setattr(scene.view_layers[0], "use", False), "view layer"),
        (lambda scene: setattr(scene.render, "resolution_percentage", 1), "pixels are to be rendered"),
    ],
    ids=["no camera", "panorama", "workbench", "no view layer", "tiny"],
)
def test_what_cannot_be_rendered_is_said_and_changes_nothing(extension, scene, spoil, message):
    spoil(scene)
    before = everything()
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.render.stereo_reproject_image()
    assert everything() == before
    assert bpy.ops.render.stereo_reproject_image.poll()


@pytest.mark.parametrize("stage", ["start", "load", "source", "fill", "write"])
def test_a_run_is_cancelled_at_any_stage_and_leaves_nothing(extension, scene, stage):
    from stereo_reproject_extension.operators.render import PAIR_FILES, settings_of
    from stereo_reproject_extension.operators.run import Run
    from stereo_reproject_extension.stereo_reproject.progress import USUAL, Progress

    before = everything()
    progress = Progress(0.0, USUAL["render"])
    run = Run(scene, settings_of(scene, preview=False), "render", PAIR_FILES, progress)
    folder = run.folder.parent

    def cancel_there():
        if run.stage == stage:
            run.cancel()

    run.wait(cancel_there)
    if run.report is None:
        assert "interrupted" in str(run.error)
    run.close()
    assert not folder.exists()
    assert everything() == before
