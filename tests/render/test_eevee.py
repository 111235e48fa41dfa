"""EEVEE as source: what Cycles traces is matched to it, and no seam shows."""

from dataclasses import replace

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.commands.frame import render_files
from stereo_reproject.blender.engines.eevee import renderer_of
from stereo_reproject.blender.engines.render import render_views
from stereo_reproject.blender.scene.working import open_blend, working_scene
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.metrics import border_step, tone
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.pipeline import matched_tracing
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from tests.blender.snapshot import everything
from tests.blender.toolbox import (
    Material,
    add_camera,
    add_cube,
    add_plane,
    add_sphere,
    add_sun,
    diffuse,
    emission,
    empty_scene,
    noise_image,
    set_background,
)

pytestmark = pytest.mark.slow

EEVEE = "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0) else "BLENDER_EEVEE"

SEAM = 1.1
"""Step across the borders of holes, over that of a plain picture at the same places, at most."""

WITHOUT = 1.5
"""What it is at least where pixels are left as Cycles has traced them."""


@pytest.fixture
def room(tmp_path):
    """Boxes and a ball in a corner without a ceiling, under a sky that Cycles' corner shades and EEVEE's does not."""
    scene = empty_scene(160, 90, samples=16)
    scene.render.engine = EEVEE
    scene.eevee.taa_render_samples = 8
    set_background(scene, 1.0)
    wall = diffuse("wall", (0.7, 0.6, 0.5), noise_image(tmp_path, size=24))
    add_plane(scene, wall, size=(16, 9), location=(0, 0, -8))
    add_plane(scene, diffuse("floor", (0.3, 0.5, 0.3)), size=(16, 12), location=(0, -1.8, -4), rotation=(-1.5708, 0, 0))
    add_cube(scene, diffuse("box", (0.8, 0.2, 0.1)), size=1.2, location=(-1.1, -0.6, -4.5))
    add_cube(scene, diffuse("crate", (0.1, 0.3, 0.8)), size=0.9, location=(1.3, -0.9, -4.0))
    add_sphere(scene, diffuse("ball", (0.9, 0.9, 0.9)), radius=0.6, location=(0.2, 0.3, -5.0))
    add_plane(scene, emission("lamp", strength=4.0), size=(0.6, 0.3), location=(1.6, 1.0, -5.5))
    add_sun(scene)
    add_camera(scene, interocular=0.2, convergence=6.0)
    return scene


def render(scene, folder, fill="packed", overrides=None):
    """The frame that EEVEE and Cycles make of the scene, and the target eye that EEVEE makes alone."""
    settings = StereoSettings(fill=fill, accuracy="preview", scene=overrides or SceneOverrides())
    with working_scene(scene, settings.scene) as working, renderer_of(working, folder) as renderer:
        frame = render_stereo_frame(renderer, settings)
        plain = render_views(working, ("right",), folder).views["right"][COLOUR_PASS]
    return frame, plain


def seam(picture, plain, holes):
    return border_step(picture, holes) / border_step(plain, holes)


@pytest.mark.parametrize("fill", ["packed", "card"])
def test_no_seam_shows(room, tmp_path, fill):
    frame, plain = render(room, tmp_path, fill)
    holes, ours = frame.reasons > 0, frame.eyes["right"][COLOUR_PASS]
    assert 0.02 < holes.mean() < 0.5
    assert frame.fill.method == fill
    assert seam(ours, plain, holes) <= SEAM
    assert np.abs(tone(ours) - tone(plain))[holes].mean() < 0.03
    assert frame.correction.mean > 0.05


