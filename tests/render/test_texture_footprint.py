"""What reads ray differentials looks the same in traced pixels as in a plain render (Wissmann et al., section 3.4).

A packed pixel has strangers for neighbours, and must yet carry the footprint of one pixel of the target. In Cycles it
is read by Bump, whose height is sampled one footprint away; by Wireframe in pixels; and by image textures only where
they are tiled and have mip levels (in newer versions), not where they are read whole, as the one here is: that it comes
out right says that a packed pixel is filtered as a plain one is, not that its footprint is right. Bevel reads none.
"""

import math
from dataclasses import dataclass

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.engines.packed_trace import CAMERAS, trace_packed
from stereo_reproject.blender.engines.packed_views import PackedPixels
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.images.metrics import tone
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.settings.frame import SceneOverrides
from stereo_reproject.trace.requests import TraceRequest
from tests.blender.toolbox import (
    Material,
    add_camera,
    add_plane,
    add_sun,
    diffuse,
    empty_scene,
    noise_image,
    set_background,
)
from tests.render.ruler import TARGET, plain_renders
from tests.render.test_fill import blocker

pytestmark = pytest.mark.slow

WIDTH, HEIGHT, SAMPLES = 160, 88, 16
TILE = 4
SEEDS = (101, 102, 103, 104, 105, 106)

AS_FAR = 1.15
"""How much farther than a plain render the traced one may be from the mean of other plain renders, in the rms of tile
means. Plain renders themselves come to 0.89 to 1.07."""

AS_FAR_AT_WORST = 1.3
"""The same at the 99th percentile of the 880 tiles, which rests on nine of them: plain renders come to 0.88 to 1.12."""

TOLD_APART = 1.25
"""What AS_FAR limits is this at the least for half the footprint. Measured: 1.34 (bump) and 8.4 (wireframe)."""

MEAN = 4.0
"""Standard errors of the mean over the frame."""


def bump() -> Material:
    """Rough to the utmost, and finer than a pixel in the distance: the footprint decides how rough it looks."""
    material = Material("bump")
    height, node = material.node("TexNoise", Scale=9.0, Detail=6.0), material.node("Bump", Strength=1.0, Distance=0.4)
    material.link(material.node("NewGeometry").outputs["Position"], height.inputs["Vector"])
    material.link(height.outputs[0], node.inputs["Height"])
    shader = material.node("BsdfDiffuse")
    material.link(node.outputs[0], shader.inputs["Normal"])
    return material.surface(shader)


def wireframe() -> Material:
    """Lines two pixels wide, wherever they are."""
    material = Material("wireframe")
    wire, shader = material.node("Wireframe", Size=2.0), material.node("BsdfDiffuse")
    wire.use_pixel_size = True
    material.link(wire.outputs[0], shader.inputs["Color"])
    return material.surface(shader)


@dataclass(frozen=True)
class Surface:
    """reads: whether what it looks like depends on the footprint."""

    name: str
    reads: bool

    def __str__(self):
        return self.name


SURFACES = [Surface("bump", True), Surface("wireframe", True), Surface("image", False)]


def floor(folder, surface) -> bpy.types.Scene:
    """It is seen at a grazing angle, up to where a pixel covers much of it."""
    scene = empty_scene(WIDTH, HEIGHT, samples=SAMPLES)
    # With it a picture of twice the size, averaged, is the same picture.
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 1.0
    # Blue noise correlates neighbours in the picture that is rendered, and packed pixels have other neighbours.
    scene.cycles.sampling_pattern = "TABULATED_SOBOL"
    materials = {"bump": bump, "wireframe": wireframe}
    material = materials[surface.name]() if surface.reads else diffuse(image=noise_image(folder, size=512))
    item = add_plane(scene, material, size=(30, 40), location=(0, -0.7, -20), rotation=(-math.pi / 2, 0, 0))
    subdivide(item, 5)
    add_sun(scene, rotation=(-1.0, 0.5, 0.0))
    set_background(scene, 0.3)
    add_camera(scene)
    return scene


def subdivide(item: bpy.types.Object, levels: int) -> None:
    """Into a grid of 2^levels squares a side, so that there are edges to see."""
    modifier = item.modifiers.new("Subdivision", "SUBSURF")
    modifier.subdivision_type, modifier.levels, modifier.render_levels = "SIMPLE", levels, levels


