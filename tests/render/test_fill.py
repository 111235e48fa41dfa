"""What is traced for the holes is what a plain render of that eye would show there: no bias, and no more noise.

Each variant of the scene is rendered twice by Blender's own multiview, with two seeds (a, b), and all pixels of the
target eye are traced, in two random halves, with a third. Then ours is to a as b is to a.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.engines.mask_card import trace_card
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.rig import stereo_cameras
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.images.masks import dilate
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.settings.frame import SceneOverrides
from stereo_reproject.trace.requests import TraceRequest
from tests.blender.toolbox import (
    FINEST_FILTER,
    Material,
    SceneChange,
    add,
    add_camera,
    add_cube,
    add_plane,
    add_sphere,
    add_sun,
    diffuse,
    emission,
    empty_scene,
    evaluated_camera,
    keyframes,
    noise_image,
    pixel_centres,
    px_from_world,
    render_plain,
    rms,
    set_background,
    set_border,
)

WIDTH, HEIGHT = 96, 54
LIT_SAMPLES, SHINING_SAMPLES = 32, 64
TILE = 6
PACKED = ("osl", "portal")
METHODS = (*PACKED, "card")
"""The packed method by each of its cameras, and the card."""
GRAIN = {"osl": 1, "portal": 1, "card": 12}
"""Pixels along the side of what is traced at a time: packed, each has strangers for neighbours; the card opens some
pixels more than it must, and stays closed only over larger parts."""
TARGET = "right"

BIAS = 4.0
"""Standard errors of the mean, per channel: passed by chance once in 16 000 times, and the seeds are fixed."""

NOISE = 1.1
"""rms(ours - a) / rms(b - a). A few pixels on edges make most of it: two seeds of the plain render gave up to 1.05."""

TILE_NOISE = 1.3
"""The same for the means of 6 x 6 tiles, in which local bias adds up and noise does not. There are 144 tiles in a
picture: two seeds of the plain render gave up to 1.2."""

ANIMATED_NOISE = 1.25
"""As NOISE, over half of the pixels. What is of the wrong frame gave 5 and more."""

PIXELS = 0.005
"""With one sample, all that a pixel shows is what lies at its centre: the rest is single precision, which 500 units
from the origin comes to 0.002 px."""

PASS_VALUES = 1e-4
"""In units of the scene, for passes that Cycles takes from the first sample: single precision at a distance of 10."""

CARD_REACH = 5
"""Pixels beyond a hole that the card may leave open: twice the reach of the pixel filter, and rounding."""

FRAME_EDGE = 2
"""Pixels of the frame's edge: the reach of the pixel filter there."""


EDGE_PIXELS = 0.002
"""Share of pixels whose centre may lie on an edge to within rounding, and see the other side of it."""


# The scene and what is done to it


def studio(folder, *, lit):
    """A floor, a wall, a box and a ball with rough textures: lit, with the noise of light, or shining by themselves,
    where all noise is that of the pixel filter, the lens and the shutter."""
    scene = empty_scene(WIDTH, HEIGHT, samples=LIT_SAMPLES if lit else SHINING_SAMPLES)
    # Blue noise correlates neighbours in the picture that is rendered, and packed pixels have other neighbours.
    scene.cycles.sampling_pattern = "TABULATED_SOBOL"
    paint = diffuse if lit else emission
    floor, wall, box = (noise_image(folder, seed=k, size=32, name=f"noise {k}") for k in range(3))
    ground = add_plane(scene, paint(image=floor), size=(14, 14), location=(0, -1.2, -6))
    ground.rotation_euler.x = -math.pi / 2
    ground.name = "Floor"
    add_plane(scene, paint(image=wall), size=(16, 9), location=(0, 2, -10)).name = "Wall"
    add_cube(scene, paint(image=box), size=1.2, location=(-1.0, -0.3, -5)).name = "Box"
    add_sphere(scene, paint(colour=(0.9, 0.5, 0.3)), radius=0.6, location=(1.1, 0.0, -4.5)).name = "Ball"
    if lit:
        add_sun(scene)
    set_background(scene, 0.5)
    add_camera(scene)
    return scene


def pixel_filter(kind, width):
    def change(scene):
        scene.cycles.pixel_filter_type, scene.cycles.filter_width = kind, width

    change.__name__ = f"{kind.lower()}_{width}"
    return change


def as_it_is(scene):
    pass


