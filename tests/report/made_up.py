"""Frames that were never rendered, with figures of every kind, for tests of the report."""

from __future__ import annotations

import numpy as np

from stereo_reproject.estimate.missing import NOTHING_DIFFERS
from stereo_reproject.estimate.noise_ratio import Estimate
from stereo_reproject.estimate.tracing import Refinement
from stereo_reproject.images.effects import Effect, EffectsPlan, Finding
from stereo_reproject.images.reasons import Reason
from stereo_reproject.matching.matching import Correction
from stereo_reproject.pipeline.effect_costs import EffectCost
from stereo_reproject.pipeline.next_accuracy import NextAccuracy
from stereo_reproject.pipeline.stereo_frame import StereoFrame
from stereo_reproject.pipeline.stereo_pair import StereoPair
from stereo_reproject.trace.costs import TraceCosts
from stereo_reproject.trace.fill import FillChoice, SourceCost
from stereo_reproject.warp.grid import Grid

SIZE = (4, 8)

PRICE = NextAccuracy("high", 12.5, 0.875, 0.125, complete=False)
NO_PRICE = NextAccuracy("full", 11.625, None, 1.0, complete=True)

PLAN = EffectsPlan(
    (
        Finding(Effect.GLOSSY, ("material Lake",), "its image is warped"),
        Finding(Effect.TRANSMISSION, ("material Steel", "material Wax"), "probed"),
        Finding(Effect.HAIR, (), "not called for"),
    ),
    {},
)


def reasons() -> np.ndarray:
    flags = np.zeros(SIZE, np.uint16)
    flags[0, :3] = Reason.DISOCCLUDED.bit
    flags[1, 0] = Reason.OUTSIDE.bit
    flags[2, :4] = Reason.SILHOUETTE.bit | Reason.PROBE.bit
    flags[3, 7] = Reason.REFINED.bit
    return flags


def stereo_frame(*, whole: bool = True) -> StereoFrame:
    """A frame with an estimate, a correction, refinement and a GPU; or, unless `whole`, without all that."""
    eye = {"Combined": np.zeros((*SIZE, 4), np.float32)}
    flags = reasons() if whole else np.zeros(SIZE, np.uint16)
    refined = FillChoice("full", "cheapest", 0.5) if whole else None
    subdivided = np.array([[True, False]])
    return StereoFrame(
        eyes={"left": eye, "right": eye},
        reasons=flags,
        traced=flags > 0,
        variance_share=np.ones(SIZE, np.float32),
        grid=Grid(subdivided, SIZE[1], SIZE[0]),
        fill=FillChoice("packed", "6 % of the pixels are holes", 0.375 if whole else 0.0),
        refinement=Refinement(
            flags > 0,
            refined,
            Estimate(1.25, 1.125, 1.5, 1.5, 1.25, 1.75) if whole else None,
            whole=whole,
            no_estimate=NOTHING_DIFFERS,
        ),
        pilot_share=None,
        seconds={"plan": 0.5, "source": 10.0, "warp": 0.125, "fill": 1.0, "total": 11.625},
        source_cost=SourceCost(10.0, 2.0),
        trace_costs=TraceCosts(1.25, 0.125, 0.5, 0.25, "agreed"),
        effect_costs={
            Effect.GLOSSY: EffectCost(0.25, 0.5, (0.125, 0.0625, 0.25)),
            Effect.TRANSMISSION: EffectCost(0.03125, 0.25, None),
        }
        if whole
        else {},
        next_accuracy=PRICE if whole else NO_PRICE,
        invalid_pixels={"left": 0, "right": 0},
        metadata={},
        correction=Correction(0.25, 0.75) if whole else None,
        warped_by="gpu" if whole else "numpy",
        gpu="A card" if whole else None,
    )


def stereo_pair(*, whole: bool = True) -> StereoPair:
    """A pair of two view layers, or of one frame with the least that a frame has."""
    if not whole:
        return StereoPair({"ViewLayer": stereo_frame(whole=False)})
    return StereoPair({"Main": stereo_frame(), "Front": stereo_frame(whole=False)})
