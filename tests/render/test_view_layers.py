"""All view layers of a scene: each a pair of its own, put together by the scene's compositor as after multiview."""

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.api import render_animation
from stereo_reproject.blender.commands.frame import render_files, render_pair
from stereo_reproject.blender.output.delivery import deliver_composited
from stereo_reproject.blender.output.pictures import read_png
from stereo_reproject.images.exr import _read_parts, read_eye, read_metadata
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.report.as_json import ABSENT
from stereo_reproject.report.table import format_report_table
from stereo_reproject.settings.frame import StereoSettings
from tests.blender.scene.test_compositor import add_file_output, over
from tests.blender.snapshot import everything
from tests.blender.toolbox import (
    add_camera,
    add_compositor,
    add_plane,
    add_sphere,
    add_sun,
    diffuse,
    empty_scene,
    noise_image,
    render_plain_layers,
    rms,
    set_background,
)

WIDTH, HEIGHT, SAMPLES = 128, 72, 16
AS_GOOD = 1.25
"""rms(ours - a) / rms(b - a), of some thousand pixels."""

ROUNDING = 1.01 / 255.0


@pytest.fixture
def scene(tmp_path):
    """A ball before a wall. In the second layer both are of clay, with fewer samples and under another sky; in the
    third the wall only lights the ball."""
    scene = empty_scene(WIDTH, HEIGHT, samples=SAMPLES)
    scene.cycles.sampling_pattern = "TABULATED_SOBOL"
    scene.view_layers[0].name = "Beauty"
    wall = add_plane(scene, diffuse("wall", image=noise_image(tmp_path, size=8)), size=(30, 20), location=(0, 0, -8))
    ball = add_sphere(scene, diffuse("paint", colour=(0.9, 0.3, 0.1)), radius=1.0, location=(0.2, 0.1, -5))
    for name, item in (("Wall", wall), ("Ball", ball)):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        for owner in item.users_collection:
            owner.objects.unlink(item)
        collection.objects.link(item)
    clay = scene.view_layers.new("Clay v1.0")
    clay.material_override, clay.samples = diffuse("clay", colour=(0.4, 0.5, 0.9)).block, 4
    clay.world_override = bpy.data.worlds.new("Clay sky")
    clay.use_pass_normal = clay.use_pass_cryptomatte_object = True
    lit = scene.view_layers.new("Lit")
    lit.layer_collection.children["Wall"].indirect_only = True
    scene.view_layers.new("Off").use = False
    set_background(scene, 0.4)
    add_sun(scene, strength=2.0)
    add_camera(scene)
    scene.render.film_transparent = True
    scene.render.dither_intensity = 0.0
    for name in ("Clay v1.0", "Lit"):
        scene.view_layers[name].use_pass_z = True
    return scene


LAYERS = ["Beauty", "Clay v1.0", "Lit"]


def exr_channels(path):
    return {
        (part.header.get("view"), name): channel.pixels
        for part in _read_parts(path)
        for name, channel in part.channels.items()
    }


def add_tree(scene, folder):
    """Lit over clay, and clay's mattes in a file."""
    tree, clay, result = add_compositor(scene)
    clay.layer = "Clay v1.0"
    lit = tree.nodes.new("CompositorNodeRLayers")
    lit.scene, lit.layer = scene, "Lit"
    tree.links.new(over(tree, clay.outputs["Image"], lit.outputs["Image"]), result)
    add_file_output(tree, folder, [clay.outputs["Normal"], lit.outputs["Image"]])


def test_each_layer_is_as_good_as_two_renders(scene, tmp_path):
    before = everything()
    pair, _ = render_pair(scene, StereoSettings(fill="packed"), tmp_path)
    assert everything() == before
    assert (list(pair.frames), pair.main) == (LAYERS, "Beauty")
    plain = render_plain_layers(scene, tmp_path)
    a, b = (render_plain_layers(scene, tmp_path, seed=seed) for seed in (101, 102))
    assert_same_sources(pair, plain)
    for layer in LAYERS:
        ours, one, other = (eyes["right"][layer][COLOUR_PASS] for eyes in (pair.eyes, a, b))
        assert rms(ours - one) < AS_GOOD * rms(other - one), layer
        assert rms(other - one) > 0.0
    pictures = [pair.eyes["right"][layer][COLOUR_PASS] for layer in LAYERS]
    assert min(rms(pictures[i] - pictures[j]) for i, j in ((0, 1), (0, 2), (1, 2))) > 0.05


def assert_same_sources(pair, plain):
    for layer in LAYERS:
        for name, image in plain["left"][layer].items():
            np.testing.assert_array_equal(pair.eyes["left"][layer][name], image, err_msg=f"{layer} {name}")


def test_what_a_layer_cuts_out_is_cut_out(scene, tmp_path):
    scene.view_layers["Clay v1.0"].layer_collection.children["Ball"].holdout = True
    pair, _ = render_pair(scene, StereoSettings(fill="packed"), tmp_path)
    assert_same_sources(pair, render_plain_layers(scene, tmp_path))
    assert 0.02 < np.mean(pair.eyes["right"]["Clay v1.0"][COLOUR_PASS][..., 3] == 0.0) < 0.3