def bump(scene):
    material = Material("bumped")
    noise = material.node("TexNoise", Scale=12.0)
    node = material.node("Bump", Strength=1.0, Distance=0.5)
    shader = material.node("BsdfDiffuse")
    material.link(noise.outputs[0], node.inputs["Height"])
    material.link(node.outputs[0], shader.inputs["Normal"])
    material.surface(shader)
    for item in scene.objects:
        if item.type == "MESH":
            item.data.materials[0] = material.block


def defocus(scene):
    dof = scene.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 4.5, 0.05
    dof.aperture_blades, dof.aperture_ratio, dof.aperture_rotation = 5, 1.7, 0.4


def defocus_on_an_object(scene):
    defocus(scene)
    toe_in(scene)
    target = add(scene, bpy.data.objects.new("Target", None))
    target.location = (1.0, 0.0, -4.5)
    scene.camera.data.dof.focus_object = target


def moving_object(scene):
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.8
    for name in ("Box", "Ball"):
        x, y, z = scene.objects[name].location
        keyframes(scene.objects[name], "location", {0: (x, y, z), 2: (x + 2.0, y + 0.3, z + 1.0)})


def moving_camera(scene):
    scene.render.use_motion_blur = True
    keyframes(scene.camera, "location", {0: (0.0, 0.0, 0.0), 2: (0.6, 0.1, -0.5)})
    keyframes(scene.camera, "rotation_euler", {0: (0.0, 0.0, 0.0), 2: (0.02, 0.1, 0.1)})


def moving_camera_that_is_not_blurred(scene):
    moving_camera(scene)
    scene.camera.cycles.use_motion_blur = False


def moving_parent_of_the_camera(scene):
    scene.render.use_motion_blur, scene.render.motion_blur_position = True, "START"
    parent = add(scene, bpy.data.objects.new("Parent", None))
    parent.scale = (1.5, 1.5, 1.5)
    scene.camera.parent = parent
    keyframes(parent, "location", {0: (0.0, 0.0, 0.0), 2: (0.6, 0.1, -0.5)})


def rolling_shutter(scene):
    moving_camera(scene)
    scene.cycles.rolling_shutter_type, scene.cycles.rolling_shutter_duration = "TOP", 0.1


def film_exposure(scene):
    scene.cycles.film_exposure = 2.5


def transparent_film(scene):
    scene.render.film_transparent = True
    bpy.data.objects.remove(scene.objects["Wall"])


def shadow_catcher(scene):
    scene.render.film_transparent = True
    scene.objects["Floor"].is_shadow_catcher = True


def holdout(scene):
    transparent_film(scene)
    scene.objects["Box"].is_holdout = True


def near_clip_cuts(scene):
    scene.camera.data.clip_start = 4.7


def lens_shift(scene):
    scene.camera.data.shift_x, scene.camera.data.shift_y = 0.2, -0.1


def toe_in(scene):
    scene.camera.data.stereo.convergence_mode = "TOE"


def pivot_in_the_centre(scene):
    scene.camera.data.stereo.pivot = "CENTER"


def border(scene):
    set_border(scene, (0.25, 0.8, 0.1, 0.65))
    scene.render.use_crop_to_border = True


def wide_pixels(scene):
    scene.render.pixel_aspect_x = 2.0


def camera_in_the_world(scene):
    scene.camera.location, scene.camera.rotation_euler = (0.4, 0.3, 1.0), (0.1, -0.15, 0.3)
    scene.camera.scale = (2.0, 0.5, 3.0)


def far_away_with_a_close_clip(scene):
    """A few hundred units from the origin, where single precision resolves 3e-5."""
    for item in scene.objects:
        item.location.x += 500.0
    scene.camera.data.clip_start = 0.001


def camera_in_fog(scene):
    fog = Material("fog")
    fog.link(fog.node("VolumeScatter", Density=0.1).outputs[0], fog.output.inputs["Volume"])
    add_cube(scene, fog, size=24.0, location=(0, 0, 0))


def glass_ball(scene):
    glass = Material("glass")
    scene.objects["Ball"].data.materials[0] = glass.surface(glass.node("BsdfGlass", Roughness=0.0)).block


def adaptive_sampling(scene):
    scene.cycles.use_adaptive_sampling, scene.cycles.adaptive_threshold = True, 0.05


def transparent_layers(scene):
    """As many as light may pass on its way, one behind the other."""
    clear = Material("clear")
    clear.surface(clear.node("BsdfTransparent", Color=(0.9, 0.9, 0.7, 1.0)))
    scene.cycles.transparent_max_bounces = 3
    for layer in range(3):
        add_plane(scene, clear, size=(3, 3), location=(0.2, 0.1 * layer, -3.5 - 0.1 * layer))


