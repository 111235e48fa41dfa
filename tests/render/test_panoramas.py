"""Panoramic pairs: packed pixels are those that Blender's own multiview renders, and whole pairs are as good."""

import itertools
import math

import numpy as np
import pytest

from stereo_reproject.blender.engines import hole_camera, ray_camera
from stereo_reproject.blender.engines.hole_camera import compiled_shader
from stereo_reproject.blender.engines.mask_card import card_blocker
from stereo_reproject.blender.engines.packed_trace import CAMERAS, PANORAMA_CAMERAS
from stereo_reproject.blender.engines.renderer import BlenderRenderer, _warnings_between_eyes
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.errors import BadInputError, StereoReprojectError
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS, SKY_DEPTH_IN_FILES
from stereo_reproject.settings.frame import SceneOverrides
from stereo_reproject.trace.requests import TraceRequest
from tests.blender.scene.test_panoramas import DEGREE, LENSES, Lens, set_up
from tests.blender.toolbox import (
    EYES,
    FINEST_FILTER,
    Material,
    add_camera,
    add_cube,
    add_plane,
    add_sphere,
    colour,
    emission,
    empty_scene,
    keyframes,
    render_plain,
    rms,
    set_border,
)
from tests.render.test_fill import BIAS, NOISE
from tests.render.test_frame import render_pair, rgb, waves

SIZE = (128, 64)

POSITION = 1e-5
"""Relative to the distance: single precision, in which the table has the rays too."""

SOFTENED = 1.6
"""rms(ours - a) / rms(b - a), where all noise is that of the pixel filter, and no light's hides that a lookup between
pixels softens edges."""

DEPTH = 3e-3
"""Relative; depths of the ball's 32 x 16 faces and of small boxes are interpolated."""

NEAR_CLIP = 2.6
"""Scene units: there are boxes from 1.5 on."""

RIGHT_DEPTH = 0.9
"""Share of target pixels whose depth is that: the others lie on edges, and all of these boxes are small."""

UNSEEN_MOTION = 0.01
"""Pixels by which a vector may be off beyond noise: motion blur shows no hundredth of a pixel."""

MOST_TRACED = 0.45
"""Share of pixels that are traced: these pictures are small, and the edges of their boxes and lenses long."""

VECTORS = 2e-3
"""Pixels, and relative: where a pixel's only ray falls within it moves a vector by that."""

SPHERICAL = {
    "convergence_mode": "OFFAXIS",
    "use_spherical_stereo": True,
    "use_pole_merge": True,
    "pole_merge_angle_from": 60.0 * DEGREE,
    "pole_merge_angle_to": 75.0 * DEGREE,
}
STEREOS = {"spherical": SPHERICAL, "toe-in": {"convergence_mode": "TOE", "pivot": "CENTER"}}


@pytest.fixture
def scene(tmp_path):
    """Shining by itself: boxes all around the camera, within a ball."""
    scene = empty_scene(*SIZE, samples=16)
    scene.cycles.sampling_pattern = "TABULATED_SOBOL"
    add_sphere(scene, emission(image=waves(tmp_path, "ball", 0)), radius=9.0, location=(0.5, -0.3, 0.2))
    box = emission(image=waves(tmp_path, "box", 1))
    rng = np.random.default_rng(1)
    for place in itertools.product((-2.4, 0.2, 2.1), repeat=3):
        if np.linalg.norm(place) > 1.0:
            add_cube(scene, box, size=rng.uniform(0.4, 0.8), location=place, rotation=rng.uniform(0, 3, 3))
    add_camera(scene, interocular=0.065, convergence=2.5)
    scene.camera.location, scene.camera.rotation_euler = (0.1, -0.2, 0.15), (math.pi / 2, 0.0, 0.7)
    scene.camera.data.clip_start = 0.01
    return scene


@pytest.mark.parametrize("packed_by", PANORAMA_CAMERAS)
@pytest.mark.parametrize("stereo", STEREOS.values(), ids=STEREOS.keys())
@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_packed_pixels_are_blenders(scene, tmp_path, lens, stereo, packed_by):
    set_up(scene, lens, stereo)
    scene.cycles.filter_width, scene.cycles.samples = FINEST_FILTER, 1
    scene.view_layers[0].use_pass_position = True
    assert_packed_is_plain(scene, tmp_path, packed_by)


