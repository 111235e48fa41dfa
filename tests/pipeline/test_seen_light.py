"""A scene lit 2^k times as brightly is treated alike to the bit, and its pair is exactly 2^k times as bright."""

from __future__ import annotations

import numpy as np
import pytest

from stereo_reproject.images.passes import COLOUR_PASS, NOISY_PASS
from stereo_reproject.images.reasons import Reason
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.views.frustum import Lens
from tests.pipeline.test_pipeline import Caster, Denoiser, caster, polished, settings


class LitCaster(Caster):
    """A ray caster whose light is multiplied by `light`, in renders and in traces."""

    light = 1.0

    def picture(self, view, seed):
        passes = {name: image.copy() for name, image in super().picture(view, seed).items()}
        passes[COLOUR_PASS][..., :3] *= np.float32(self.light)
        if NOISY_PASS in passes:
            passes[NOISY_PASS] = passes[COLOUR_PASS]
        passes["Emit"] = 0.25 * passes[COLOUR_PASS][..., :3]
        return passes


def pair(light: float, *, denoised: bool, accuracy: str = "balanced", blurred: bool = False):
    usual = caster(noise=0.05)
    renderer = LitCaster(usual.world, usual.cameras, noise=0.05, view_dependent=("mirror",), spoil=polished("left"))
    renderer.light = light
    if denoised:
        renderer.denoise = Denoiser()
    if blurred:
        renderer.lens = Lens(aperture=0.02, focus=4.0)
    return render_stereo_frame(renderer, settings(accuracy=accuracy))


@pytest.mark.parametrize(
    "options",
    [
        {"denoised": False},
        {"denoised": True},
        {"denoised": False, "accuracy": "high", "blurred": True},
    ],
    ids=["noisy", "denoised", "blurred"],
)
def test_light_times_a_power_of_two_changes_no_decision(options):
    usual = pair(1.0, **options)
    assert ((usual.reasons & Reason.REFINED.bit) > 0).any()
    for stops in range(-10, 11):
        frame = pair(2.0**stops, **options)
        np.testing.assert_array_equal(frame.reasons, usual.reasons)
        np.testing.assert_array_equal(frame.traced, usual.traced)
        assert frame.refinement.estimate == usual.refinement.estimate
        assert frame.light_scale * 2.0**stops == usual.light_scale
        for eye, passes in frame.eyes.items():
            for name in (COLOUR_PASS, "Emit"):
                light, expected = passes[name], usual.eyes[eye][name]
                np.testing.assert_array_equal(light[..., :3], expected[..., :3] * np.float32(2.0**stops))
            np.testing.assert_array_equal(passes[COLOUR_PASS][..., 3], usual.eyes[eye][COLOUR_PASS][..., 3])
            np.testing.assert_array_equal(passes["Depth"], usual.eyes[eye]["Depth"])
