"""The pass of effects: switched on only for what is called for, right on the pixels that show it, and gone after it."""

from pathlib import Path

import bpy
import numpy as np
import OpenEXR
import pytest

from stereo_reproject.blender.engines import render
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.rig import stereo_cameras
from stereo_reproject.blender.scene.working import open_blend, rendered_layer, working_scene
from stereo_reproject.images.effects import Effect
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS, EFFECTS_PASS, MATERIAL_PASS
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from tests.blender.toolbox import (
    Material,
    add_camera,
    add_plane,
    add_sphere,
    add_sun,
    diffuse,
    empty_scene,
    evaluated_camera,
    px_from_world,
    render_plain,
    save_image,
)
from tests.warp.pairs import reproject_pair

DEMO = Path(__file__).resolve().parents[2] / "demo" / "cornell-box" / "cornell-box.blend"

CENTRE, RADIUS = (0.3, 0.2, -6.0), 1.2

EDGE = 2
"""Pixels along the ball's outline that may show either: the pixel filter's reach, and that the ball is a polyhedron."""

NAME = 'mirror "one", {polished}'
"""As names may be: the manifest in the file does not escape them."""


@pytest.fixture
def scene():
    """A matte wall, and before it a mirror ball."""
    scene = empty_scene(128, 72, samples=4)
    add_plane(scene, diffuse("wall"), size=(30, 20), location=(0, 0, -9))
    mirror = Material(NAME)
    add_sphere(scene, mirror.surface(mirror.node("BsdfGlossy")), radius=RADIUS, location=CENTRE)
    add_sun(scene)
    add_camera(scene)
    return scene


def render_source(scene, folder, **overrides):
    with working_scene(scene, SceneOverrides(**overrides)) as working:
        return BlenderRenderer(working, folder).render_source("left")[0]


def ball(camera, grown):
    """(H, W): the pixels that show the ball, grown or shrunk by pixels: its outline is taken for a circle."""
    rows, columns = np.indices((camera.height, camera.width))
    x, y, _ = px_from_world(camera, np.array(CENTRE))
    beside, _, _ = px_from_world(camera, np.array(CENTRE) + camera.world_from_camera[:3, 0] * RADIUS)
    radius = abs(beside - x) / np.sqrt(1.0 - (RADIUS / np.linalg.norm(CENTRE)) ** 2)
    distance = np.hypot(columns + 0.5 - x, rows + 0.5 - y)
    return distance < radius + grown


def flagged(image, effect):
    return (image[..., 0].astype(int) & effect.value) > 0


def test_flags_land_on_the_pixels_that_show_the_material(scene, tmp_path):
    effects = render_source(scene, tmp_path)[EFFECTS_PASS]
    assert effects.shape == (72, 128, 1)
    assert effects.dtype == np.float32
    assert set(np.unique(effects)) == {0.0, float(Effect.GLOSSY)}
    left = stereo_cameras(evaluated_camera(scene), scene.render)["left"]
    mirrored = flagged(effects, Effect.GLOSSY)
    assert mirrored[ball(left, -EDGE)].all()
    assert not mirrored[~ball(left, EDGE)].any()


def test_flags_are_warped_with_their_pixels(scene, tmp_path):
    source = render_source(scene, tmp_path)
    cameras = stereo_cameras(evaluated_camera(scene), scene.render)
    nothing = np.zeros(source[COLOUR_PASS].shape[:2], bool)
    warped = reproject_pair(source, cameras["left"], cameras["right"], accuracy=SETTINGS["balanced"], invalid=nothing)
    answered = warped.reasons == 0
    mirrored = flagged(warped.passes[EFFECTS_PASS], Effect.GLOSSY)
    assert set(np.unique(warped.passes[EFFECTS_PASS])) == {0.0, float(Effect.GLOSSY)}
    right = cameras["right"]
    assert mirrored[ball(right, -EDGE) & answered].all()
    assert not mirrored[~ball(right, EDGE) & answered].any()


def leaf(folder):
    """A card of which the left half is cut away by its alpha, and the right half is solid."""
    values = np.ones((4, 8, 4), np.float32)
    values[:, :4] = 0.0
    material = Material("leaf")
    shader = material.node("BsdfPrincipled", **{"Specular IOR Level": 0.0})
    colour = material.texture(save_image(folder / "leaf.png", values))
    colour.node.interpolation = "Closest"
    material.link(colour, shader.inputs["Alpha"])
    return material.surface(shader)