def hidden_from_the_camera(scene):
    scene.objects["Box"].visible_camera = False


def material_override(scene):
    override = emission("override", image=bpy.data.images["noise 1.png"])
    scene.view_layers[0].material_override = override.block


def shader_that_counts_transparent_surfaces(scene):
    counting = Material("counting")
    shader = counting.node("Emission")
    path = counting.node("LightPath")
    counting.link(path.outputs["Transparent Depth"], shader.inputs["Strength"])
    scene.objects["Box"].data.materials[0] = counting.surface(shader).block


def shader_that_knows_the_camera(scene):
    """Distance to the camera, view vector and camera coordinates, all in one colour."""
    knowing = Material("knowing")
    shader = knowing.node("Emission")
    camera, combine = knowing.node("CameraData"), knowing.node("CombineXYZ")
    path, add_vectors = knowing.node("LightPath"), knowing.node("VectorMath")
    knowing.link(camera.outputs["View Z Depth"], combine.inputs[0])
    knowing.link(camera.outputs["View Distance"], combine.inputs[1])
    knowing.link(path.outputs["Ray Length"], combine.inputs[2])
    knowing.link(combine.outputs[0], add_vectors.inputs[0])
    knowing.link(knowing.node("TexCoord").outputs["Camera"], add_vectors.inputs[1])
    knowing.link(add_vectors.outputs[0], shader.inputs["Color"])
    knowing.surface(shader)
    for name in ("Box", "Floor"):
        scene.objects[name].data.materials[0] = knowing.block


def orthographic(scene):
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 5.0


def orthographic_and_defocused(scene):
    orthographic(scene)
    defocus(scene)
    scene.camera.data.dof.aperture_fstop = 2.0


def window_coordinates(scene):
    material = Material("window")
    shader = material.node("Emission")
    material.link(material.node("TexCoord").outputs["Window"], shader.inputs["Color"])
    scene.objects["Box"].data.materials[0] = material.surface(shader).block


def far_clip_cuts(scene):
    scene.camera.data.clip_end = 9.0


@dataclass(frozen=True)
class Variant:
    """lit: light has its noise too. blocked: methods that must say that they can't do this."""

    change: SceneChange
    lit: bool = False
    blocked: tuple[str, ...] = ()

    def __str__(self):
        return self.change.__name__


VARIANTS = [
    Variant(as_it_is, lit=True),
    Variant(as_it_is),
    Variant(pixel_filter("BLACKMAN_HARRIS", 3.0)),
    Variant(pixel_filter("GAUSSIAN", 2.2)),
    Variant(pixel_filter("GAUSSIAN", 0.7)),
    Variant(pixel_filter("BOX", 1.5)),
    Variant(bump, lit=True),
    Variant(defocus),
    Variant(defocus_on_an_object),
    Variant(moving_object),
    Variant(moving_camera),
    Variant(moving_parent_of_the_camera),
    Variant(moving_camera_that_is_not_blurred),
    Variant(rolling_shutter, blocked=PACKED),
    Variant(film_exposure),
    Variant(transparent_film, lit=True),
    Variant(shadow_catcher, lit=True),
    Variant(holdout, lit=True),
    Variant(near_clip_cuts, lit=True),
    Variant(far_clip_cuts, blocked=PACKED),
    Variant(lens_shift),
    Variant(toe_in),
    Variant(pivot_in_the_centre),
    Variant(border),
    Variant(wide_pixels),
    Variant(camera_in_the_world),
    Variant(far_away_with_a_close_clip),
    # Where Cycles guides the rays of a camera in a volume, a portal makes them noisier.
    Variant(camera_in_fog, lit=True, blocked=("portal",) if bpy.app.version >= (5, 0, 0) else ()),
    Variant(glass_ball, lit=True),
    Variant(adaptive_sampling, lit=True),
    Variant(transparent_layers),
    Variant(hidden_from_the_camera, lit=True),
    Variant(material_override, blocked=("portal", "card")),
    Variant(shader_that_counts_transparent_surfaces, blocked=("portal", "card")),
    Variant(shader_that_knows_the_camera),
    Variant(window_coordinates, blocked=PACKED),
    Variant(orthographic, blocked=("osl",)),
    Variant(orthographic_and_defocused, blocked=("osl",)),
]