@pytest.mark.parametrize("packed_by", PANORAMA_CAMERAS)
@pytest.mark.parametrize("lens", ["VR180", "equidistant", "cylinder"])
def test_packed_pixels_where_the_near_clip_cuts(scene, tmp_path, lens, packed_by):
    """It is a distance from the eye, and boxes stand on either side of it."""
    set_up(scene, LENSES[lens], SPHERICAL)
    scene.cycles.filter_width, scene.cycles.samples = FINEST_FILTER, 1
    scene.view_layers[0].use_pass_position = True
    whole = render_plain(scene, tmp_path)["right"][DEPTH_PASS]
    scene.camera.data.clip_start = NEAR_CLIP
    cut = render_plain(scene, tmp_path)["right"][DEPTH_PASS]
    assert np.mean((whole > 0.0) & (whole < 0.99 * NEAR_CLIP)) > 0.02
    assert np.mean((cut > NEAR_CLIP) & (cut < 5.0)) > 0.05
    assert_packed_is_plain(scene, tmp_path, packed_by)


@pytest.mark.parametrize("packed_by", PANORAMA_CAMERAS)
def test_packed_pixels_of_a_perspective_camera_with_spherical_stereo(scene, tmp_path, packed_by):
    set_up(scene, LENSES["VR180"], SPHERICAL)
    data = scene.camera.data
    data.type, data.lens, data.clip_start = "PERSP", 12.0, 2.0
    scene.camera.rotation_euler.x = 1.2
    scene.cycles.filter_width, scene.cycles.samples = FINEST_FILTER, 1
    scene.view_layers[0].use_pass_position = True
    assert_packed_is_plain(scene, tmp_path, packed_by)


def assert_packed_is_plain(scene, folder, packed_by):
    plain = render_plain(scene, folder)
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, folder, packed_by=packed_by)
        assert renderer.fill_blockers()["packed"] is None
        for view, expected in plain.items():
            camera = renderer.cameras[view]
            shape = (camera.height, camera.width)
            (traced,) = renderer.trace("packed", [TraceRequest(view, np.ones(shape, bool))])
            traced = {name: image.reshape(*shape, -1) for name, image in traced.items()}
            hit = np.isfinite(expected[DEPTH_PASS][..., 0]) & (expected[DEPTH_PASS][..., 0] > 0.0)
            assert np.array_equal(hit, np.isfinite(traced[DEPTH_PASS][..., 0]) & (traced[DEPTH_PASS][..., 0] > 0.0))
            y, x = np.indices(shape) + 0.5
            depth = camera.pass_from_depth(x, y, traced[DEPTH_PASS][..., 0])
            off = np.linalg.norm(traced["Position"] - expected["Position"], axis=-1) / np.fmax(depth, 1e-6)
            # A ray that grazes an edge meets one side or the other.
            assert np.mean(off[hit] < POSITION) > 0.995
            close = hit & (off < POSITION)
            np.testing.assert_allclose(depth[close], expected[DEPTH_PASS][..., 0][close], rtol=10.0 * POSITION)
            assert rms((traced[COLOUR_PASS] - expected[COLOUR_PASS])[close]) < 1e-3


def defocus(scene):
    dof = scene.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 1.2, scene.camera.data.lens * 1e-3 / (2.0 * 0.15)
    dof.aperture_blades, dof.aperture_ratio, dof.aperture_rotation = 3, 2.0, 0.4


LOOKING = {**SPHERICAL, "use_pole_merge": False}
APART = {"convergence_mode": "PARALLEL", "pivot": "CENTER"}


@pytest.mark.parametrize("packed_by", PANORAMA_CAMERAS)
@pytest.mark.parametrize(
    ("lens", "stereo"),
    [("VR180", SPHERICAL), ("360", LOOKING), ("equidistant", SPHERICAL), ("cylinder", LOOKING), ("VR180", APART)],
)
def test_depth_of_field(scene, tmp_path, lens, stereo, packed_by):
    """An aperture of an odd shape: all noise is that of the lens."""
    set_up(scene, LENSES[lens], stereo)
    defocus(scene)
    scene.cycles.samples = 64
    assert_traced_is_as_good(scene, tmp_path, packed_by)