@pytest.mark.parametrize("pixels", [1.0, 1.6])
def test_a_wire_is_whole_and_dark(room, tmp_path, pixels):
    """Its rows, each by itself: darker than what is beside them, nearly as much as in EEVEE's own eye."""
    per_pixel = 2.5 * 36.0 / room.camera.data.lens / 160
    add_plane(room, diffuse("wire", (0.01, 0.01, 0.01)), size=(pixels * per_pixel, 4.0), location=(-0.35, 0, -2.5))
    frame, plain = render(room, tmp_path)

    def darkness(picture):
        lines = tone(picture)[10:60, :, :3].mean(axis=-1)
        middle = np.argmin(tone(plain)[10:60, :, :3].mean(axis=(0, 2)))
        around = lines[:, middle - 6 : middle + 7]
        return np.median(around, axis=1) - around.min(axis=1)

    ours, theirs = darkness(frame.eyes["right"][COLOUR_PASS]), darkness(plain)
    assert np.median(theirs) > 0.1
    assert np.mean(ours > 0.5 * np.median(theirs)) > 0.9


def test_the_sky_is_far_away_in_every_blender(room, tmp_path):
    add_camera(room, lens=8.0)
    with working_scene(room, SceneOverrides()) as working, renderer_of(working, tmp_path) as renderer:
        depth = renderer.render_source("left")[0][DEPTH_PASS]
    assert np.isposinf(depth).any()
    assert depth[np.isfinite(depth)].max() < 100.0


def test_the_sky_is_as_far_away_for_an_eye_that_is_rendered_whole(room, tmp_path):
    add_camera(room, lens=8.0, interocular=0.2)
    frame, _ = render(room, tmp_path, "full")
    for eye in frame.eyes.values():
        assert np.isposinf(eye[DEPTH_PASS]).any()


def test_a_transparent_film_is_left_to_eevee(room, tmp_path):
    room.render.film_transparent = True
    frame, plain = render(room, tmp_path, "auto")
    assert frame.fill.method == "full"
    assert "transparent" in frame.fill.reason
    assert np.allclose(frame.eyes["right"][COLOUR_PASS], plain, atol=1e-3)


def test_light_passes_are_left_to_eevee(room, tmp_path):
    room.view_layers[0].use_pass_diffuse_direct = True
    frame, _ = render(room, tmp_path, "auto")
    assert frame.fill.method == "full"
    assert "pass" in frame.fill.reason


def test_every_layer_s_materials_are_told_of(room, tmp_path):
    toon = Material("drawn")
    add_plane(room, toon.surface(toon.node("BsdfToon")), location=(0, 0, -5.0))
    collection = bpy.data.collections.new("Drawn")
    room.collection.children.link(collection)
    drawn = room.objects[-1]
    room.collection.objects.unlink(drawn)
    collection.objects.link(drawn)
    room.view_layers.new("Drawn")
    room.view_layers[0].layer_collection.children["Drawn"].exclude = True
    report, _ = render_files(room, StereoSettings(fill="full"), tmp_path)
    assert any("'drawn'" in line for line in report["warnings"])


def test_eevee_does_not_denoise(room, tmp_path):
    with pytest.raises(BadInputError, match="not denoised"), working_scene(room, SceneOverrides(denoise=True)):
        pass


def test_without_matching_a_seam_would_show(room, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "stereo_reproject.pipeline.matched_tracing.match", lambda _picture, traced, *_, **__: traced.colour
    )
    frame, plain = render(room, tmp_path)
    assert seam(frame.eyes["right"][COLOUR_PASS], plain, frame.reasons > 0) > WITHOUT
    assert frame.correction.mean < 0.05


def test_the_second_eye_of_a_simple_scene_is_eevees_own(room, tmp_path, monkeypatch):
    monkeypatch.setattr(matched_tracing, "TUNING", replace(matched_tracing.TUNING, min_seconds_to_hand_over=1000.0))
    frame, plain = render(room, tmp_path, "auto")
    assert frame.fill.method == "full"
    assert frame.fill.reason.startswith("a second EEVEE render")
    assert np.allclose(frame.eyes["right"][COLOUR_PASS], plain, atol=1e-3)
    assert frame.correction is None


def test_what_eevee_gives_no_depth_is_not_matched(room, tmp_path):
    glass = Material("pane")
    glass.surface(glass.node("BsdfTransparent", Color=(0.5, 0.7, 0.5, 1.0)))
    glass.block.surface_render_method = "BLENDED"
    add_plane(room, glass, location=(0, 0, -3.0))
    frame, _ = render(room, tmp_path, "auto")
    assert frame.fill.method == "full"
    assert "'pane' is blended" in frame.fill.reason


