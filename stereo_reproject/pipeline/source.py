"""The source eye: rendered, cleaned and denoised, ready to be warped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..images.denoising import Denoising, denoise_source
from ..images.metrics import weighted_mean
from ..images.passes import COLOUR_PASS, VIEW_DEPENDENT_PASS, Passes, without_internal_passes
from ..images.reflected_light import without_sparks
from ..images.residual_noise import residual_noise
from ..images.seen_light import display_scale, scaled_light
from ..settings.accuracy import Accuracy, for_denoised, for_size
from ..trace.fill import SourceCost
from ..views.camera import goes_round
from ..views.solid_angle import LEAST_WEIGHT, pixel_weights
from ..warp.composite import not_numbers, replace_non_finite
from ..warp.rendered_view import RenderedView
from .stages import Stage
from .task import FrameTask


@dataclass(frozen=True)
class Source:
    """The rendered source eye, ready to be warped.

    seen has its passes, with the denoised colour where the scene denoises, and with their light multiplied by
    light_scale, by which it is warped and judged. lost has masks (H, W), by pass, of the pixels that were
    no number, where seen has 0. denoising is None where the scene does not denoise. accuracy is that of the frame,
    adapted to its size and to denoising.
    """

    seen: RenderedView
    light_scale: float
    lost: Mapping[str, NDArray[np.bool_]]
    denoising: Denoising | None
    accuracy: Accuracy

    @property
    def cost(self) -> SourceCost:
        """Measured cost of the source render."""
        assert self.seen.cost is not None
        return self.seen.cost

    @property
    def rendered(self) -> Passes:
        """Passes of the eye with light as bright as the scene has it; copies, where that is not as it is seen."""
        return scaled_light(self.seen.passes, 1.0 / self.light_scale)

    def for_users(self) -> Source:
        """Return the source without the passes that only the warp and the hole rules read: those that users get."""
        return replace(self, seen=replace(self.seen, passes=without_internal_passes(self.seen.passes)))


def render_source(
    task: FrameTask, accuracy: Accuracy, *, light_scale: float | None = None, for_later: bool = False
) -> Source:
    """Render the source eye, clean it of values that are no number, and denoise it where the scene does.

    accuracy is that of the frame, for a picture of `SettingsTuning.unscaled_picture_px`. Stages begin on the task's
    watch. The light is scaled to be judged as it is seen, by light_scale where one is given; reflected light, by which
    probes are read, loses its sparks. for_later: True where other frames are made of it, whose cameras stand elsewhere.
    """
    renderer, watch, target = task.renderer, task.watch, task.target.camera
    accuracy = for_size(accuracy, target.width * target.height)

    may_differ = task.may_differ or (for_later and bool(renderer.plan.view_dependent))
    probed = may_differ and accuracy.promise is not None
    # Of a target that is rendered whole nothing is probed.
    passes, cost = _rendered(task, probed=probed and task.settings.fill != "full")
    lost = not_numbers(passes)
    passes, invalid = replace_non_finite(passes)
    denoising = None
    if renderer.denoise is not None:
        watch.lap(Stage.DENOISE_SOURCE)
        denoising = Denoising(renderer.denoise, wraps=goes_round(task.source.camera))
        accuracy = for_denoised(accuracy)
        passes = denoise_source(passes, denoising)
        cost = replace(cost, denoise_seconds=watch.seconds_so_far)
        # No closure: it would keep the passes in memory.
        watch.show(task.source.name, partial(passes.__getitem__, COLOUR_PASS))

    scale = display_scale(passes[COLOUR_PASS]) if light_scale is None else light_scale
    passes = scaled_light(passes, scale)
    if VIEW_DEPENDENT_PASS in passes:
        light = without_sparks(passes[VIEW_DEPENDENT_PASS], wraps=goes_round(task.source.camera))
        passes = {**passes, VIEW_DEPENDENT_PASS: light}
    seen = RenderedView(task.source, passes, invalid, cost)
    del passes
    if denoising is not None and probed:
        denoising = replace(denoising, residual_noise=_residual_noise(seen))
    return Source(seen, scale, lost, denoising, accuracy)


def _residual_noise(seen: RenderedView) -> float:
    """Return the mean variance, after `metrics.tone`, of the noise that is left in a pixel of a denoised source, each
    by its weight; pixels that show nothing, or were no number, do not count."""
    weight = np.broadcast_to(pixel_weights(seen.view.camera), seen.passes[COLOUR_PASS].shape[:2])
    known = weight > LEAST_WEIGHT
    if seen.invalid is not None:
        known &= ~seen.invalid
    return weighted_mean(residual_noise(seen.passes, known)[known], weight[known]) if known.any() else 0.0


def _rendered(task: FrameTask, *, probed: bool) -> tuple[Passes, SourceCost]:
    """Render the source eye; return its passes and its cost. An onlooker who wants one gets a first look before, whose
    sync counts as the source's. probed is as for `Renderer.render_source`.
    """
    renderer, watch, view = task.renderer, task.watch, task.source.name
    look = None
    if watch.onlooker.show is not None and watch.onlooker.first_look:
        watch.lap(Stage.LOOK)
        look = renderer.first_look(view, probed=probed)
        if look is not None:
            watch.onlooker.show(view, look[0])
    watch.lap(Stage.SOURCE)
    passes, cost = renderer.render_source(view, probed=probed)
    watch.show(view, lambda: passes[COLOUR_PASS])
    if look is None:
        return passes, cost
    synced_before = max(look[1].sync_seconds - cost.sync_seconds, 0.0)
    watch.move(synced_before, Stage.LOOK, Stage.SOURCE)
    return passes, SourceCost(cost.seconds + synced_before, cost.sync_seconds + synced_before)