def test_without_its_lens_that_would_be_seen(scene, tmp_path):
    set_up(scene, LENSES["VR180"], SPHERICAL)
    scene.cycles.samples = 64
    sharp = colour(render_plain(scene, tmp_path)["right"])
    defocus(scene)
    first, second = (colour(render_plain(scene, tmp_path, seed=seed)["right"]) for seed in (101, 102))
    assert rms(sharp - first) > 2.0 * rms(second - first)
    scene.camera.data.dof.aperture_rotation += 1.0
    turned = colour(render_plain(scene, tmp_path, seed=103)["right"])
    assert rms(turned - first) > NOISE * rms(second - first)


def assert_traced_is_as_good(scene, folder, packed_by, noise=NOISE):
    """All pixels of an eye are traced in two random halves, as strangers to each other: ours is to a plain render as
    another plain render is."""
    first, second = (render_plain(scene, folder, seed=seed)["right"] for seed in (101, 102))
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, folder, packed_by=packed_by)
        assert renderer.fill_blockers()["packed"] is None
        height, width = first[COLOUR_PASS].shape[:2]
        half = np.random.default_rng(3).random((height, width)) < 0.5
        ours = np.zeros_like(first[COLOUR_PASS])
        for mask in (half, ~half):
            (traced,) = renderer.trace("packed", [TraceRequest("right", mask)])
            ours[mask] = traced[COLOUR_PASS]
    a, b, ours = colour(first), colour(second), ours[..., :3]
    assert rms(ours - a) < noise * rms(b - a)
    difference = ours - 0.5 * (a + b)
    spread = (b - a).reshape(-1, 3).std(axis=0) / np.sqrt(difference[..., 0].size)
    assert np.all(np.abs(difference.reshape(-1, 3).mean(axis=0)) < BIAS * spread)


NARROW = Lens("FISHEYE_EQUISOLID", {"fisheye_fov": 170.0 * DEGREE, "fisheye_lens": 20.0, "sensor_width": 30.0})
"""A fisheye whose edge is out of the picture."""
WITHOUT_EDGE = {"narrow": NARROW} | {name: lens for name, lens in LENSES.items() if name[:3] != "equ"}


@pytest.mark.parametrize("sky", [False, True], ids=["ball", "sky"])
@pytest.mark.parametrize("stereo", [SPHERICAL, STEREOS["toe-in"]], ids=STEREOS.keys())
@pytest.mark.parametrize("lens", WITHOUT_EDGE.values(), ids=WITHOUT_EDGE.keys())
def test_vectors_through_a_portal(scene, tmp_path, lens, stereo, sky):
    """The camera turns and moves, and so does a box, within a ball or before the sky."""
    set_up(scene, lens, stereo)
    scene.objects[0].hide_render = sky
    assert_vectors_are_plain(scene, tmp_path, moves=0.04 if sky else 0.5)  # 4.5 has no vectors of the sky.


def test_vectors_of_a_part_of_the_picture(scene, tmp_path):
    set_up(scene, LENSES["VR180"], SPHERICAL)
    set_border(scene, (0.25, 0.75, 0.2, 0.9))
    scene.render.use_crop_to_border = True
    assert_vectors_are_plain(scene, tmp_path)


def assert_vectors_are_plain(scene, folder, *, moves=0.5):
    scene.cycles.filter_width, scene.cycles.samples = FINEST_FILTER, 1
    scene.view_layers[0].use_pass_vector = True
    keyframes(scene.camera, "location", {0: (0.0, -0.2, 0.1), 1: (0.1, -0.2, 0.15), 2: (0.3, -0.1, 0.15)})
    keyframes(scene.camera, "rotation_euler", {0: (1.5, 0.0, 0.66), 1: (1.57, 0.0, 0.7), 2: (1.6, 0.05, 0.8)})
    keyframes(scene.objects[1], "location", {0: (-2.4, -2.2, -2.2), 1: (-2.2, -2.1, -2.2), 2: (-1.9, -2.0, -2.0)})
    plain = render_plain(scene, folder)
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, folder)
        assert renderer.fill_blockers()["packed"] is None
        for view, expected in plain.items():
            shape = renderer.cameras[view].height, renderer.cameras[view].width
            (traced,) = renderer.trace("packed", [TraceRequest(view, np.ones(shape, bool))])
            expected = expected["Vector"].reshape(-1, 4)
            moved = np.abs(expected).max(axis=-1) > 0.1
            assert moved.mean() > moves
            off = np.abs(traced["Vector"] - expected).max(axis=-1)
            near = off < VECTORS * (1.0 + np.abs(expected).max(axis=-1))
            assert near.mean() > 0.99


