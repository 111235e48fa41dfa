"""The scene's depth on the screen: measured by ray casts, fitted, set by hand, drawn and warned about."""

import math
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.scene.depth import EDGE_ROWS
from tests.blender.toolbox import add_camera, add_cube, add_plane, diffuse, empty_scene
from tests.operators.test_operators import Drawn

SIZE = (192, 108)
NEAR, FAR = 4.0, 8.0

PERCENT_TOLERANCE = 1e-4
"""Percent of the width: Blender keeps both distances in single precision."""


@pytest.fixture
def scene():
    """A card before a wall that fills the frame."""
    scene = empty_scene(*SIZE)
    add_plane(scene, diffuse(), size=(40, 30), location=(0, 0, -FAR)).name = "Wall"
    add_plane(scene, diffuse(), size=(1, 1.4), location=(0.2, 0.1, -NEAR)).name = "Card"
    add_camera(scene)
    return scene


@pytest.fixture
def fit(extension):
    """Fit the scene to comfort, and return the parallax of its nearest and farthest point in percent."""
    from stereo_reproject_extension.operators.stereo import parallax_now

    def fit(**options):
        assert bpy.ops.stereo_reproject.fit_to_comfort(**options) == {"FINISHED"}
        return [found.percent for _, found in parallax_now(bpy.context.scene)]

    return fit


def place_at_the_left_edge(scene, depth=NEAR):
    """A post that the left edge of the frame cuts."""
    half = depth * 0.5 * 36.0 / scene.camera.data.lens
    add_plane(scene, diffuse(), size=(0.8, 20), location=(-half, 0, -depth)).name = "Post"


def test_the_nearest_and_farthest_depth_are_measured_without_a_render(extension, scene):
    from stereo_reproject_extension.operators.results import result_of

    assert bpy.ops.stereo_reproject.measure_depth() == {"FINISHED"}
    known = result_of(scene).depth
    assert (known.near, known.far, known.frame) == (pytest.approx(NEAR), pytest.approx(FAR), scene.frame_current)


def test_the_sky_of_an_orthographic_camera_is_no_depth(extension, scene):
    from stereo_reproject_extension.operators.results import result_of

    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 60.0
    scene.camera.data.stereo.convergence_mode = "TOE"
    assert bpy.ops.stereo_reproject.measure_depth() == {"FINISHED"}
    assert result_of(scene).depth.far == pytest.approx(FAR)


def test_what_a_render_does_not_show_is_looked_through(extension, scene):
    from stereo_reproject_extension.operators.results import result_of

    for k, hide in enumerate(({"hide_render": True}, {"visible_camera": False})):
        card = add_plane(scene, diffuse(), size=(20, 20), location=(0, 0, -1.0 - k))
        for name, value in hide.items():
            setattr(card, name, value)
    bpy.ops.stereo_reproject.measure_depth()
    assert result_of(scene).depth.near == pytest.approx(NEAR)


def test_the_sky_is_infinitely_far_unless_the_film_is_transparent(extension, scene):
    from stereo_reproject_extension.operators.results import result_of

    bpy.data.objects.remove(bpy.data.objects["Wall"])
    bpy.ops.stereo_reproject.measure_depth()
    assert result_of(scene).depth.far == math.inf
    scene.render.film_transparent = True
    bpy.ops.stereo_reproject.measure_depth()
    assert result_of(scene).depth.far == pytest.approx(NEAR)


def test_a_fit_puts_both_ends_at_their_limits(fit, scene):
    assert fit() == pytest.approx([-1.0, 2.0], abs=PERCENT_TOLERANCE)
    assert fit(in_front=0.5, behind=1.0) == pytest.approx([-0.5, 1.0], abs=PERCENT_TOLERANCE)


@pytest.mark.parametrize("fit_of_sensor", ["HORIZONTAL", "VERTICAL"])
def test_a_fit_holds_for_every_sensor_fit_and_for_a_part_of_the_frame(fit, scene, fit_of_sensor):
    data, render = scene.camera.data, scene.render
    data.sensor_fit, data.sensor_height, data.shift_x = fit_of_sensor, 20.0, 0.05
    render.use_border, render.border_min_x, render.border_max_x = True, 0.25, 0.75
    assert fit() == pytest.approx([-1.0, 2.0], abs=PERCENT_TOLERANCE)


