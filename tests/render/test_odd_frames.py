"""Frames that are hard as a whole: a floor up to the horizon, black, sky alone, all hole, and an outlier on a probe."""

import numpy as np
import pytest

from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.pipeline.stereo_frame import traced_fractions
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from tests.blender.toolbox import Material, add_camera, add_plane, colour, diffuse, empty_scene, set_background
from tests.render import hard_scenes
from tests.render.ruler import TARGET, measured_noise_ratio, on_screen, plain_renders, render_frame

pytestmark = pytest.mark.slow

AS_GOOD = 1.1
"""Noise ratio, where nothing but the warp can be wrong: the promise of `balanced`."""


def add_mirror_out_of_sight(scene):
    """It is far behind all else, but in the cameras' view, and so calls for probes."""
    material = Material("mirror")
    material.surface(material.node("BsdfGlossy", Roughness=0.0))
    return add_plane(scene, material, size=(0.1, 0.1), location=(0.0, 0.0, -90.0))


def ratio(frame, renders, where=None):
    return measured_noise_ratio(colour(frame.eyes[TARGET]), renders, where=where)


# A checkerboard floor at the horizon

HORIZON_TRACED = 0.1
"""Share of a floor without a single depth edge that may be traced: the frame's border, the horizon and the probes."""


@pytest.mark.parametrize("probed", [False, True])
def test_a_checkerboard_floor_is_warped_up_to_the_horizon(tmp_path, probed):
    """Its squares become finer than a pixel, and looking up between pixels must not be punished for it."""
    scene = hard_scenes.room(tmp_path)
    hard_scenes.checkerboard(scene)
    # With others, loud probes at the horizon have up to half of so small a picture traced.
    scene.cycles.seed = 4
    if probed:
        add_mirror_out_of_sight(scene)
    frame = render_frame(scene, tmp_path, fill="packed")
    assert (frame.refinement.estimate is not None) == probed
    assert ratio(frame, plain_renders(scene, tmp_path)) <= AS_GOOD
    assert frame.traced.mean() <= HORIZON_TRACED


# Black, sky, all hole


@pytest.mark.parametrize("accuracy", ["draft", "balanced", "exact"])
def test_a_black_frame_is_black(tmp_path, accuracy):
    """No light, no noise, and no ratio to it."""
    scene = hard_scenes.room(tmp_path)
    hard_scenes.mirror(scene, tmp_path)
    set_background(scene, 0.0)
    scene.objects["Lamp"].hide_render = True
    frame = render_frame(scene, tmp_path, accuracy=accuracy, fill="packed")
    for passes in frame.eyes.values():
        assert not passes[COLOUR_PASS][..., :3].any()
    assert not frame.refinement.pixels.any()
    told = frame.refinement.estimate
    if accuracy == "draft":
        assert told is None
    else:
        assert told is not None
        assert told.noise_ratio == 1.0
        assert np.isnan([told.low, told.high]).all(), "without noise there is nothing to compare with"


def sky(*, convergence):
    scene = empty_scene(hard_scenes.WIDTH, hard_scenes.HEIGHT, samples=hard_scenes.SAMPLES)
    hard_scenes.textured_sky(scene, scale=8.0)
    add_camera(scene, interocular=0.3, convergence=convergence)
    return scene


UNSEEN = 0.25 / 255.0
"""After tone mapping: a quarter of an 8-bit step. A smooth sky has hardly any noise to hold an error against."""


@pytest.mark.parametrize("probed", [False, True])
@pytest.mark.parametrize("convergence", [7.0, 6.3, 50.0])
def test_nothing_but_sky(tmp_path, convergence, probed):
    """It lies at infinity, in either eye in the same direction: convergence shifts it, and what comes in is traced."""
    scene = sky(convergence=convergence)
    if probed:
        add_mirror_out_of_sight(scene)
    frame = render_frame(scene, tmp_path, fill="packed")
    renders = plain_renders(scene, tmp_path)
    assert np.isposinf(frame.eyes[TARGET][DEPTH_PASS]).all()
    shift = hard_scenes.WIDTH * 35.0 / 36.0 * 0.3 / convergence
    outside = traced_fractions(frame)["outside"]
    assert outside == pytest.approx(shift / hard_scenes.WIDTH, abs=1.5 / hard_scenes.WIDTH)
    assert frame.traced.mean() <= outside + 0.02
    error = np.abs(np.mean(colour(frame.eyes[TARGET]) - renders.mean(axis=0), axis=-1))
    assert np.sqrt(np.mean(error**2)) <= UNSEEN