@pytest.mark.parametrize(
    ("lens", "stereo"), [("VR180", SPHERICAL), ("360", SPHERICAL), ("cylinder", SPHERICAL), ("VR180", APART)]
)
def test_vectors_of_a_pair(scene, tmp_path, lens, stereo):
    """Warped and traced ones, by the median and the ninth decile: beside edges two plain renders differ much. Beside
    the poles, where a pixel is a small angle and less is traced for it, the decile may be further off."""
    set_up(scene, LENSES[lens], stereo)
    scene.view_layers[0].use_pass_vector = True
    keyframes(scene.camera, "location", {0: (0.05, -0.2, 0.1), 1: (0.1, -0.2, 0.15), 2: (0.17, -0.18, 0.15)})
    keyframes(scene.camera, "rotation_euler", {0: (1.55, 0.0, 0.68), 1: (1.57, 0.0, 0.7), 2: (1.58, 0.01, 0.73)})
    first, second = (render_plain(scene, tmp_path, seed=seed)["right"]["Vector"] for seed in (101, 102))
    report, eyes = render_pair(scene, tmp_path, fill="packed")
    assert 0.0 < report["fractions"]["rerendered"] < MOST_TRACED
    ours = np.stack([eyes["right"][f"Vector.{part}"] for part in "XYZW"], axis=-1)
    off, noise = (np.abs(vector - first).max(axis=-1) for vector in (ours, second))
    assert np.median(np.abs(first).max(axis=-1)) > 100.0 * np.median(noise)
    assert np.median(off) < 1.3 * np.median(noise)
    rows = np.arange(len(off))
    polar = np.minimum(rows, rows[::-1]) < len(off) // 6
    assert np.percentile(off[~polar], 90) < 1.3 * np.percentile(noise[~polar], 90) + UNSEEN_MOTION
    assert np.percentile(off[polar], 90) < 1.5 * np.percentile(noise[polar], 90)


def test_the_aperture_of_turned_eyes_is_not_traced_packed(scene, tmp_path):
    set_up(scene, LENSES["VR180"], STEREOS["toe-in"])
    defocus(scene)
    for packed_by in PANORAMA_CAMERAS:
        found = blockers(scene, tmp_path, packed_by=packed_by)["packed"]
        assert found == "the lens has an aperture, and the eyes are turned"


@pytest.mark.parametrize("stereo", STEREOS.values(), ids=STEREOS.keys())
@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_a_pair(scene, tmp_path, lens, stereo):
    set_up(scene, lens, stereo)
    first, second = (render_plain(scene, tmp_path, seed=seed)["right"] for seed in (101, 102))
    report, eyes = render_pair(scene, tmp_path, fill="packed")
    assert report["fractions"]["rerendered"] < MOST_TRACED
    assert report["fill"]["camera"] == "osl"
    ours = rgb(eyes["right"])
    noise = rms(colour(second) - colour(first))
    assert rms(ours - colour(first)) < SOFTENED * noise
    depth, expected = eyes["right"]["Depth.Z"], first[DEPTH_PASS][..., 0]
    known = np.isfinite(expected) & (expected > 0.0)
    assert np.mean(np.abs(depth[known] / expected[known] - 1.0) < DEPTH) > RIGHT_DEPTH
    nothing = colour(first).max(axis=-1) + colour(second).max(axis=-1) == 0.0
    # Beside the lens a pixel may show a little of what it has within.
    assert np.mean(ours[nothing] > 0.0) < 0.02 if nothing.any() else True
    for view in ("left", "right"):
        assert not np.isnan(eyes[view]["Depth.Z"]).any()
    assert np.all(np.isposinf(expected[nothing]))
    assert np.all(depth[nothing] == SKY_DEPTH_IN_FILES)