def test_a_fit_never_turns_the_eyes_apart(fit, scene):
    scene.stereo_reproject.screen_width = 10.0
    near, far = fit()
    assert near == pytest.approx(-1.0, abs=PERCENT_TOLERANCE)
    assert far <= 0.65
    bpy.data.objects.remove(bpy.data.objects["Wall"])
    assert fit()[1] == pytest.approx(0.65, abs=PERCENT_TOLERANCE)


def test_a_fit_keeps_behind_the_screen_what_the_frame_would_cut(fit, scene, capfd):
    place_at_the_left_edge(scene)
    assert fit() == pytest.approx([0.0, 2.0], abs=PERCENT_TOLERANCE)
    assert "; all is behind the screen, whose edge would cut 'Post' (Avoid Cuts)" in capfd.readouterr().out
    assert fit(avoid_cuts=False) == pytest.approx([-1.0, 2.0], abs=PERCENT_TOLERANCE)
    assert "Avoid Cuts" not in capfd.readouterr().out


@pytest.mark.parametrize(
    ("system", "unit", "scale", "length", "words"),
    [
        ("METRIC", "METERS", 1.0, 0.06283, "0.0628 m"),
        ("METRIC", "METERS", 1.0, 2.0, "2 m"),
        ("METRIC", "METERS", 1.0, 1234.5, "1234 m"),
        ("METRIC", "CENTIMETERS", 1.0, 0.06283, "6.28 cm"),
        ("METRIC", "METERS", 0.01, 6.5, "0.065 m"),
        ("METRIC", "ADAPTIVE", 1.0, 0.06283, "6.28 cm"),
        ("IMPERIAL", "FEET", 1.0, 3.048, "10 ft"),
        ("NONE", "METERS", 0.01, 0.06283, "0.0628"),
        ("METRIC", "METERS", 1.0, 0.0, "0 m"),
    ],
)
def test_lengths_are_in_the_unit_that_the_scene_asks_for(extension, scene, system, unit, scale, length, words):
    from stereo_reproject_extension.operators.lengths import length_words

    units = scene.unit_settings
    units.system = system
    if system != "NONE":
        units.length_unit = unit
    units.scale_length = scale
    assert length_words(scene, length) == words


def test_a_parallel_camera_is_fitted_by_its_interocular_distance(fit, scene):
    stereo = scene.camera.data.stereo
    stereo.convergence_mode = "PARALLEL"
    convergence = stereo.convergence_distance
    near, far = fit()
    assert near == pytest.approx(-1.0, abs=PERCENT_TOLERANCE)
    assert near < far < 0.0
    assert stereo.convergence_distance == convergence


def orthographic(scene):
    scene.camera.data.type = "ORTHO"


def toe_in(scene):
    scene.camera.data.stereo.convergence_mode = "TOE"


def looking_away(scene):
    scene.camera.rotation_euler.x = math.pi


def without_a_wall(_scene):
    bpy.data.objects.remove(bpy.data.objects["Wall"])


def parallel(scene):
    scene.camera.data.stereo.convergence_mode = "PARALLEL"


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        (orthographic, {}, "make it perspective"),
        (toe_in, {}, "set the mode to Off-Axis"),
        (looking_away, {}, "nothing whose depth can be measured"),
        (without_a_wall, {"behind": 0.0}, "the sky is in view: raise Behind"),
        (parallel, {"in_front": 0.0}, "raise In Front"),
    ],
)
def test_what_cannot_be_fitted_is_said_and_nothing_is_changed(extension, scene, change, options, words):
    stereo = scene.camera.data.stereo
    change(scene)
    before = stereo.interocular_distance, stereo.convergence_distance
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.stereo_reproject.fit_to_comfort(**options)
    assert (stereo.interocular_distance, stereo.convergence_distance) == before


def test_without_a_camera_nothing_can_be_pressed(extension, scene):
    bpy.data.objects.remove(scene.camera)
    for name in ("fit_to_comfort", "measure_depth", "set_screen_here"):
        assert not getattr(bpy.ops.stereo_reproject, name).poll(), name


