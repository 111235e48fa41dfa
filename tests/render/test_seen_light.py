"""A scene whose light and exposure are moved against each other is traced in the same pixels."""

from __future__ import annotations

import numpy as np
import pytest

from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.images.reasons import Reason
from tests.blender.toolbox import mirror_before_wall, set_background
from tests.render.ruler import TARGET, render_frame

STOPS = 6
ROUNDING = 1e-4
"""Cycles' own sums round differently once the light is another; the noise is some thousand times that."""


@pytest.fixture
def scene():
    scene = mirror_before_wall(64, 36, samples=4)
    # Cycles' own shortcuts go by raw light.
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0.0
    scene.cycles.light_sampling_threshold = 0.0
    return scene


@pytest.mark.parametrize("stops", [STOPS, -STOPS])
def test_more_light_and_less_exposure_change_no_decision(scene, tmp_path, stops):
    frames = []
    for light, exposure in ((1.0, 0.0), (2.0**stops, -stops)):
        set_background(scene, 0.5 * light)
        scene.objects["Sun"].data.energy = 3.0 * light
        scene.view_settings.exposure = exposure
        frames.append(render_frame(scene, tmp_path, fill="packed"))
    usual, other = frames
    assert (usual.reasons & Reason.REFINED.bit).any()
    assert other.light_scale * 2.0**stops == usual.light_scale
    np.testing.assert_array_equal(other.reasons, usual.reasons)
    ours, expected = (frame.eyes[TARGET][COLOUR_PASS][..., :3] for frame in (other, usual))
    np.testing.assert_allclose(ours, expected * 2.0**stops, rtol=ROUNDING)