def test_what_covers_nothing_of_a_pixel_does_not_count(scene, tmp_path):
    add_plane(scene, leaf(tmp_path), size=(2.0, 1.0), location=(-2.0, 0.0, -6.0))
    alpha = flagged(render_source(scene, tmp_path)[EFFECTS_PASS], Effect.ALPHA)
    left = stereo_cameras(evaluated_camera(scene), scene.render)["left"]
    corners = np.array([(-3.0, 0.5, -6.0), (-2.0, -0.5, -6.0), (-1.0, -0.5, -6.0)])
    x, y, _ = px_from_world(left, corners)
    rows = slice(int(y[0]) + EDGE, int(y[1]) - EDGE)
    assert not alpha[rows, int(x[0]) + EDGE : int(x[1]) - EDGE].any()
    assert alpha[rows, int(x[1]) + EDGE : int(x[2]) - EDGE].all()
    assert not alpha[:, int(x[2]) + EDGE :].any()


@pytest.mark.parametrize("fill", ["full", "packed", "card"])
def test_ours_is_in_no_result_and_stays_on_while_there_are_renders(scene, tmp_path, fill):
    """Switched off between two renders, it has Blender 5.2.3 write where it must not."""
    depth = scene.view_layers[0].pass_cryptomatte_depth
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path)
        layer = rendered_layer(working)
        assert not layer.use_pass_cryptomatte_material
        for _ in range(2):
            assert set(renderer.render_source("left")[0]) == {COLOUR_PASS, DEPTH_PASS, EFFECTS_PASS, MATERIAL_PASS}
        frame = render_stereo_frame(renderer, StereoSettings(fill=fill))
        assert layer.use_pass_cryptomatte_material
    for eye in frame.eyes.values():
        assert set(eye) == {COLOUR_PASS, DEPTH_PASS}
    assert not scene.view_layers[0].use_pass_cryptomatte_material
    assert scene.view_layers[0].pass_cryptomatte_depth == depth


def test_the_user_s_own_cryptomatte_stays_as_it_is(scene, tmp_path):
    layer = scene.view_layers[0]
    layer.use_pass_cryptomatte_material, layer.pass_cryptomatte_depth = True, 6
    plain = render_plain(scene, tmp_path)["left"]
    with working_scene(scene, SceneOverrides()) as working:
        source = BlenderRenderer(working, tmp_path).render_source("left")[0]
        assert rendered_layer(working).use_pass_cryptomatte_material
        assert rendered_layer(working).pass_cryptomatte_depth == 6
    assert set(source) == {*plain, EFFECTS_PASS, MATERIAL_PASS}
    levels = [name for name in plain if name.startswith("Crypto")]
    assert len(levels) == 3
    for name in levels:
        np.testing.assert_array_equal(source[name], plain[name])


def test_the_picture_is_the_same_with_it(scene, tmp_path):
    plain = render_plain(scene, tmp_path)["left"]
    np.testing.assert_array_equal(render_source(scene, tmp_path)[COLOUR_PASS], plain[COLOUR_PASS])


def passes_in_file(scene, folder, monkeypatch, **overrides):
    """Names of the passes in the EXR that Blender writes for the source, as they stand in the file."""
    found = set()
    read = render.read_render

    def look(path, *, layer, view):
        with OpenEXR.File(str(path), separate_channels=True) as file:
            for part in file.parts:
                for name in part.channels:
                    bare = name.removeprefix(f"{layer}.").rpartition(".")[0]
                    found.add(bare.removesuffix(f".{view}"))
        return read(path, layer=layer, view=view)

    monkeypatch.setattr(render, "read_render", look)
    render_source(scene, folder, **overrides)
    return found


def test_a_scene_that_calls_for_nothing_is_rendered_with_colour_and_depth_alone(tmp_path, monkeypatch):
    scene = open_blend(DEMO)
    written = passes_in_file(scene, tmp_path, monkeypatch, size=(64, 64), samples=1, denoise=False)
    assert written == {COLOUR_PASS, DEPTH_PASS}


def test_a_scene_that_calls_for_gloss_is_rendered_with_one_pass_more(scene, tmp_path, monkeypatch):
    assert passes_in_file(scene, tmp_path, monkeypatch) == {COLOUR_PASS, DEPTH_PASS, "CryptoMaterial00"}


def test_passes_that_the_user_wants_stay(tmp_path, monkeypatch):
    scene = open_blend(DEMO)
    scene.view_layers[0].use_pass_normal = True
    written = passes_in_file(scene, tmp_path, monkeypatch, size=(64, 64), samples=1, denoise=False)
    assert written == {COLOUR_PASS, DEPTH_PASS, "Normal"}


def test_hair_without_a_material_is_flagged(tmp_path):
    scene = empty_scene(64, 36, samples=4)
    add_camera(scene)
    curves = bpy.data.hair_curves.new("Fur")
    curves.add_curves([2])
    curves.attributes["position"].data.foreach_set("vector", [0.0, -1.0, -5.0, 0.0, 1.0, -5.0])
    radius = curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", [0.5, 0.5])
    scene.collection.objects.link(bpy.data.objects.new("Fur", curves))
    hair = flagged(render_source(scene, tmp_path)[EFFECTS_PASS], Effect.HAIR)
    assert hair[18, 32]
    assert not hair[:, :10].any()