def test_a_scene_of_eevees_is_as_it_was(room, tmp_path):
    room.view_layers[0].update()
    before = everything()
    settings = StereoSettings(fill="packed")
    report, _ = render_files(room, settings, tmp_path)
    assert everything() == before
    assert report["engine"] == EEVEE
    assert report["correction"]["p95"] >= report["correction"]["mean"] > 0.0
    assert report["estimate"]["noise_ratio"] is None
    assert report["estimate"]["from"].startswith("Cycles' light is not EEVEE's")
    assert report["warnings"] == []


@pytest.mark.parametrize(("fill", "ratio"), [("packed", None), ("full", 1.0)])
def test_a_comparison_with_eevee_says_why_it_has_no_ratio_to_noise(room, tmp_path, fill, ratio):
    report, _ = render_files(room, StereoSettings(fill=fill, compare=True), tmp_path, files=["report.json"])
    compare = report["compare"]
    assert (compare["noise_ratio"], compare["honest_ratio"], compare["worst_tiles"]) == (ratio, ratio, ratio)
    nothing = None if ratio is None else 0.0
    assert (compare["bias"], compare["wrong_tiles"], compare["flip_ratio"]) == (nothing, nothing, None)
    assert ("EEVEE renders the same noise" in compare.get("no_noise", "")) is (ratio is None)
    assert (compare["rmse"] > 0.0) is (ratio is None)


def test_eevee_in_place_of_cycles(room, tmp_path):
    room.render.engine = "CYCLES"
    before = everything()
    toon = Material("drawn")
    add_plane(room, toon.surface(toon.node("BsdfToon")), size=(0.5, 0.5), location=(0.5, 0.0, -4.0))
    settings = StereoSettings(fill="packed", scene=SceneOverrides(source_engine="eevee", samples=4))
    report, _ = render_files(room, settings, tmp_path)
    assert report["engine"] == EEVEE
    assert report["samples"] == 4
    assert [line for line in report["warnings"] if "Toon" in line and "'drawn'" in line]
    assert room.render.engine == "CYCLES"
    assert {key for key in everything() if key[0] == "scenes"} == {key for key in before if key[0] == "scenes"}


# Scenes that others made

REAL = {"living-room": (0.065, 2.9), "glass-vase": (0.013, 0.54)}


@pytest.mark.parametrize("name", REAL)
def test_a_real_scene_has_no_seam_and_takes_no_longer_than_two_renders(shared_scenes, tmp_path, name):
    scene = open_blend(shared_scenes / name / f"{name}.blend")
    interocular, convergence = REAL[name]
    overrides = SceneOverrides(
        size=(240, 135),
        samples=4,
        interocular_distance=interocular,
        convergence_distance=convergence,
        source_engine="eevee",
    )
    frame, plain = render(scene, tmp_path, "auto", overrides)
    ours = frame.eyes["right"][COLOUR_PASS]
    if frame.fill.method == "full":
        assert frame.fill.reason.startswith("a second EEVEE render")
        assert np.allclose(ours, plain, atol=1e-3)
    else:
        assert seam(ours, plain, frame.reasons > 0) <= SEAM
        assert frame.seconds["total"] < 2.0 * frame.source_cost.seconds


def test_the_room_of_a_real_scene_is_matched(shared_scenes, tmp_path):
    """Whichever way is the faster: EEVEE lights this room as if it had no walls."""
    scene = open_blend(shared_scenes / "living-room" / "living-room.blend")
    overrides = SceneOverrides(
        size=(240, 135), samples=4, interocular_distance=0.065, convergence_distance=2.9, source_engine="eevee"
    )
    frame, plain = render(scene, tmp_path, "packed", overrides)
    holes, ours = frame.reasons > 0, frame.eyes["right"][COLOUR_PASS]
    assert seam(ours, plain, holes) <= SEAM
    assert np.abs(tone(ours) - tone(plain))[holes].mean() < 0.03
    assert frame.correction.mean > 0.2