def test_a_linked_camera_is_measured_but_not_changed(extension, scene, tmp_path):
    library = tmp_path / "library.blend"
    bpy.data.libraries.write(str(library), {scene.camera})
    bpy.data.objects.remove(scene.camera)
    with bpy.data.libraries.load(str(library), link=True) as (source, target):
        target.objects = source.objects
    camera = target.objects[0]
    scene.collection.objects.link(camera)
    scene.camera = camera
    bpy.context.view_layer.update()
    assert not bpy.ops.stereo_reproject.fit_to_comfort.poll()
    assert not bpy.ops.stereo_reproject.set_screen_here.poll()
    assert bpy.ops.stereo_reproject.measure_depth() == {"FINISHED"}


def test_a_fit_is_one_step_to_undo(extension, scene):
    def settings():
        stereo = bpy.context.scene.camera.data.stereo
        return stereo.interocular_distance, stereo.convergence_distance

    before = settings()
    bpy.ops.ed.undo_push(message="Before")
    bpy.ops.stereo_reproject.fit_to_comfort("EXEC_DEFAULT", True)
    fitted = settings()
    assert fitted != before
    bpy.ops.ed.undo()
    assert settings() == before
    bpy.ops.ed.redo()
    assert settings() == fitted


@pytest.mark.parametrize("sensor_fit", ["AUTO", "VERTICAL"])
def test_the_screen_is_put_where_it_was_clicked(extension, scene, sensor_fit):
    from stereo_reproject_extension.operators.depth_view import planes_of, screen_depth
    from stereo_reproject_extension.operators.stereo import eyes_of

    from stereo_reproject.views.parallax import parallax_at

    scene.camera.data.sensor_fit = sensor_fit
    assert bpy.ops.stereo_reproject.set_screen_here("EXEC_DEFAULT", depth=5.5) == {"FINISHED"}
    left, right, width = eyes_of(scene)
    assert parallax_at(left, right, 5.5, width).percent == pytest.approx(0.0, abs=PERCENT_TOLERANCE)
    assert screen_depth() == pytest.approx(5.5)
    screen = next(plane for plane in planes_of(scene) if plane.name == "Screen")
    np.testing.assert_allclose(screen.corners[:, 2], -5.5, rtol=1e-5)


def test_the_planes_are_where_comfort_ends(extension, scene):
    from stereo_reproject_extension.operators.depth_view import planes_of
    from stereo_reproject_extension.operators.stereo import eyes_of, viewing_conditions

    from stereo_reproject.views.comfort import comfort_limits
    from stereo_reproject.views.parallax import parallax_at

    scene.camera.location, scene.camera.rotation_euler = (0.0, 0.0, 2.0), (0.0, 0.0, 0.4)
    bpy.context.view_layer.update()
    planes = {plane.name: 2.0 - plane.corners[0][2] for plane in planes_of(scene)}
    assert 0.0 < planes["Near"] < planes["Screen"] < planes["Far"]
    left, right, width = eyes_of(scene)
    limits = comfort_limits(viewing_conditions(scene))
    for name, limit in (("Near", limits.near), ("Far", limits.far)):
        found = parallax_at(left, right, planes[name], width).percent
        assert found == pytest.approx(limit, abs=PERCENT_TOLERANCE)
    # With the eyes closer together, infinity itself is comfortable.
    scene.camera.data.stereo.interocular_distance = 0.01
    assert "Far" not in [plane.name for plane in planes_of(scene)]


@pytest.mark.parametrize("mode", ["OFFAXIS", "TOE"])
def test_eyes_in_the_same_place_have_their_screen_and_no_comfort_zone(extension, scene, mode):
    from stereo_reproject_extension.operators.depth_view import arrow_base, planes_of

    stereo = scene.camera.data.stereo
    stereo.convergence_mode, stereo.convergence_distance, stereo.interocular_distance = mode, 5.5, 0.0
    (screen,) = planes_of(scene)
    assert screen.name == "Screen"
    np.testing.assert_allclose(screen.corners[:, 2], -5.5, rtol=1e-5)
    assert arrow_base(scene) is not None
    stereo.convergence_mode = "PARALLEL"
    assert planes_of(scene) == []


def test_the_eyedropper_sees_the_picture_s_depth(extension, scene):
    from stereo_reproject_extension.operators.screen_here import _depth_in_picture

    depsgraph = bpy.context.evaluated_depsgraph_get()
    camera = scene.camera.evaluated_get(depsgraph)
    assert _depth_in_picture(scene, depsgraph, camera, (0.52, 0.52)) == pytest.approx(NEAR)
    assert _depth_in_picture(scene, depsgraph, camera, (0.1, 0.9)) == pytest.approx(FAR)


