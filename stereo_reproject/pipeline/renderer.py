"""The renderer that the pipeline asks for pictures, as a protocol."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..estimate.tracing import TargetTracing, WarpedTarget
from ..images.denoising import Denoise
from ..images.effects import EffectsPlan
from ..images.passes import Passes
from ..trace.costs import TraceCosts
from ..trace.fill import SourceCost
from ..trace.planner import FillPlanner
from ..trace.requests import Tracer, TraceRequest
from ..views.camera import Camera
from ..views.frustum import Lens
from ..views.motion import Moving
from ..warp.warper import Warper


class Renderer(Tracer, Protocol):
    """Protocol of an object that renders one scene for the pipeline.

    `stereo_reproject.blender.engines.renderer` has the one that ships; tests have others, without Blender.
    """

    cameras: Mapping[str, Camera]
    """Cameras by view name."""
    plan: EffectsPlan
    """Effects that the scene calls for; where none of them may look different from each eye, no probe is traced."""
    lens: Lens
    """Lens of both eyes."""
    gpu: Callable[[], Warper | None]
    """Finds a GPU that can warp."""
    volumes: Sequence[NDArray]
    """Corners (8, 3) in the world of a box around each volume, infinite for one that may be anywhere."""
    seed: int
    """Seed of the scene's noise; the places of the probes follow from it."""
    motion: Mapping[str, Moving] | None
    """Motion of each eye in the frames around this one; None where no pass asks for it."""
    metadata: Mapping[str, str]
    """Texts of Blender's that belong to the passes rendered so far, as they stand in a file's header."""
    denoise: Denoise | None
    """The scene's denoiser; None where it has none. All renders then have the passes that `images.denoising` needs."""

    @property
    def packed_by(self) -> str:
        """Name by which the costs of the packed camera are known that traces the scene, by the depth that
        `fill_blockers` was told last."""
        ...

    def first_look(self, view: str, *, probed: bool) -> tuple[NDArray[np.float32], SourceCost] | None:
        """Render the view of this name with a single sample; return its colour (H, W, 4) and its cost, None where that
        cannot be done. The renders that follow are the same to the bit as without it. probed is as for
        `render_source`."""
        ...

    def render_source(self, view: str, *, probed: bool) -> tuple[Passes, SourceCost]:
        """Render the source eye, which is the view of this name; return its passes, whole and not denoised, and its
        cost.

        probed: whether probes may be traced afterwards, so that passes are needed that they alone are read by.
        """
        ...

    def expect_probes(self, *, probed: bool) -> None:
        """Have the renders that follow have what only probes are read by, if they are `probed`, where no source of this
        renderer's own goes before them."""
        ...

    def fill_blockers(self, deepest: float = 0.0) -> Mapping[str, str | None]:
        """Return by fill method the reason, in words, why it cannot be used for this scene, or None where it can.

        deepest is the greatest depth that the source sees, in scene units; 0 as long as that is not known.
        """
        ...

    def measured_costs(self, planner: FillPlanner, request: TraceRequest) -> TraceCosts:
        """Return the costs of tracing once these pixels were traced only to measure them, as
        `calibration.CostMeasurer` says. Asked of an animation's first frame alone."""
        ...

    def tracing_of(self, warped: WarpedTarget) -> TargetTracing:
        """Return what completes a warped target: with probes, or by another engine that is matched to the source's."""
        ...