@pytest.mark.parametrize(
    ("lens", "stereo"),
    [
        ("VR180", SPHERICAL),
        ("360", SPHERICAL),
        ("equidistant", SPHERICAL),
        ("cube face", SPHERICAL),
        ("VR180", STEREOS["toe-in"]),
    ],
)
def test_positions_of_a_pair(scene, tmp_path, lens, stereo):
    """Warped and traced ones are where multiview's are, and those of the other eye are not."""
    set_up(scene, LENSES[lens], stereo)
    scene.view_layers[0].use_pass_position = True
    plain = render_plain(scene, tmp_path)["right"]
    report, eyes = render_pair(scene, tmp_path, fill="packed")
    assert 0.0 < report["fractions"]["rerendered"] < MOST_TRACED
    depth = plain[DEPTH_PASS][..., 0]
    hit = np.isfinite(depth) & (depth > 0.0)
    ours, other = (np.stack([eyes[view][f"Position.{axis}"] for axis in "XYZ"], axis=-1) for view in ("right", "left"))
    off, unconverted = (np.linalg.norm(place - plain["Position"], axis=-1)[hit] / depth[hit] for place in (ours, other))
    assert np.median(off) < DEPTH
    assert np.mean(off < DEPTH) > RIGHT_DEPTH
    assert np.mean(unconverted < DEPTH) < 0.3


@pytest.mark.parametrize("packed_by", PANORAMA_CAMERAS)
def test_a_pair_of_a_perspective_camera_with_spherical_stereo(scene, tmp_path, packed_by):
    """Tilted: its eyes stand on a circle around the world's Z axis."""
    set_up(scene, LENSES["VR180"], SPHERICAL)
    data = scene.camera.data
    data.type, data.lens = "PERSP", 20.0
    scene.camera.rotation_euler.x = 0.5
    first, second = (render_plain(scene, tmp_path, seed=seed) for seed in (101, 102))
    report, eyes = render_pair(scene, tmp_path, fill="packed", packed_by=packed_by)
    assert report["fill"]["camera"] == packed_by
    assert 0.0 < report["fractions"]["rerendered"] < MOST_TRACED
    noise = rms(colour(second["right"]) - colour(first["right"]))
    assert rms(rgb(eyes["right"]) - colour(first["right"])) < SOFTENED * noise
    assert rms(colour(first["left"]) - colour(first["right"])) > 3.0 * noise
    depth, expected = eyes["right"]["Depth.Z"], first["right"][DEPTH_PASS][..., 0]
    assert np.mean(np.abs(depth / expected - 1.0) < DEPTH) > RIGHT_DEPTH


@pytest.mark.parametrize(("lens", "stereo"), [("VR180", SPHERICAL), ("360", SPHERICAL), ("VR180", STEREOS["toe-in"])])
def test_a_pair_by_a_portal(scene, tmp_path, lens, stereo):
    set_up(scene, LENSES[lens], stereo)
    first, second = (render_plain(scene, tmp_path, seed=seed)["right"] for seed in (101, 102))
    report, eyes = render_pair(scene, tmp_path, fill="packed", packed_by="portal")
    assert report["fill"]["camera"] == "portal"
    assert 0.0 < report["fractions"]["rerendered"] < MOST_TRACED
    assert rms(rgb(eyes["right"]) - colour(first)) < SOFTENED * rms(colour(second) - colour(first))
    depth, expected = eyes["right"]["Depth.Z"], first[DEPTH_PASS][..., 0]
    assert np.mean(np.abs(depth / expected - 1.0) < DEPTH) > RIGHT_DEPTH


def test_a_plain_render_after_a_trace_shows_nothing_of_the_portal(scene, tmp_path):
    """The near clip is as close as the eyes are to the camera, and then closer than the sheet stands."""
    set_up(scene, LENSES["VR180"], SPHERICAL)
    for clip_start in (2.0, 0.03, 0.0005):
        scene.camera.data.clip_start = 2.0
        with working_scene(scene, SceneOverrides()) as working:
            renderer = BlenderRenderer(working, tmp_path, packed_by="portal")
            renderer.trace("packed", [TraceRequest("right", np.ones((SIZE[1], SIZE[0]), bool))])
            working.camera.data.clip_start = scene.camera.data.clip_start = clip_start
            ours, _ = BlenderRenderer(working, tmp_path, packed_by="portal").render_source("left")
        plain = render_plain(scene, tmp_path, views=("left",))["left"]
        np.testing.assert_array_equal(ours[COLOUR_PASS], plain[COLOUR_PASS])


