"""The gain that is predicted for a full render: by a check of the scene, or by its last preview."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy

from ..stereo_reproject.blender.scene.rendered import CYCLES
from ..stereo_reproject.report.verdict import full_render_gain
from ..stereo_reproject.words import Words
from .headset import region_to_render
from .results import result_of

LEAST_GAIN = 1.05
"""Least predicted gain over multiview that counts as one."""

LEAST_SHOWN_SPAN = 0.1
"""Difference of two predicted gains from which both are shown: they have one decimal."""


def full_gain_of(scene: bpy.types.Scene) -> float | None:
    """Return how many times as fast as multiview the scene's full render is predicted to be, by a check of the scene as
    it is, or else by its last preview; None where its last pair is no preview.
    """
    result = result_of(scene)
    if result.report is None or result.delivery is None or not result.delivery.preview:
        return None
    found = result.inspection
    # Without a sketch nothing is known of the seconds, and the gain is a guess.
    if found is not None and found["predicted"]["total_seconds"] is not None and is_current(scene, found):
        gain = found["predicted"]["gain"]
        return 0.5 * (gain["low"] + gain["high"])
    region = region_to_render(scene)
    return full_render_gain(result.report, (region.width, region.height), _samples(scene, result.report["engine"]))


def is_current(scene: bpy.types.Scene, found: Mapping[str, Any]) -> bool:
    """Return whether the findings of a check, `found`, are for the scene's present frame, size, samples and
    accuracy.
    """
    region = region_to_render(scene)
    now = (scene.frame_current, [region.width, region.height], scene.stereo_reproject.accuracy)
    return (found["frame"], found["size"], found["accuracy"]) == now and found["samples"] == _samples(
        scene, found["engine"]
    )


def _samples(scene: bpy.types.Scene, engine: str) -> int:
    """Return the samples per pixel that the scene asks of this engine."""
    return scene.cycles.samples if engine == CYCLES else scene.eevee.taa_render_samples


def gain_words(predicted: Mapping[str, Any]) -> str:
    """Return a line about the gain over multiview that a check predicts; `predicted` is the part of that name of its
    findings.
    """
    low, high = predicted["gain"]["low"], predicted["gain"]["high"]
    if high < LEAST_GAIN:
        return Words("Reprojection will not pay: {reason}", reason=predicted["fill"]["reason"])
    if high - low < LEAST_SHOWN_SPAN:
        return Words("Predicted: {gain} times as fast as multiview", gain=f"{high:.1f}")
    return Words("Predicted: {low} to {high} times as fast as multiview", low=f"{low:.1f}", high=f"{high:.1f}")