def tile_means(picture):
    """Of a tone-mapped picture (H, W, 3): the means (n, m, 3) of its tiles."""
    height, width = picture.shape[:2]
    shape = (height // TILE, TILE, width // TILE, TILE, -1)
    return tone(picture).reshape(shape).mean(axis=(1, 3), dtype=np.float64)


def distances(ours, renders):
    """(n, m): how far each tile's mean is from that of the plain renders."""
    others = np.mean([tile_means(render) for render in renders], axis=0)
    return np.sqrt(np.mean((tile_means(ours) - others) ** 2, axis=-1))


@dataclass(frozen=True)
class Figures:
    """rms and 99th percentile of the distances, over what they are for a plain render; mean in standard errors."""

    rms: float
    worst: float
    mean: float


def held_against(ours, renders) -> Figures:
    """A plain render is held against the others, ours against the same number of them."""
    own, plain = [], []
    for k in range(len(renders)):
        others = np.delete(renders, k, axis=0)
        own.append(distances(ours, others))
        plain.append(distances(renders[k], others))
    own, plain = np.stack(own), np.stack(plain)
    means = tone(renders).mean(axis=(1, 2), dtype=np.float64)
    # The spread of means of so few renders is itself noisy: it is taken from the pixels.
    error = math.sqrt(tone(renders).var(axis=0, ddof=1, dtype=np.float64).mean() / renders[0][..., 0].size)
    off = np.abs(tone(ours).mean(axis=(0, 1), dtype=np.float64) - means.mean(axis=0)).max()
    return Figures(
        float(np.sqrt(np.mean(own**2) / np.mean(plain**2))),
        float(np.percentile(own, 99.0) / np.percentile(plain, 99.0)),
        float(off / (error * math.sqrt(1.0 + 1.0 / len(renders)))),
    )


def in_any_order(working, folder, packed_by):
    """Every pixel of the target, at a random place of the packed picture."""
    renderer = BlenderRenderer(working, folder)
    places = np.argwhere(np.ones((HEIGHT, WIDTH), bool))
    order = np.random.default_rng(7).permutation(len(places))
    pixels = PackedPixels(renderer.cameras[TARGET], places[order])
    _, (passes,) = trace_packed(working, TARGET, pixels.camera, [pixels], folder, seed=1, by=CAMERAS[packed_by])
    result = np.empty((HEIGHT * WIDTH, 3), np.float32)
    result[order] = passes[COLOUR_PASS][:, :3]
    return result.reshape(HEIGHT, WIDTH, 3)


def by_osl(working, folder):
    return in_any_order(working, folder, "osl")


def by_portal(working, folder):
    return in_any_order(working, folder, "portal")


def behind_the_card(working, folder):
    everything = TraceRequest(TARGET, np.ones((HEIGHT, WIDTH), bool))
    traced = BlenderRenderer(working, folder).trace("card", [everything])
    return traced[0][COLOUR_PASS][:, :3].reshape(HEIGHT, WIDTH, 3)


@pytest.fixture(scope="module", params=SURFACES, ids=str)
def case(request, tmp_path_factory):
    """The surface, its scene, a folder, and plain renders of the target."""
    folder = tmp_path_factory.mktemp("case")
    scene = floor(folder, request.param)
    return request.param, scene, folder, plain_renders(scene, folder, seeds=SEEDS)


@pytest.mark.parametrize("trace", [by_osl, by_portal, behind_the_card])
def test_traced_pixels_have_the_footprint_of_plain_ones(case, trace):
    surface, scene, folder, renders = case
    if trace is by_portal and surface.name == "wireframe":
        assert "wireframe" in blocker(scene, folder, "portal")
        return
    with working_scene(scene, SceneOverrides()) as working:
        ours = trace(working, folder)
    figures = held_against(ours, renders)
    assert figures.rms < AS_FAR, figures
    assert figures.worst < AS_FAR_AT_WORST, figures
    assert figures.mean < MEAN, figures


@pytest.mark.parametrize(("lens", "blocks"), [(24.0, False), (18.0, True)])
def test_bumps_are_not_traced_by_a_portal_where_pixels_differ_much(tmp_path, lens, blocks):
    scene = floor(tmp_path, SURFACES[0])
    scene.camera.data.lens = lens
    assert ("bumps" in (blocker(scene, tmp_path, "portal") or "")) == blocks
    assert blocker(scene, tmp_path, "osl") is None


def test_another_footprint_would_be_seen(case):
    """The same picture with half the footprint: rendered at twice the size and averaged, and so less noisy.

    Without the terms of hole_camera.osl that keep the derivatives, packed pixels came to 19 (bump) and 21 (wireframe);
    with four times the derivatives to 4.0 and 25.
    """
    surface, scene, folder, renders = case
    scene.render.resolution_x, scene.render.resolution_y = 2 * WIDTH, 2 * HEIGHT
    larger = plain_renders(scene, folder, seeds=(7,))[0]
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    figures = held_against(larger.reshape(HEIGHT, 2, WIDTH, 2, 3).mean(axis=(1, 3)), renders)
    if surface.reads:
        assert figures.rms > TOLD_APART, figures
        assert figures.mean > MEAN, figures
    else:
        assert figures.rms < AS_FAR, figures