def depth_seen_at(scene, share):
    from stereo_reproject_extension.operators.screen_here import _depth_in_picture

    depsgraph = bpy.context.evaluated_depsgraph_get()
    return _depth_in_picture(scene, depsgraph, scene.camera.evaluated_get(depsgraph), share)


def border_around_the_card(scene):
    """A render region in which the card is at its left and bottom edge, and the wall at the others."""
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.5, 1.0, 0.5, 1.0


IN_THE_CARD_OF_THE_REGION, IN_THE_WALL_OF_THE_REGION = (0.04, 0.04), (0.55, 0.55)
"""Places in a picture of that region alone; the same shares of the whole frame show the wall and the card."""


def test_a_picture_of_a_render_region_in_its_frame_is_read_over_the_whole_frame(extension, scene):
    border_around_the_card(scene)
    assert depth_seen_at(scene, IN_THE_CARD_OF_THE_REGION) == pytest.approx(FAR)
    assert depth_seen_at(scene, IN_THE_WALL_OF_THE_REGION) == pytest.approx(NEAR)


def test_a_picture_that_is_cropped_to_its_render_region_is_read_over_the_region(extension, scene):
    border_around_the_card(scene)
    scene.render.use_crop_to_border = True
    assert depth_seen_at(scene, IN_THE_CARD_OF_THE_REGION) == pytest.approx(NEAR)
    assert depth_seen_at(scene, IN_THE_WALL_OF_THE_REGION) == pytest.approx(FAR)


def render_a_sample(scene):
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    bpy.ops.render.render()


@pytest.mark.parametrize("which", ["content", "multiview"])
def test_a_pair_of_ours_is_read_over_its_render_region(extension, scene, which):
    from stereo_reproject_extension.operators.results import Delivery, SlotContent, result_of
    from stereo_reproject_extension.operators.slots import content_now

    border_around_the_card(scene)
    render_a_sample(scene)
    pair = {"content": SlotContent(7, "Another Slot", 1), which: content_now()}
    result_of(scene).delivery = Delivery(**pair, frame=1, clock="12:00")
    assert depth_seen_at(scene, IN_THE_CARD_OF_THE_REGION) == pytest.approx(NEAR)
    assert depth_seen_at(scene, IN_THE_WALL_OF_THE_REGION) == pytest.approx(FAR)
    # What F12 renders into that slot is the whole frame again.
    render_a_sample(scene)
    assert depth_seen_at(scene, IN_THE_CARD_OF_THE_REGION) == pytest.approx(FAR)


def warnings(scene):
    from stereo_reproject_extension.operators.depth_panel import warnings_on
    from stereo_reproject_extension.operators.results import result_of
    from stereo_reproject_extension.operators.stereo import parallax_now, viewing_conditions
    from stereo_reproject_extension.stereo_reproject.views.comfort import comfort_limits

    bpy.ops.stereo_reproject.measure_depth()
    limits = comfort_limits(viewing_conditions(scene))
    return warnings_on(scene, result_of(scene).depth, parallax_now(scene), limits)


def test_both_sides_are_warned_of_and_nothing_is_said_of_a_comfortable_scene(fit, scene):
    fit()
    assert warnings(scene) == []
    stereo = scene.camera.data.stereo
    stereo.interocular_distance *= 10.0
    assert [text.partition(":")[0] for text in warnings(scene)] == [
        "Too far behind a screen 0.6 m wide",
        "Too near in front of the screen",
    ]
    assert all(text.endswith(". Lower the interocular distance.") for text in warnings(scene))
    fit(in_front=2.5, behind=2.0)
    stereo.interocular_distance *= 1.6
    assert [text.partition(":")[0] for text in warnings(scene)] == [
        "Too far behind the screen",
        "Too near in front of the screen",
    ]


def test_what_the_frame_cuts_in_front_of_the_screen_is_named(extension, scene):
    place_at_the_left_edge(scene)
    scene.camera.data.stereo.convergence_distance = 6.0
    assert any(text.startswith("'Post' is in front of the screen and cut by its left edge") for text in warnings(scene))
    scene.camera.data.stereo.convergence_distance = NEAR
    assert not any("cut by" in text for text in warnings(scene))