@dataclass(frozen=True)
class Case:
    variant: Variant
    scene: bpy.types.Scene
    folder: Path
    a: np.ndarray
    b: np.ndarray


@pytest.fixture(scope="module", params=VARIANTS, ids=str)
def case(request, tmp_path_factory):
    """A variant and its two plain renders, which all methods are held against."""
    variant = request.param
    folder = tmp_path_factory.mktemp("case")
    scene = studio(folder, lit=variant.lit)
    variant.change(scene)
    a, b = (render_plain(scene, folder, seed=seed, views=(TARGET,))[TARGET][COLOUR_PASS] for seed in (1, 2))
    scene.cycles.seed = 3
    return Case(variant, scene, folder, a, b)


def fill_method(method):
    """Blender's eye is traced so: the fill method, and the packed camera."""
    return ("packed", method) if method in PACKED else (method, "auto")


def trace(working, folder, method, view, pixels):
    """The passes (N, C) of these pixels of the view."""
    fill, packed_by = fill_method(method)
    return BlenderRenderer(working, folder, packed_by=packed_by).trace(fill, [TraceRequest(view, pixels)])[0]


def trace_in_halves(scene, folder, method, view):
    """Every pixel of the view, traced by the method in two random halves, as passes (H, W, C)."""
    result = {}
    with working_scene(scene, SceneOverrides()) as working:
        camera = BlenderRenderer(working, folder).cameras[view]
        half = random_half((camera.height, camera.width), grain=GRAIN[method])
        for pixels in (half, ~half):
            for name, values in trace(working, folder, method, view, pixels).items():
                whole = result.setdefault(name, np.full((*pixels.shape, values.shape[1]), np.nan, np.float32))
                whole[pixels] = values
    return result


