"""A frame of one view that is rendered whole: a key frame of a mono animation, or one that cannot be made from it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..estimate.noise_ratio import as_rendered
from ..estimate.tracing import Refinement
from ..images.depth_pass import with_depth_pass
from ..settings.accuracy import accuracy_of
from ..settings.frame import StereoSettings
from ..trace.costs import TraceCosts
from ..trace.fill import FillChoice
from ..views.solid_angle import pixel_weights
from ..warp.composite import count_pixels
from .next_accuracy import WHOLE, NextAccuracy
from .renderer import Renderer
from .shared_findings import SharedFindings
from .source import Source, render_source
from .stages import OUTSIDE_TOTAL
from .stereo_frame import StereoFrame
from .stopwatch import Stopwatch
from .task import FrameTask


def render_whole_view(
    renderer: Renderer,
    settings: StereoSettings,
    *,
    findings: SharedFindings,
    watch: Stopwatch,
    known_costs: Callable[[], TraceCosts],
    on_source: Callable[[Source], None] = lambda _: None,
) -> StereoFrame:
    """Render the one view of a frame whole, and return the frame, which has no other.

    The parameters are those of `render_stereo_frame`. Raises StereoReprojectError when the render fails.
    """
    task = FrameTask.of_pair(renderer, settings, findings, known_costs, watch)
    source = render_source(task, accuracy_of(settings), for_later=True)
    watch.lap()
    on_source(source)
    source = source.for_users()
    every = np.ones(source.seen.depth.shape, bool)
    total = sum(seconds for stage, seconds in watch.seconds.items() if stage not in OUTSIDE_TOTAL)
    view = task.target
    return StereoFrame(
        eyes={view.name: with_depth_pass(source.rendered, view.camera)},
        reasons=np.zeros(every.shape, np.uint16),
        traced=every,
        variance_share=every.astype(np.float32),
        grid=None,
        fill=FillChoice("full", "rendered whole", 0.0),
        refinement=Refinement(~every, estimate=as_rendered(None), whole=True),
        pilot_share=None,
        seconds={**watch.seconds, "total": total},
        source_cost=source.cost,
        trace_costs=known_costs(),
        effect_costs={},
        next_accuracy=NextAccuracy(WHOLE, total, None, 1.0, complete=True),
        invalid_pixels={view.name: count_pixels(source.lost)},
        metadata=dict(renderer.metadata),
        light_scale=source.light_scale,
        pixel_weight=pixel_weights(view.camera),
        camera=view.camera,
    )