def texts_of(panel, scene, space=None):
    """All texts that a panel draws, in one line; space is the editor's, none outside an Image Editor."""
    drawn = Drawn()
    context = SimpleNamespace(
        scene=scene, region=None, space_data=space, preferences=bpy.context.preferences, window=bpy.context.window
    )
    panel.draw(SimpleNamespace(layout=drawn), context)
    return " ".join(item[-1]["text"] for item in drawn.items if item[0] == "label")


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("camera", "in front of the screen and cut by its left"),
        ("image", "in front of the screen and cut by its left"),
        ("main", "Stereo Camera, below, says why"),
    ],
)
def test_the_panel_and_the_image_editor_warn_beside_the_verdict(extension, scene, place, words):
    from stereo_reproject_extension.operators import panels
    from stereo_reproject_extension.operators.image_panels import IMAGE_PT_stereo_reproject
    from stereo_reproject_extension.operators.results import Delivery, result_of

    def said():
        if place == "image":
            return words in texts_of(IMAGE_PT_stereo_reproject, scene, SimpleNamespace(type="IMAGE_EDITOR", image=None))
        return words in texts_of(panels._Camera if place == "camera" else panels._Main, scene)

    place_at_the_left_edge(scene)
    scene.camera.data.stereo.convergence_distance = 6.0
    bpy.ops.stereo_reproject.measure_depth()
    result_of(scene).delivery = Delivery(None, 1, "12:00")
    assert said()
    scene.camera.data.stereo.interocular_distance = 0.001
    assert not said()


def test_what_both_edges_cut_is_named_once(extension, scene):
    add_plane(scene, diffuse(), size=(20, 1), location=(0, 0, -NEAR)).name = "Beam"
    scene.camera.data.stereo.convergence_distance = 6.0
    (said,) = (text for text in warnings(scene) if "cut by" in text)
    assert said.startswith("'Beam' is in front of the screen and cut by its left and right edges. Set the conv")


def render_preview(scene):
    """A small pair by the extension, and what the panel warns of after it, with no measurement."""
    from stereo_reproject_extension.operators.depth_panel import warnings_on
    from stereo_reproject_extension.operators.results import result_of
    from stereo_reproject_extension.operators.stereo import parallax_now, viewing_conditions
    from stereo_reproject_extension.stereo_reproject.views.comfort import comfort_limits

    scene.stereo_reproject.preview_samples = 1
    assert bpy.ops.render.stereo_reproject_image(preview=True) == {"FINISHED"}
    known = result_of(scene).depth
    return known, warnings_on(scene, known, parallax_now(scene), comfort_limits(viewing_conditions(scene)))


@pytest.mark.parametrize("source", ["left", "right"])
def test_a_pair_shows_what_the_frame_cuts_in_front_of_the_screen(extension, scene, source):
    place_at_the_left_edge(scene)
    scene.stereo_reproject.source = source
    scene.camera.data.stereo.convergence_distance = 6.0
    known, said = render_preview(scene)
    at_left = [hit.depth for hit in known.edges if hit.side == "left"]
    assert at_left == pytest.approx([NEAR] * EDGE_ROWS, rel=1e-3)
    (cut,) = (text for text in said if "cut by" in text)
    assert cut.startswith("'Post' is in front of the screen and cut by its left edge. Set the convergence nearer")


def test_a_verdict_says_that_the_camera_was_set_anew(extension, scene):
    from stereo_reproject_extension.operators.panels import _Main

    render_preview(scene)
    stereo, words = scene.camera.data.stereo, "were changed since: render again"
    for name in ("interocular_distance", "convergence_distance"):
        before = getattr(stereo, name)
        assert words not in texts_of(_Main, scene)
        setattr(stereo, name, 1.01 * before)
        assert words in texts_of(_Main, scene)
        setattr(stereo, name, before)
    before = stereo.pivot
    stereo.pivot = "CENTER" if before != "CENTER" else "RIGHT"
    assert words in texts_of(_Main, scene)
    stereo.pivot, stereo.convergence_mode = before, "PARALLEL"
    render_preview(scene)
    stereo.convergence_distance *= 2.0
    assert words not in texts_of(_Main, scene)


