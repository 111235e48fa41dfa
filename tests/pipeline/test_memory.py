"""Memory that the pipeline's own stages take beside the pictures that they are given, in bytes per pixel."""

import tracemalloc

import numpy as np
import pytest

from stereo_reproject.estimate.probes import place_random_probes
from stereo_reproject.images.contrast import Contrast, contrast_of
from stereo_reproject.images.sharpness import pixel_noise, sharpness_of
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.pipeline.onlooker import Onlooker
from stereo_reproject.pipeline.stopwatch import Stopwatch
from stereo_reproject.views.camera import ViewPlane
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import EquiangularCubeFace, Equirectangular
from stereo_reproject.views.spherical import SphericalStereo
from tests.pipeline.test_pipeline import IPD, ROOM, Caster, settings
from tests.warp.analytic import stereo_rig

SIZE = (960, 540)
PIXELS = SIZE[0] * SIZE[1]

MAX_AT_PEAK = {"warp": 140.0, "composite": 110.0, "account": 140.0}
"""Bytes per pixel of stages in which nothing is rendered. They were 126, 99 and 128 when bands were brought in, and
203, 171 and 215 before. The source's passes are 25 of them; a colour in float64 would add 24."""

MAX_HELD_WHILE_TRACING = 85.0
"""Bytes per pixel: the passes of both eyes are 50 of the 77 that were measured, the map of the warp is 12. With all
that only tells holes it was 125."""

MAX_WORKING = {"contrast": 36.0, "sharpness": 50.0, "probes": 9.0}
"""Bytes per pixel beside the pictures that are given, a sixth of which is the band's share at this size. They were 30,
43 and 7, and 96, 97 and 69 in whole pictures."""


@pytest.fixture(autouse=True)
def traced_memory():
    tracemalloc.start()
    yield
    tracemalloc.stop()


def bytes_per_pixel(work):
    """Peak of what a function takes beyond what is held as it begins, its result among it."""
    before = tracemalloc.get_traced_memory()[0]
    tracemalloc.reset_peak()
    work()
    return (tracemalloc.get_traced_memory()[1] - before) / PIXELS


class Meter:
    """Bytes per pixel at the peak of each stage, beyond what is held before the first, and at its beginning."""

    def __init__(self):
        self.peaks, self.held = {}, {}
        self.before = tracemalloc.get_traced_memory()[0]
        self.stage = None

    def begin(self, stage):
        held, peak = ((size - self.before) / PIXELS for size in tracemalloc.get_traced_memory())
        self.peaks[self.stage], self.held[stage] = peak, held
        tracemalloc.reset_peak()
        self.stage = stage


def panoramic(projection):
    """Both eyes of spherical stereo with this projection, as large as those of `stereo_rig`."""
    window, offsets = ViewPlane(0.0, 1.0, 0.0, 1.0), {"left": -0.5 * IPD, "right": 0.5 * IPD}
    return {
        view: PanoramicCamera(*SIZE, np.eye(4), window, projection, SphericalStereo(offset, 4.0))
        for view, offset in offsets.items()
    }


RIGS = {
    "perspective": stereo_rig(SIZE, ipd=IPD, convergence=4.0),
    "rows of a panorama": panoramic(Equirectangular((-1.5, 1.5), (-0.8, 0.8))),
    "quads of a panorama": panoramic(EquiangularCubeFace()),
}


@pytest.mark.parametrize("rig", RIGS.values(), ids=RIGS.keys())
def test_the_memory_of_a_frame_s_own_stages(rig):
    renderer = Caster(ROOM, rig, noise=0.02, view_dependent=("mirrors",))
    meter = Meter()
    render_stereo_frame(renderer, settings(), watch=Stopwatch(Onlooker(meter.begin)))
    meter.begin("end")
    excess = {stage: meter.peaks[stage] for stage, limit in MAX_AT_PEAK.items() if not meter.peaks[stage] <= limit}
    assert excess == {}, "more at its peak than it has to"
    assert meter.held["fill"] <= MAX_HELD_WHILE_TRACING


def test_the_memory_of_what_looks_at_the_whole_picture():
    rng = np.random.default_rng(0)
    colour = rng.uniform(0.0, 1.0, (SIZE[1], SIZE[0], 4)).astype(np.float32)
    known = rng.random(colour.shape[:2]) < 0.95
    x, y = (np.broadcast_to(at, known.shape).astype(np.float32) for at in np.ogrid[0.5 : SIZE[1], 0.7 : SIZE[0]][::-1])
    contrast = Contrast(colour[..., 0].copy(), colour[..., 1].copy())
    took = {
        "contrast": bytes_per_pixel(lambda: contrast_of(colour, known)),
        "sharpness": bytes_per_pixel(lambda: sharpness_of(pixel_noise(colour), colour, colour, x, y)),
        "probes": bytes_per_pixel(lambda: place_random_probes(known, spacing=16, seed=1, contrast=contrast)),
    }
    assert {name: size for name, size in took.items() if size > MAX_WORKING[name]} == {}