def random_half(shape, *, grain):
    blocks = np.random.default_rng(5).random((-(-shape[0] // grain), -(-shape[1] // grain))) < 0.5
    return np.kron(blocks, np.ones((grain, grain), bool))[: shape[0], : shape[1]]


def blocker(scene, folder, method, deepest=10.0):
    fill, packed_by = fill_method(method)
    with working_scene(scene, SceneOverrides()) as working:
        return BlenderRenderer(working, folder, packed_by=packed_by).fill_blockers(deepest)[fill]


def tile_means(picture):
    height, width = (side // TILE * TILE for side in picture.shape[:2])
    tiles = picture[:height, :width].reshape(height // TILE, TILE, width // TILE, TILE, -1)
    return tiles.mean(axis=(1, 3), dtype=np.float64)


def bias(ours, a, b):
    """How many standard errors the mean of ours is off, in the worst channel, alpha included."""
    error = (b - a).std(axis=(0, 1), dtype=np.float64) / math.sqrt(a.shape[0] * a.shape[1])
    difference = np.abs((ours - 0.5 * (a + b)).mean(axis=(0, 1), dtype=np.float64))
    return float(np.max(difference / np.maximum(error, 1e-6)))


@pytest.mark.parametrize("method", METHODS)
def test_traced_as_rendered(case, method):
    reason = blocker(case.scene, case.folder, method)
    if method in case.variant.blocked:
        assert reason
        return
    assert reason is None
    a, b = case.a, case.b
    ours = trace_in_halves(case.scene, case.folder, method, TARGET)[COLOUR_PASS]
    assert ours.shape == a.shape
    assert bias(ours, a, b) < BIAS
    assert rms(ours - a) < NOISE * rms(b - a)
    assert rms(tile_means(ours - a)) < TILE_NOISE * rms(tile_means(b - a))


CARD_PLACES = [
    as_it_is,
    lens_shift,
    toe_in,
    pivot_in_the_centre,
    border,
    wide_pixels,
    camera_in_the_world,
    far_away_with_a_close_clip,
    moving_camera,
    orthographic,
]


@pytest.mark.parametrize("view", ["left", "right"])
@pytest.mark.parametrize("change", CARD_PLACES)
def test_the_card_closes_what_is_not_traced(tmp_path, change, view):
    """Else it would be right and not cheap. Beyond the filter's reach of a hole, nothing but holdout is seen."""
    scene = studio(tmp_path, lit=False)
    change(scene)
    scene.cycles.samples = 4
    with working_scene(scene, SceneOverrides()) as working:
        camera = BlenderRenderer(working, tmp_path).cameras[view]
        pixels = random_half((camera.height, camera.width), grain=GRAIN["card"])
        rendered, _ = trace_card(working, view, pixels, tmp_path, seed=1)
    closed = ~dilate(pixels, CARD_REACH)
    # The filter of the outermost pixels reaches past the card's edge.
    closed[:FRAME_EDGE] = closed[-FRAME_EDGE:] = closed[:, :FRAME_EDGE] = closed[:, -FRAME_EDGE:] = False
    assert closed.mean() > 0.05
    leaking = np.any(rendered.views[view][COLOUR_PASS][closed] != 0.0, axis=-1)
    assert leaking.mean() == 0.0


FRAME = 20


def test_card_in_focus_at_another_frame(tmp_path):
    """The card stands where the rays of a pixel meet: at the focus as it is in the frame that is rendered."""
    scene = studio(tmp_path, lit=False)
    defocus_on_an_object(scene)
    keyframes(scene.camera.data.dof.focus_object, "location", {1: (0.0, 0.0, -1.0), FRAME: (0.0, 0.0, -9.0)})
    scene.frame_set(1)
    with working_scene(scene, SceneOverrides(frame=FRAME)) as working:
        renderer = BlenderRenderer(working, tmp_path)
        camera = renderer.cameras[TARGET]
        pixels = random_half((camera.height, camera.width), grain=GRAIN["card"])
        ours = renderer.trace("card", [TraceRequest(TARGET, pixels)])[0][COLOUR_PASS]
    scene.frame_set(FRAME)
    a, b = (render_plain(scene, tmp_path, seed=seed, views=(TARGET,))[TARGET][COLOUR_PASS] for seed in (1, 2))
    assert rms(ours - a[pixels]) < NOISE * rms((b - a)[pixels])


def animate(item, path, first, last):
    """Keys for frame 1 and for FRAME; the path may lead through structs of the item."""
    *structs, name = path.split(".")
    struct = item
    for step in structs:
        struct = getattr(struct, step)
    for frame, value in ((1, first), (FRAME, last)):
        setattr(struct, name, value)
        item.keyframe_insert(path, frame=frame)


def shifting_lens(scene):
    animate(scene.camera.data, "shift_x", 0.0, 0.2)


def driven_shift(scene):
    driver = scene.camera.data.driver_add("shift_y").driver
    driver.type, driver.expression = "SCRIPTED", "0.005 * frame"


def opening_aperture(scene):
    defocus(scene)
    animate(scene.camera.data, "dof.aperture_fstop", 0.5, 0.03)


def moving_clip(scene):
    animate(scene.camera.data, "clip_start", 0.1, 4.7)


def zooming_out_of_focus(scene):
    defocus(scene)
    animate(scene.camera.data, "lens", 35.0, 70.0)


def widening_filter(scene):
    animate(scene, "cycles.filter_width", 1.5, 4.0)


@pytest.mark.parametrize("standing", [1, FRAME])
@pytest.mark.parametrize(
    "change", [shifting_lens, driven_shift, opening_aperture, moving_clip, zooming_out_of_focus, widening_filter]
)
def test_animated_settings_of_the_camera(tmp_path, change, standing):
    """What is traced is the frame that was asked for, wherever the user's scene stands."""
    scene = studio(tmp_path, lit=False)
    change(scene)
    scene.frame_set(standing)
    traced = {}
    for method in METHODS:
        if method == "portal" and change is widening_filter:
            assert "animated" in blocker(scene, tmp_path, method)
            continue
        with working_scene(scene, SceneOverrides(frame=FRAME)) as working:
            camera = BlenderRenderer(working, tmp_path).cameras[TARGET]
            pixels = random_half((camera.height, camera.width), grain=GRAIN["card"])
            traced[method] = trace(working, tmp_path, method, TARGET, pixels)[COLOUR_PASS]
    scene.frame_set(FRAME)
    a, b = (render_plain(scene, tmp_path, seed=seed, views=(TARGET,))[TARGET][COLOUR_PASS] for seed in (1, 2))
    noise = rms((b - a)[pixels])
    ratios = {method: round(rms(colour - a[pixels]) / noise, 2) for method, colour in traced.items()}
    assert {method for method, ratio in ratios.items() if ratio > ANIMATED_NOISE} == set(), ratios


def test_one_method_leaves_nothing_to_the_next(tmp_path):
    """In any order, and twice: each traces as in a scene of its own."""
    scene = studio(tmp_path, lit=False)
    traced = []
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path)
        camera = renderer.cameras[TARGET]
        pixels = random_half((camera.height, camera.width), grain=GRAIN["card"])
        for method in ("osl", "portal", "card", "full", "portal", "card", "osl", "portal", "full"):
            passes = trace(working, tmp_path, method, TARGET, pixels)
            traced.append((method, passes[COLOUR_PASS]))
            # Blender crashes here when it still has what a method has removed.
            assert BlenderRenderer(working, tmp_path).plan == renderer.plan
    a, b = (render_plain(scene, tmp_path, seed=seed, views=(TARGET,))[TARGET][COLOUR_PASS] for seed in (1, 2))
    noise = rms((b - a)[pixels])
    ratios = [(method, round(rms(colour - a[pixels]) / noise, 2)) for method, colour in traced]
    assert max(ratio for _, ratio in ratios) < ANIMATED_NOISE, ratios


# Exactness: one sample, no noise


def shine_by_position(scene):
    """Paint everything with the colour of where it is, + 20 to keep it positive: a picture of the points hit."""
    paint = Material("position")
    shader, shifted = paint.node("Emission"), paint.node("VectorMath")
    shifted.inputs[1].default_value = (20.0, 20.0, 20.0)
    paint.link(paint.node("NewGeometry").outputs["Position"], shifted.inputs[0])
    paint.link(shifted.outputs[0], shader.inputs["Color"])
    paint.surface(shader)
    for item in scene.objects:
        if item.type == "MESH":
            item.data.materials[0] = paint.block


def off_centre(camera, points, hit):
    """How far from its pixel's centre each point that was hit is projected, in pixels."""
    x, y, _ = px_from_world(camera, points)
    centre_x, centre_y = pixel_centres(hit.shape)
    return np.hypot(x - centre_x, y - centre_y)[hit]


GEOMETRIES = [
    as_it_is,
    near_clip_cuts,
    lens_shift,
    toe_in,
    pivot_in_the_centre,
    border,
    wide_pixels,
    camera_in_the_world,
    far_away_with_a_close_clip,
    orthographic,
]


@pytest.mark.parametrize("view", ["left", "right"])
@pytest.mark.parametrize("change", GEOMETRIES)
@pytest.mark.parametrize("method", METHODS)
def test_a_traced_pixel_shows_its_own_centre(tmp_path, method, change, view):
    scene = studio(tmp_path, lit=False)
    change(scene)
    if change is orthographic and method == "osl":
        assert blocker(scene, tmp_path, method)
        return
    shine_by_position(scene)
    scene.cycles.samples, scene.cycles.filter_width = 1, FINEST_FILTER
    scene.view_layers[0].use_pass_position = True
    passes = trace_in_halves(scene, tmp_path, method, view)
    camera = stereo_cameras(evaluated_camera(scene), scene.render)[view]
    hit = np.isfinite(passes[DEPTH_PASS][..., 0])
    assert hit.mean() > 0.5
    assert off_centre(camera, passes[COLOUR_PASS][..., :3] - 20.0, hit).max() < PIXELS
    assert off_centre(camera, passes["Position"], hit).max() < PIXELS


SINGLE_SAMPLE_PASSES = ("position", "normal", "uv", "object_index", "material_index", "mist", "z")


@pytest.fixture(scope="module")
def passes_of_a_sample(tmp_path_factory):
    """One sample of the studio with every pass: the scene, its folder, and a plain render."""
    folder = tmp_path_factory.mktemp("passes")
    scene = studio(folder, lit=True)
    for name in SINGLE_SAMPLE_PASSES:
        setattr(scene.view_layers[0], f"use_pass_{name}", True)
    for index, item in enumerate(scene.objects):
        item.pass_index = index
        if item.type == "MESH":
            item.data.materials[0].pass_index = 10 + index
    scene.cycles.filter_width, scene.cycles.samples = FINEST_FILTER, 1
    return scene, folder, render_plain(scene, folder, views=(TARGET,))[TARGET]


@pytest.mark.parametrize("method", METHODS)
def test_other_passes_are_those_of_a_plain_render(passes_of_a_sample, method):
    scene, folder, plain = passes_of_a_sample
    ours = trace_in_halves(scene, folder, method, TARGET)
    assert set(ours) == set(plain)
    for name in set(ours) - {COLOUR_PASS}:
        with np.errstate(invalid="ignore"):
            differs = (np.abs(ours[name] - plain[name]) > PASS_VALUES) & (ours[name] != plain[name])
        assert differs.any(axis=-1).mean() <= EDGE_PIXELS, name