def test_an_orthographic_camera_is_not_warned_of_depth(extension, scene):
    from stereo_reproject_extension.operators.depth_panel import depth_warnings

    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 1.0
    bpy.ops.stereo_reproject.measure_depth()
    assert depth_warnings(scene) == []


def test_an_animation_shows_the_depth_and_the_cuts_of_its_last_frame(extension, scene, tmp_path):
    from stereo_reproject_extension.operators.depth_panel import _when
    from stereo_reproject_extension.operators.results import result_of

    place_at_the_left_edge(scene)
    scene.frame_start, scene.frame_end, scene.cycles.samples = 6, 7, 1
    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(tmp_path / "shot_")
    assert result_of(scene).depth is None
    assert bpy.ops.render.stereo_reproject_animation() == {"FINISHED"}
    known = result_of(scene).depth
    assert (known.near, known.frame) == (pytest.approx(NEAR, rel=1e-3), 7)
    assert known.far > NEAR
    assert [hit.depth for hit in known.edges if hit.side == "left"] == pytest.approx([NEAR] * EDGE_ROWS, rel=1e-3)
    assert _when(known, scene) == f"Depth at frame 7 (now {scene.frame_current})"


def test_a_pair_of_a_render_region_does_not_show_the_frame_s_edges(extension, scene):
    border_around_the_card(scene)
    known, said = render_preview(scene)
    assert known.edges is None
    assert not any("cut by" in text for text in said)


def test_a_fit_stays_said_until_the_camera_is_changed(fit, scene):
    from stereo_reproject_extension.operators.depth import distances_of
    from stereo_reproject_extension.operators.results import result_of

    fit()
    result, data = result_of(scene), scene.camera.data
    assert result.fitted.startswith("Interocular ")
    assert result.fitted_to == distances_of(data)
    data.stereo.convergence_distance *= 1.01
    assert result.fitted_to != distances_of(data)


@pytest.mark.parametrize("pivot", ["LEFT", "CENTER", "RIGHT"])
def test_through_the_camera_all_planes_are_its_frame(extension, scene, pivot):
    from stereo_reproject_extension.operators.depth_view import planes_of

    stereo, half = scene.camera.data.stereo, 0.5 * 36.0 / scene.camera.data.lens
    stereo.pivot, stereo.interocular_distance, stereo.convergence_distance = pivot, 0.2, 6.0
    planes = planes_of(scene)
    assert len(planes) == 3
    for plane in planes:
        seen = plane.corners[:, 0] / -plane.corners[:, 2]
        np.testing.assert_allclose(seen, [-half, half, half, -half], rtol=1e-5, err_msg=plane.name)


def test_advice_never_contradicts_itself(extension, scene):
    place_at_the_left_edge(scene)
    stereo = scene.camera.data.stereo
    stereo.convergence_distance = 6.0
    for factor in (1.0, 2.0, 5.0, 20.0):
        stereo.interocular_distance = 0.065 * factor
        said = " ".join(warnings(scene))
        assert not ("nearer" in said and "farther" in said), factor
    stereo.convergence_mode = "PARALLEL"
    assert warnings(scene)
    assert "onvergence" not in " ".join(warnings(scene)), "a parallel camera has none"


def test_a_tilted_floor_far_behind_is_no_cut(extension, scene):
    add_cube(scene, diffuse(), size=2.0, location=(-6.0, 0.0, -FAR))
    scene.camera.data.stereo.convergence_distance = NEAR
    assert not any("cut by" in text for text in warnings(scene))


@pytest.mark.parametrize(("low", "high"), [(-3.0, 0.0), (0.0, 3.0)])
def test_the_bar_s_pieces_are_the_whole_bar(extension, low, high):
    from stereo_reproject_extension.operators.depth_panel import bar_pieces

    from stereo_reproject.views.comfort import Limits

    for near, far in ((-1.0, 2.0), (-9.0, 9.0), (-2.9, -2.5), (1.0, 1.5), (0.0, 0.0)):
        pieces = bar_pieces(near, far, Limits(-2.0, 1.5), low, high)
        assert sum(piece.share for piece in pieces) == pytest.approx(1.0, abs=0.04)
        filled = sum(piece.share for piece in pieces if piece.filled) * (high - low)
        assert filled == pytest.approx(max(min(far, high) - max(near, low), 0.0), abs=0.07)