def test_a_moving_camera_is_blurred_by_both(scene, tmp_path):
    """The sheet stays before the camera while the shutter is open."""
    set_up(scene, LENSES["VR180"], SPHERICAL)
    scene.render.use_motion_blur, scene.cycles.samples = True, 64
    keyframes(scene.camera, "location", {0: (-0.2, -0.2, 0.1), 2: (0.4, -0.1, 0.15)})
    keyframes(scene.camera, "rotation_euler", {0: (1.5, 0.0, 0.6), 2: (1.6, 0.05, 0.8)})
    for packed_by in PANORAMA_CAMERAS:
        assert_traced_is_as_good(scene, tmp_path, packed_by)


def test_both_eyes_are_traced_in_one_render(scene, tmp_path):
    for stereo in (SPHERICAL, APART):
        set_up(scene, LENSES["VR180"], stereo)
        scene.cycles.samples = 16
        one, other = (render_plain(scene, tmp_path, seed=seed) for seed in (101, 102))
        for packed_by in PANORAMA_CAMERAS:
            with working_scene(scene, SceneOverrides()) as working:
                renderer = BlenderRenderer(working, tmp_path, packed_by=packed_by)
                every = np.ones((SIZE[1], SIZE[0]), bool)
                both = renderer.trace("packed", [TraceRequest(view, every) for view in EYES])
                assert len(renderer.trace_renders) == 1
            for view, traced in zip(EYES, both, strict=True):
                ours = traced[COLOUR_PASS][:, :3] - colour(one[view]).reshape(-1, 3)
                assert rms(ours) < NOISE * rms(colour(other[view]) - colour(one[view]))
                depth, expected = traced[DEPTH_PASS][:, 0], one[view][DEPTH_PASS].ravel()
                y, x = np.indices(every.shape).reshape(2, -1) + 0.5
                depth = renderer.cameras[view].pass_from_depth(x, y, depth)
                assert np.mean(np.abs(depth / expected - 1.0) < DEPTH) > RIGHT_DEPTH


def test_things_between_the_eyes_are_warned_of(scene, tmp_path):
    set_up(scene, LENSES["VR180"], SPHERICAL)
    scene.cycles.samples = 1
    scene.camera.data.stereo.interocular_distance = 4.0
    report, _ = render_pair(scene, tmp_path, fill="packed")
    assert any("nearer to the camera than its interocular distance" in line for line in report["warnings"])


def test_without_such_things_nothing_is_warned_of(scene, tmp_path):
    set_up(scene, LENSES["VR180"], SPHERICAL)
    scene.cycles.samples = 1
    report, _ = render_pair(scene, tmp_path, fill="packed")
    assert not any("interocular" in line for line in report["warnings"])


def test_of_perspective_cameras_the_distance_counts_not_the_depth(scene, tmp_path):
    """A wall in the corner of a wide picture is nearer than the eyes are apart by its depth alone."""
    scene = empty_scene(*SIZE, samples=1)
    add_plane(scene, emission(), size=(40.0, 40.0), location=(0.0, 0.0, -0.9))
    add_camera(scene, interocular=1.0, convergence=2.5)
    scene.camera.data.lens = 4.0
    scene.camera.data.stereo.use_spherical_stereo = True
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path)
        passes, _ = renderer.render_source("left")
        shown = renderer.cameras["left"]
        y, x = np.indices((SIZE[1], SIZE[0])) + 0.5
        near = shown.distance_from_depth(x, y, passes[DEPTH_PASS][..., 0]) < 1.0
        assert 0.0 < near.mean() < 0.2
        (told,) = renderer.warnings
        assert told.startswith(f"{near.mean():.1%} of the picture")


@pytest.mark.parametrize(("interocular", "told"), [(40.0, 1), (0.0, 0)])
def test_eyes_that_see_the_background_alone_are_warned_of(tmp_path, interocular, told):
    scene = empty_scene(*SIZE, samples=1)
    if interocular:
        add_plane(scene, emission(), size=(4, 4), location=(0, 0, -3))
    add_camera(scene, interocular=interocular, convergence=2.5)
    scene.camera.data.stereo.convergence_mode = "PARALLEL"
    with working_scene(scene, SceneOverrides(panorama="vr180", size=(32, 32))) as working:
        # At the poles merged eyes see what is below them.
        working.camera.data.stereo.use_pole_merge = False
        renderer = BlenderRenderer(working, tmp_path)
        renderer.render_source("left")
        assert ["background alone" in line for line in renderer.warnings] == [True] * told