def eyes_too_far_apart(scene):
    """No target pixel shows what the source has seen."""
    scene.camera.data.stereo.convergence_mode = "PARALLEL"
    scene.camera.data.stereo.interocular_distance = 12.0
    for name in ("Floor", "Wall"):
        scene.objects[name].scale = (3.0, 3.0, 3.0)


def hand_before_the_source(scene):
    """A card that only the source sees, and that hides all else from it."""
    add_plane(scene, diffuse("hand"), size=(0.28, 0.2), location=(0.0, 0.0, -0.15))


@pytest.mark.parametrize("change", [eyes_too_far_apart, hand_before_the_source])
def test_a_frame_that_is_all_hole_is_rendered_plainly(tmp_path, change):
    scene = hard_scenes.room(tmp_path)
    add_mirror_out_of_sight(scene)
    change(scene)
    frame = render_frame(scene, tmp_path)
    assert frame.fill.method == "full"
    assert frame.refinement.fill is None
    assert frame.traced.all()
    assert ratio(frame, plain_renders(scene, tmp_path)) == pytest.approx(1.0, abs=0.03)


# A firefly on a probe


class OneFirefly(BlenderRenderer):
    """Blender's renderer, but for one probe, near a place, of which one trace comes out absurdly bright."""

    BRIGHT = 1000.0

    def __init__(self, scene, folder, *, near, trace):
        super().__init__(scene, folder)
        self.near, self.which = near, trace
        self.place = None

    def trace(self, method, requests):
        (passes,) = super().trace(method, requests)
        (request,) = requests
        pixels, twice = request.pixels, request.twice
        if twice is not None:
            probes = np.argwhere(twice)
            chosen = int(np.argmin(np.hypot(*(probes - self.near).T)))
            self.place = tuple(probes[chosen])
            place = {
                "first": int(np.count_nonzero(pixels.ravel()[: np.ravel_multi_index(self.place, pixels.shape)])),
                "second": int(pixels.sum()) + chosen,
            }
            passes[COLOUR_PASS][place[self.which], :3] = self.BRIGHT
        return [passes]


class FireflyInTheSource(BlenderRenderer):
    """Blender's renderer, but for some pixels of the source, side by side, so that a probe is sure to meet one."""

    def __init__(self, scene, folder, *, near):
        super().__init__(scene, folder)
        self.near = near

    def render_source(self, view, *, probed=True):
        passes, cost = super().render_source(view, probed=probed)
        row, column = self.near
        passes[COLOUR_PASS][row : row + 8, column : column + 8, :3] = 1000.0
        return passes, cost


ON_THE_WALL = (30, 200)

FEW_TILES = 25 * 64
"""Pixels that one outlier may have traced: 5 x 5 tiles, as far as tiles are judged by their neighbours'."""


def balanced(scene, renderer):
    return render_stereo_frame(renderer, StereoSettings(fill="packed"))


@pytest.mark.parametrize("trace", ["first", "second"])
def test_a_firefly_on_a_probe_refines_no_wall(tmp_path, trace):
    scene = hard_scenes.room(tmp_path)
    add_mirror_out_of_sight(scene)
    with working_scene(scene, SceneOverrides()) as working:
        frame = balanced(scene, OneFirefly(working, tmp_path, near=ON_THE_WALL, trace=trace))
    assert frame.refinement.pixels.sum() <= FEW_TILES
    told = frame.refinement.estimate
    assert told is not None
    assert told.low <= told.noise_ratio <= told.high


def test_a_firefly_in_the_source_refines_no_wall(tmp_path):
    scene = hard_scenes.room(tmp_path)
    add_mirror_out_of_sight(scene)
    with working_scene(scene, SceneOverrides()) as working:
        frame = balanced(scene, FireflyInTheSource(working, tmp_path, near=ON_THE_WALL))
    assert frame.refinement.evidence is not None
    assert frame.refinement.pixels.sum() <= FEW_TILES


@pytest.mark.parametrize("trace", ["first", "second"])
def test_a_firefly_on_a_probe_hides_no_error(tmp_path, trace):
    """A mirror is found and traced all the same."""
    scene = hard_scenes.room(tmp_path)
    region = on_screen(scene, hard_scenes.mirror(scene, tmp_path))
    with working_scene(scene, SceneOverrides()) as working:
        renderer = OneFirefly(working, tmp_path, near=ON_THE_WALL, trace=trace)
        frame = balanced(scene, renderer)
    undisturbed = render_frame(scene, tmp_path, fill="packed")
    # The firefly itself is a pixel of the result; what is asked here is what else it does.
    region[renderer.place] = False
    renders = plain_renders(scene, tmp_path)
    assert ratio(frame, renders, region) <= ratio(undisturbed, renders, region) + 0.1