def test_the_bar_is_red_where_it_is_not_comfortable(extension):
    from stereo_reproject_extension.operators.depth_panel import bar_pieces

    from stereo_reproject.views.comfort import Limits

    pieces = bar_pieces(-3.0, 2.0, Limits(-1.5, 3.0), -3.0, 0.0)
    assert [(piece.share, piece.filled, piece.alert) for piece in pieces] == [(0.5, True, True), (0.5, True, False)]
    beyond = bar_pieces(6.0, 7.0, Limits(-3.0, 3.0), 0.0, 3.0)
    assert [(piece.filled, piece.alert) for piece in beyond] == [(False, False), (True, True)]
    # Where the bar ends with what is comfortable, its end is red all the same.
    red = [piece.share for piece in bar_pieces(-4.4, 2.0, Limits(-3.0, 3.0), -3.0, 0.0) if piece.alert]
    assert red == [pytest.approx(0.5 / 3.0)]
    assert not any(piece.alert for piece in bar_pieces(-2.9, 2.0, Limits(-3.0, 3.0), -3.0, 0.0))
    assert not any(piece.filled for piece in bar_pieces(6.0, 7.0, Limits(-3.0, 3.0), -3.0, 0.0))


def test_the_planes_are_drawn_only_while_the_extension_is_on(package):
    from stereo_reproject_extension.operators import depth_view

    package.register()
    assert len(depth_view._handlers) == 2
    package.unregister()
    assert depth_view._handlers == []


def test_the_panel_says_for_what_the_depth_was_measured(extension, scene):
    from stereo_reproject_extension.operators.depth_panel import _when
    from stereo_reproject_extension.operators.results import result_of

    bpy.ops.stereo_reproject.measure_depth()
    known = result_of(scene).depth
    assert _when(known, scene) == "Depth at frame 1"
    scene.camera.location.x = 1.0
    bpy.context.view_layer.update()
    assert _when(known, scene) == "Depth at frame 1, camera moved"
    scene.frame_set(3)
    assert _when(known, scene) == "Depth at frame 1 (now 3)"


def test_a_report_s_depth_is_that_of_its_frame_and_none_is_infinite(extension):
    from stereo_reproject_extension.operators.results import KnownDepth

    report = {"frame": 7, "parallax": {"nearest": {"depth": 2.0}, "farthest": {"depth": None}}}
    assert KnownDepth.of_report(report) == KnownDepth(2.0, math.inf, 7)
    assert KnownDepth.of_report({"frame": 7, "parallax": None}) is None


@pytest.mark.parametrize("kind", ["PANO", "PERSP"])
def test_a_panorama_has_no_screen(extension, scene, kind):
    from stereo_reproject_extension.operators.stereo import parallax_now

    bpy.ops.stereo_reproject.measure_depth()
    assert parallax_now(scene)
    data = scene.camera.data
    data.type, data.stereo.use_spherical_stereo = kind, True
    assert parallax_now(scene) == []
    for name in ("measure_depth", "fit_to_comfort", "set_convergence"):
        assert not getattr(bpy.ops.stereo_reproject, name).poll()


def test_a_pair_for_a_headset_has_none_either(extension, scene):
    from stereo_reproject_extension.operators.stereo import parallax_now

    bpy.ops.stereo_reproject.measure_depth()
    scene.stereo_reproject.headset = "vr180"
    assert parallax_now(scene) == []
    for name in ("measure_depth", "fit_to_comfort", "set_convergence"):
        assert not getattr(bpy.ops.stereo_reproject, name).poll()
    scene.stereo_reproject.headset = "camera"
    assert parallax_now(scene)


def test_esc_puts_an_eyedropper_away_before_it_ends_a_job(extension, monkeypatch):
    from stereo_reproject_extension.operators import jobs, screen_here

    pressed, released, other = (
        SimpleNamespace(type=kind, value=value)
        for kind, value in (("ESC", "PRESS"), ("ESC", "RELEASE"), ("A", "PRESS"))
    )
    assert [jobs.ends_job(event) for event in (pressed, released, other)] == [True, False, False]
    monkeypatch.setattr(screen_here, "_out", ["stereo_reproject.set_screen_here"])
    assert not jobs.ends_job(pressed)
