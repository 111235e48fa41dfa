"""Probes in real renders: the two traces of a pixel know nothing of each other, and a mirror is found."""

from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

from stereo_reproject.blender.commands.frame import render_files
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.output.pictures import COLOURS, read_png
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.images.metrics import noise_ratio, tone
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.images.reasons import Reason
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from stereo_reproject.settings.tuning import TUNING
from stereo_reproject.trace.requests import TraceRequest
from tests.blender.toolbox import (
    Material,
    add_camera,
    add_plane,
    add_sphere,
    diffuse,
    empty_scene,
    noise_image,
    set_background,
)

SIZE = (160, 90)

THREE_LINES = 3 * 26
"""Of a legend, in pixels."""

CORRELATION = 0.05
"""Of the noise of two traces of the same pixel: five standard errors of the correlation over a frame's 14 400."""


@pytest.fixture
def scene(tmp_path):
    """A textured wall under a bright sky, and a mirror ball before it. No lamp: its reflection would be fireflies."""
    scene = empty_scene(*SIZE, samples=16)
    set_background(scene, 1.0)
    add_plane(scene, diffuse(image=noise_image(tmp_path)), size=(30, 20), location=(0, 0, -9), rotation=(-0.4, 0, 0))
    mirror = Material("mirror")
    mirror.surface(mirror.node("BsdfGlossy", Roughness=0.02))
    add_sphere(scene, mirror, radius=1.4, location=(0.3, 0.2, -6.0))
    add_camera(scene, interocular=0.4)
    return scene


def scrambled_at_no_distance(scene):
    """All pixels have one sequence of random numbers."""
    scene.cycles.sampling_pattern, scene.cycles.scrambling_distance = "TABULATED_SOBOL", 0.0


def guided(scene):
    """All pixels sample by what all have learned."""
    scene.cycles.use_guiding, scene.cycles.guiding_training_samples = True, 2


@pytest.mark.parametrize(
    ("method", "change"),
    [
        ("packed", None),
        ("card", None),
        ("packed", scrambled_at_no_distance),
        ("packed", guided),
    ],
)
def test_the_two_traces_of_a_pixel_are_independent(scene, tmp_path, method, change):
    """Were their noise alike, (a - b)^2 would say that there is less of it, and every warp would seem wrong."""
    everything = np.ones(SIZE[::-1], bool)
    if change is not None:
        change(scene)
    with working_scene(scene, SceneOverrides(samples=4)) as working:
        renderer = BlenderRenderer(working, tmp_path)
        traced = tone(renderer.trace(method, [TraceRequest("right", everything, everything)])[0][COLOUR_PASS])
        # These are to be as good as the mean of many pixels.
        working.cycles.scrambling_distance = 1.0
        whole = [TraceRequest("right", everything)] * 2
        others = [tone(passes[COLOUR_PASS]) for passes in renderer.trace("full", whole)]
    once, again = traced[: everything.size], traced[everything.size :]
    # The true colour cancels in both differences, and what they share is what the two traces share.
    shared = np.mean((once - others[0]) * (again - others[1]))
    assert abs(shared) < CORRELATION * np.mean((once - again) ** 2) / 2.0


def test_a_mirror_is_found_and_traced(scene, tmp_path):
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path)
        assert renderer.plan.view_dependent == ("material 'mirror' on 'Sphere'",)
        frame = render_stereo_frame(renderer, StereoSettings(fill="packed"))
        everything = np.ones(SIZE[::-1], bool)
        whole = [TraceRequest("right", everything)] * 2
        traces = [passes[COLOUR_PASS] for passes in renderer.trace("full", whole)]
    reference, again = (trace.reshape(*SIZE[::-1], -1) for trace in traces)
    assert ((frame.reasons & Reason.REFINED.bit) > 0).any()
    told = frame.refinement.estimate
    assert told is not None
    measured = noise_ratio(frame.eyes["right"][COLOUR_PASS], reference, again)
    draft = StereoSettings(fill="packed", accuracy="draft")
    with working_scene(scene, SceneOverrides()) as working:
        warped = render_stereo_frame(BlenderRenderer(working, tmp_path), draft)
    assert measured < 1.25
    assert noise_ratio(warped.eyes["right"][COLOUR_PASS], reference, again) > measured + 0.2


def test_the_estimate_is_told_tile_by_tile(scene, tmp_path, monkeypatch):
    """What the promise leaves warped shows in the map; what was traced is 1."""
    # A ball of so few pixels has too few tiles of the usual size to be sure of any.
    small = replace(TUNING, tile_scale_limits=(1.0 / 3.0, 4.0 / 3.0))
    monkeypatch.setattr("stereo_reproject.settings.accuracy.TUNING", small)
    # Allowed so much, most of the mirror stays.
    told, picture, holes = told_by_files(scene, tmp_path / "loose", tolerance=9.0)
    assert np.isfinite(told["Noise Ratio"]).all()
    assert (told["Noise Ratio"][holes] == 1.0).all()
    wrong = (told["Noise Ratio"] > 1.1) & (told["Noise Ratio Low"] > 1.0)
    # Of the few tiles beside the mirror one may well be beyond its interval of 95 %.
    ball = np.zeros_like(holes)
    ball[20:70, 55:125] = True
    assert wrong[ball & ~holes].mean() > 0.15 > 0.1 > wrong[:, :40].mean()
    colours = np.abs(np.diff(picture, axis=-1)).max(axis=-1)
    assert colours[wrong].mean() > 2.0 * colours[~wrong & ~holes].mean()

    told, _, holes = told_by_files(scene, tmp_path / "draft", accuracy="draft")
    legend = read_png(tmp_path / "draft" / "out" / "estimate.png")[SIZE[1] :]
    assert len(legend) > THREE_LINES, "it says why there is no estimate, and that is a sentence"
    assert np.isnan(told["Noise Ratio High"][~holes]).all()
    assert (told["Noise Ratio High"][holes] == 1.0).all()


def told_by_files(scene, folder, **settings):
    """The channels of estimate.exr by name, estimate.png without its legend, and what was traced."""
    folder.mkdir()
    render_files(scene, StereoSettings(fill="packed", **settings), folder)
    out = folder / "out"
    with OpenEXR.File(str(out / "estimate.exr"), separate_channels=True) as file:
        channels = {name.removesuffix(".X"): np.array(channel.pixels) for name, channel in file.channels().items()}
    traced = np.zeros(SIZE[::-1], bool)
    dimmed = read_png(out / "holes.png")[: SIZE[1]]
    for colour in COLOURS.values():
        traced |= np.all(np.rint(dimmed * 255) == colour, axis=-1)
    return channels, read_png(out / "estimate.png")[: SIZE[1]], traced