def test_the_files_have_all_layers_and_the_picture_the_compositor(scene, tmp_path):
    add_tree(scene, tmp_path / "nodes")
    work = tmp_path / "work"
    work.mkdir()
    before = everything()
    report, _ = render_files(scene, StereoSettings(fill="packed", compare=True), work)
    assert everything() == before
    assert report["warnings"] == []
    out = work / "out"
    eyes = {view: read_eye(out / f"{view}.exr") for view in ("left", "right")}
    assert [list(layers) for layers in eyes.values()] == [LAYERS, LAYERS]
    assert "CryptoObject00" in eyes["right"]["Clay v1.0"]
    metadata = read_metadata(out / "left.exr")
    assert "Clay v1.0.CryptoObject" in metadata.values()
    assert not [text for text in metadata.values() if text.startswith("Beauty")]
    nodes = {path.name: read_png(path) for path in (tmp_path / "nodes").iterdir()}
    assert len(nodes) == 4
    deliver_composited(scene, eyes, tmp_path / "again.png", metadata=metadata)
    np.testing.assert_allclose(read_png(out / "stereo.png"), read_png(tmp_path / "again.png"), atol=ROUNDING)
    for name, picture in nodes.items():
        np.testing.assert_allclose(read_png(tmp_path / "nodes" / name), picture, atol=ROUNDING)
    rows = report["layers"]
    assert [row["name"] for row in rows] == LAYERS
    assert report["seconds"]["total"] == pytest.approx(sum(row["seconds"] for row in rows))
    assert report["fractions"]["rerendered"] == rows[0]["rerendered"]
    assert report["compare"]["speedup"] == pytest.approx(
        report["compare"]["multiview_seconds"] / report["seconds"]["total"]
    )
    assert all(f"  {name}" in format_report_table(report) for name in LAYERS)


def graded(scene):
    view = scene.view_settings
    view.view_transform, view.look, view.exposure, view.gamma = "Filmic", "High Contrast", 0.7, 1.2
    view.use_curve_mapping = True
    view.curve_mapping.curves[3].points.new(0.3, 0.7)
    view.curve_mapping.update()


def overridden(scene):
    scene.render.image_settings.color_management = "OVERRIDE"
    scene.render.image_settings.view_settings.exposure = 4.0


def composited(scene):
    tree, layers, result = add_compositor(scene)
    exposure = tree.nodes.new("CompositorNodeExposure")
    exposure.inputs["Exposure"].default_value = -2.0
    tree.links.new(layers.outputs["Image"], exposure.inputs["Image"])
    tree.links.new(exposure.outputs["Image"], result)


LINEAR = ("left.exr", "right.exr", "stereo.exr")


def files_of(scene, folder):
    folder.mkdir()
    render_files(scene, StereoSettings(fill="packed", accuracy="draft"), folder, files=(*LINEAR, "stereo.png"))
    linear = {name: exr_channels(folder / "out" / name) for name in LINEAR}
    return linear, read_png(folder / "out" / "stereo.png")


@pytest.mark.parametrize(("change", "shows"), [(graded, True), (composited, True), (overridden, False)])
def test_linear_files_know_nothing_of_display(scene, tmp_path, change, shows):
    for layer in scene.view_layers:
        layer.use = layer.name == "Beauty"
    linear, picture = files_of(scene, tmp_path / "before")
    change(scene)
    again, other = files_of(scene, tmp_path / "after")
    for name, channels in linear.items():
        assert set(again[name]) == set(channels)
        for channel, values in channels.items():
            np.testing.assert_array_equal(again[name][channel], values, err_msg=f"{name} {channel}")
    assert (np.abs(other - picture).mean() > 0.02) == shows


def test_multiview_is_compared_with_all_its_layers(scene, tmp_path):
    """What a layer costs is in the peer's seconds too."""
    from stereo_reproject.blender.commands.compare import render_reference

    scene.view_layers["Lit"].samples = 64 * SAMPLES
    alone, all_of_them = (
        render_reference(scene, StereoSettings(), tmp_path, layers=layers) for layers in (None, LAYERS)
    )
    assert all_of_them.seconds > 4.0 * alone.seconds
    # With several layers Blender gives the second view another seed.
    assert rms(all_of_them.reference - alone.reference) < AS_GOOD * rms(alone.again - alone.reference)


def test_one_layer_is_told_as_ever(scene, tmp_path):
    for layer in scene.view_layers:
        layer.use = layer.name == "Lit"
    pair, report = render_pair(scene, StereoSettings(fill="packed", accuracy="draft"), tmp_path)
    assert list(pair.frames) == ["Lit"]
    assert report.layers is ABSENT


def test_a_movies_frames_wait_with_all_their_layers(scene, tmp_path):
    add_tree(scene, tmp_path / "nodes")
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    settings.views_format = "STEREO_3D"
    settings.stereo_3d_format.display_mode = "SIDEBYSIDE"
    scene.render.ffmpeg.format = "MKV"
    scene.render.filepath = str(tmp_path / "film" / "shot_")
    scene.frame_start, scene.frame_end = 1, 2
    before = everything()
    report = render_animation(StereoSettings(fill="packed", accuracy="draft"), scene=scene)
    assert everything() == before
    assert [[row["name"] for row in frame["layers"]] for frame in report["frames"]] == [LAYERS, LAYERS]
    assert len([path for path in (tmp_path / "film").iterdir() if "_animation." not in path.name]) == 1
    written = {path.name: read_png(path) for path in (tmp_path / "nodes").iterdir()}
    assert len(written) == 8
    assert min(picture.std() for picture in written.values()) > 0.05