def test_a_few_pixels_between_the_eyes_are_not_warned_of():
    assert _warnings_between_eyes(0.0004) == []
    (told,) = _warnings_between_eyes(0.0005)
    assert not told.startswith("0.0%")


@pytest.mark.parametrize("space", [("CAMERA", "WORLD"), ("OBJECT", "CAMERA"), None], ids=str)
def test_shaders_that_read_the_camera_are_not_traced_packed(scene, tmp_path, space):
    set_up(scene, LENSES["VR180"], SPHERICAL)
    assert blockers(scene, tmp_path, packed_by="osl")["packed"] is None
    nodes = scene.camera.users_scene[0].objects[0].active_material.node_tree.nodes
    if space is None:
        nodes.new("ShaderNodeScript")
    else:
        node = nodes.new("ShaderNodeVectorTransform")
        node.convert_from, node.convert_to = space
    assert blockers(scene, tmp_path, packed_by="osl")["packed"] == "a shader reads camera coordinates"
    assert blockers(scene, tmp_path)["packed"] is None, "a portal's camera is a panorama, too"


@pytest.mark.parametrize("output", ["Camera", "View Vector", "View Z Depth", "View Distance"])
def test_a_portal_shows_camera_coordinates(scene, tmp_path, output):
    set_up(scene, LENSES["VR180"], SPHERICAL)
    material = Material("camera")
    node = material.node("TexCoord" if output == "Camera" else "CameraData")
    divided = material.node("VectorMath")
    divided.operation, divided.inputs[1].default_value = "DIVIDE", (5.0, 5.0, 5.0)
    shining = material.node("Emission")
    material.link(node.outputs[output], divided.inputs[0])
    material.link(divided.outputs[0], shining.inputs["Color"])
    material.surface(shining)
    for item in scene.objects:
        if item.type == "MESH":
            item.data.materials[0] = material.block
    assert_traced_is_as_good(scene, tmp_path, "portal")


@pytest.mark.parametrize(("size", "blocked"), [(0.13, True), (0.01, False), (2.0, False)])
def test_eyes_in_a_volume_in_which_the_camera_is_not(scene, tmp_path, size, blocked):
    """A small cube of fog some centimetres beside the camera, where the eyes come by; farther away; or around it."""
    set_up(scene, LENSES["VR180"], SPHERICAL)
    scene.camera.data.stereo.interocular_distance = 0.2
    fog = Material("fog")
    fog.link(fog.node("VolumeScatter").outputs[0], fog.output.inputs["Volume"])
    beside = 0.0 if size > 1.0 else 0.16
    x, y, z = scene.camera.location
    add_cube(scene, fog, size=size, location=(x + beside, y, z))
    expected = "an eye may begin in a volume" if blocked else None
    assert blockers(scene, tmp_path)["packed"] == expected


@pytest.mark.parametrize("lens", ["equidistant", "equisolid"])
def test_guides_at_the_edge_of_the_lens_through_a_portal(scene, tmp_path, lens):
    """The sheet's part of what guides the denoiser is taken out where rays go through it: on the edge as far as chance
    has it, since of those that lie within the lens the share alone is known. 4.5 tells nothing of gloss."""
    set_up(scene, LENSES[lens], SPHERICAL)
    material = Material("gloss")
    glossy = material.node("BsdfAnisotropic")
    glossy.inputs["Color"].default_value, glossy.inputs["Roughness"].default_value = (0.6, 0.6, 0.6, 1.0), 0.0
    material.surface(glossy)
    for item in scene.objects[1:]:
        if item.type == "MESH":
            item.data.materials[0] = material.block
    scene.cycles.samples = 64
    scene.view_layers[0].cycles.denoising_store_passes = True
    plain = render_plain(scene, tmp_path, views=("right",))["right"]
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path, packed_by="portal")
        (traced,) = renderer.trace("packed", [TraceRequest("right", np.ones((SIZE[1], SIZE[0]), bool))])
        y, x = np.indices((SIZE[1], SIZE[0])) + 0.5
        around = [renderer.cameras["right"].within_lens(x + a, y + b) for a in (-1.5, 1.5) for b in (-1.5, 1.5)]
    inside, beyond = np.min(around, axis=0) > 0.0, np.max(around, axis=0) < 0.0
    for guide in {"Denoising Specular Albedo", "Denoising Albedo", "Denoising Depth"} & plain.keys():
        ours = traced[guide].reshape(plain[guide].shape)
        off = (ours - plain[guide]) / plain[guide].max()
        assert ours.min() > -1e-6
        assert np.abs(off[beyond]).max() < 1e-6
        for part, noise in ((inside, 0.01), (~inside & ~beyond, 0.03)):
            assert rms(off[part]) < noise
            assert abs(off[part].mean()) < 0.3 * noise


def test_an_edge_of_the_lens_shows_the_portal_in_passes_of_surfaces(scene, tmp_path):
    reason = "the lens has an edge, at which passes of surfaces would show the portal"
    surroundings = "use_pass_mist", "use_pass_ambient_occlusion"
    for switch in ("use_pass_normal", "use_pass_vector", "use_pass_cryptomatte_object", *surroundings):
        set_up(scene, LENSES["equidistant"], SPHERICAL)
        assert blockers(scene, tmp_path, packed_by="portal")["packed"] is None
        setattr(scene.view_layers[0], switch, True)
        assert blockers(scene, tmp_path, packed_by="portal")["packed"] == reason
        set_up(scene, NARROW, SPHERICAL)
        assert blockers(scene, tmp_path, packed_by="portal")["packed"] is None
        setattr(scene.view_layers[0], switch, False)


@pytest.mark.parametrize(("place", "blocked"), [((0, 0, 60), True), ((0, -80, 0), True), ((20, 0, 0), False)])
def test_what_is_beyond_the_clip_end_is_not_seen_by_a_portal(scene, tmp_path, place, blocked):
    set_up(scene, LENSES["360"], SPHERICAL)
    scene.camera.data.clip_end = 30.0
    add_cube(scene, emission(), size=1.0, location=place).name = "Far"
    expected = "'Far' may be seen beyond the camera's clip end" if blocked else None
    assert blockers(scene, tmp_path, packed_by="portal")["packed"] == expected


def test_a_near_clip_without_room_for_the_portal(scene, tmp_path):
    set_up(scene, LENSES["360"], SPHERICAL)
    scene.camera.data.clip_start, scene.camera.location.x = 0.001, 400.0
    expected = "the near clip is too close to the camera for the portal to be before it"
    assert blockers(scene, tmp_path, packed_by="portal")["packed"] == expected


def test_costs_of_the_packed_camera_are_its_own(scene, tmp_path):
    set_up(scene, LENSES["VR180"], SPHERICAL)
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path)
        assert renderer.packed.name == "osl"
        assert renderer.packed_by not in CAMERAS


def test_spherical_stereo_that_an_orthographic_camera_keeps_blocks_no_card(scene):
    set_up(scene, LENSES["VR180"], SPHERICAL)
    assert card_blocker(scene) == "a card cannot stand before each ray of a panorama"
    scene.camera.data.type = "PERSP"
    assert card_blocker(scene) == "a card cannot stand before each ray of a panorama"
    scene.camera.data.type = "ORTHO"
    assert card_blocker(scene) is None


def test_a_compiler_that_fails_is_told_of_with_a_way_out(monkeypatch):
    import _cycles

    monkeypatch.setattr(_cycles, "osl_compile", lambda *_: False)
    compiled_shader.cache_clear()
    for shader, fill in ((hole_camera.SHADER, "card"), (ray_camera.SHADER, "full")):
        with pytest.raises(StereoReprojectError, match=f"{shader.name}: use --fill {fill}"):
            compiled_shader(shader, "BOX", 1.0)


def blockers(scene, folder, **options):
    with working_scene(scene, SceneOverrides()) as working:
        return BlenderRenderer(working, folder, **options).fill_blockers(8.0)


def test_pole_limits_that_cross_are_refused(scene, tmp_path):
    crossing = {**SPHERICAL, "pole_merge_angle_from": 75.0 * DEGREE, "pole_merge_angle_to": 60.0 * DEGREE}
    set_up(scene, LENSES["VR180"], crossing)
    with pytest.raises(BadInputError, match=r"starts at 75° and ends at 60°: set its end above its start"):
        render_pair(scene, tmp_path, fill="packed")
