"""A pair whose source EEVEE renders: the working scene is EEVEE's, and a copy of it traces the holes with Cycles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...estimate.tracing import TargetTracing, WarpedTarget
from ...images.passes import ALBEDO_PASS, COLOUR_PASS, DEPTH_PASS, NOISY_PASS, NORMAL_PASS, Passes
from ...matching.matching import TracedPixels
from ...pipeline.matched_tracing import MatchedTracing, foreseen_fill
from ...trace.costs import TraceCosts
from ...trace.fill import SourceCost
from ...trace.planner import FillPlanner
from ...trace.requests import TraceRequest
from ...views.camera import ray_length_per_depth
from ..scene.denoiser import has_denoiser
from ..scene.engine_support import engine_warnings, unmatched_materials
from ..scene.rendered import CYCLES
from ..scene.working import rendered_layer
from .denoise import ALBEDO, NORMAL, denoise_pictures
from .mask_card import trace_card
from .packed_views import without_added_positions
from .render import Rendered
from .renderer import BlenderRenderer, check_blenders, cost_of, trace_full

MAX_TRACED_SAMPLES = 32
"""Samples of a traced pixel, at most: what is learned from the ring rests on features that have little noise, and it is
a preview."""

SKY_CLIP_END_SHARE = 0.99
"""Share of the clip end's depth from which what EEVEE shows counts as the sky."""

SPECULAR, MEAN_DEPTH = "Denoising Specular Albedo", "Denoising Depth"

DIRECT_LIGHT_PASSES = ("Environment", "Emission", "Env", "Emit")
"""Passes of the light that comes straight from what shines, as Blender 5 and as 4.5 name them."""


@contextmanager
def renderer_of(
    scene: bpy.types.Scene, folder: Path, *, user_scene: bpy.types.Scene | None = None, packed_by: str = "auto"
) -> Iterator[BlenderRenderer]:
    """Have a renderer for a working scene, by the engine that is set in it, for the time of a `with` block; afterwards
    what it added to the file is removed. packed_by is as for `BlenderRenderer`.
    """
    if scene.render.engine == CYCLES:
        yield BlenderRenderer(scene, folder, user_scene=user_scene, packed_by=packed_by)
        return
    renderer = EeveeRenderer(scene, folder, user_scene=user_scene, packed_by=packed_by)
    try:
        yield renderer
    finally:
        renderer.close()


class EeveeRenderer(BlenderRenderer):
    """A renderer whose whole eyes EEVEE renders, while Cycles traces the holes in a copy of the working scene. Use
    `close` in the end, or `renderer_of`.
    """

    _tracing: str | None = None
    """Name of the scene copy by which Cycles traces; None before it is made."""
    _last: Rendered | None = None
    """Result of the last trace, whose cost `trace_cost` returns."""

    @property
    def warnings(self) -> list[str]:
        """Lines about what EEVEE and Cycles show differently in this scene."""
        return engine_warnings(self.scene)

    def render_source(self, view: str, *, probed: bool = True) -> tuple[Passes, SourceCost]:
        """Render the source eye whole; return its passes and its cost. In 4.5 EEVEE gives the sky the depth of the
        camera's clip end; here it is infinite in every version.
        """
        passes, cost = super().render_source(view, probed=probed)
        return self._sky_marked(passes), cost

    def _sky_marked(self, passes: Passes) -> Passes:
        """Return the passes with an infinite depth wherever the depth is about that of the camera's clip end."""
        depth = passes[DEPTH_PASS]
        return {**passes, DEPTH_PASS: np.where(depth >= SKY_CLIP_END_SHARE * self.lens.far, np.float32(np.inf), depth)}

    def close(self) -> None:
        """Remove the scene copy by which Cycles traces, and what Cycles keeps of it in memory."""
        scene = None if self._tracing is None else bpy.data.scenes.get(self._tracing)
        if scene is not None:
            # Frees what Cycles keeps between renders.
            scene.render.use_persistent_data = False
            bpy.data.scenes.remove(scene)
        self._tracing = None

    def measured_costs(self, planner: FillPlanner, request: TraceRequest) -> TraceCosts:  # noqa: ARG002
        """Return the costs that are known already: against a source of EEVEE's, Cycles' pixels tell nothing."""
        return planner.costs

    def tracing_of(self, warped: WarpedTarget) -> TargetTracing:
        """Return what completes a warped target with Cycles, matched to EEVEE's light."""
        return MatchedTracing(self, warped)

    def foreseen_fill(self, asked: str) -> tuple[str, str] | None:
        """Return the fill method and why: a sketch says little of EEVEE's seconds and nothing of those of Cycles."""
        return foreseen_fill(asked, self.fill_blockers(), self.unmatchable())

    def trace(self, method: str, requests: Sequence[TraceRequest]) -> list[Passes]:
        """Trace all requests by one method, as `trace.requests.Tracer` says. With "full" EEVEE itself renders the eye;
        otherwise Cycles traces the pixels. A request may not ask for pixels twice.
        """
        assert all(request.twice is None for request in requests), "EEVEE's pixels are not probed"
        if method == "full":
            return [self._rendered(request) for request in requests]
        scene = self.traced_scene
        if method == "packed":
            renders, traced = self._traced_together(requests)
        else:
            apart = [self._behind_card(scene, request) for request in requests]
            renders, traced = [rendered for rendered, _ in apart], [passes for _, passes in apart]
        self._last = renders[-1]
        return [self._with_mean_depth(*pair) for pair in zip(requests, traced, strict=True)]

    def _rendered(self, request: TraceRequest) -> Passes:
        """Render the view of a request whole with EEVEE, and return the passes (N, C) of its pixels."""
        check_blenders(request.view)
        passes = trace_full(self.scene, request.view, request.pixels, self.folder, seed=self.seed)[1]
        return self._sky_marked(passes)

    def _behind_card(self, scene: bpy.types.Scene, request: TraceRequest) -> tuple[Rendered, Passes]:
        """Trace a request with Cycles behind a card; return the render, and the passes (N, C) of its pixels."""
        check_blenders(request.view)
        rendered, passes = trace_card(scene, request.view, request.pixels, self.folder, seed=self._next_seed())
        return rendered, without_added_positions(scene, passes)

    def _with_mean_depth(self, request: TraceRequest, passes: Passes) -> Passes:
        """Return the passes (N, C) of a request with mean depths in their Denoising Depth. Cycles has mean lengths of
        rays there, counted from where the camera clips them.
        """
        rows, columns = np.nonzero(request.pixels)
        slant = ray_length_per_depth(self.cameras[request.view], columns + 0.5, rows + 0.5)
        mean_depth = passes[MEAN_DEPTH] / np.reshape(slant, (-1, 1)) + self.lens.near
        return {**passes, MEAN_DEPTH: mean_depth.astype(np.float32)}

    def trace_cost(self) -> SourceCost:
        """Return the cost of the last trace by Cycles. There must have been one."""
        assert self._last is not None
        return cost_of(self._last)

    def traced_features(self, passes: Passes) -> TracedPixels:
        """Return what Cycles tells of traced pixels: colour, own light, albedo and more, from the passes (N, C) of a
        trace. Values that are no numbers become 0.
        """
        nothing = np.zeros_like(passes[ALBEDO])
        seen = sum((passes[name] for name in DIRECT_LIGHT_PASSES if name in passes), nothing)
        albedo = _numbers(passes[ALBEDO] - seen)
        depth = passes[DEPTH_PASS][:, 0]
        known = np.isfinite(depth) & (depth > 0.0)
        return TracedPixels(
            colour=_numbers(passes[COLOUR_PASS][:, :3]),
            emitted=_numbers(seen),
            albedo=np.clip(albedo, 0.0, 1.0),
            specular=np.clip(_numbers(passes.get(SPECULAR, nothing)), 0.0, 1.0),
            normal=_numbers(passes[NORMAL]),
            nearness=np.divide(1.0, depth, out=np.zeros_like(depth), where=known),
            mean_depth=_numbers(passes[MEAN_DEPTH][:, 0]),
            # No surface reflects more than there is: Cycles follows what is sharp to the light behind it.
            refracts=albedo.max(axis=-1) > 1.0,
        )

    def clean(self, colour: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return a picture (H, W, 3), scene-linear, without its noise; as it is where this Blender has no denoiser."""
        if not has_denoiser(self.scene):
            return colour
        nothing = np.zeros_like(colour)
        picture = {NOISY_PASS: colour, ALBEDO_PASS: nothing, NORMAL_PASS: nothing}
        return denoise_pictures(self.traced_scene, [picture], self.folder)[0]

    def unmatchable(self) -> str | None:
        """Return why Cycles' pixels cannot be matched to EEVEE's light in this scene, in words; None if they can."""
        if self.scene.render.film_transparent:
            return "the film is transparent, and light cannot be matched where there is none"
        return unmatched_materials(self.scene, self.cameras.values())

    @property
    def traced_scene(self) -> bpy.types.Scene:
        """The scene copy in which Cycles traces pixels; it is made where there is none yet. It is found by its name,
        since a reference may not survive a render.
        """
        if self._tracing is None:
            copy = self.scene.copy()
            self._tracing = copy.name
            _set_up_tracing(copy)
            rendered_layer(copy).update()
        return bpy.data.scenes[self._tracing]


def _set_up_tracing(scene: bpy.types.Scene) -> None:
    """Set a copy of EEVEE's scene up for Cycles: few samples, no denoising, no time limit, EEVEE's pixel filter, and
    the passes that `traced_features` reads.
    """
    cycles = scene.cycles
    scene.render.engine = CYCLES
    scene.driver_remove("cycles.seed")
    cycles.samples = min(cycles.samples, MAX_TRACED_SAMPLES)
    cycles.use_denoising = False
    # EEVEE knows nothing of it.
    cycles.film_exposure = 1.0
    # Of EEVEE's own pixels the denoiser has nothing to be guided by.
    if has_denoiser(scene):
        cycles.denoiser = "OPENIMAGEDENOISE"
    cycles.denoising_input_passes = "RGB"
    cycles.denoising_prefilter = "ACCURATE"
    # EEVEE knows neither; and from a later sample on, Cycles has no depth.
    cycles.time_limit, cycles.use_sample_subset = 0.0, False
    # EEVEE's filter is as wide as this says, of the same shape.
    cycles.pixel_filter_type = "BLACKMAN_HARRIS"
    cycles.filter_width = max(scene.render.filter_size, 0.01)
    layer = rendered_layer(scene)
    layer.samples = 0
    layer.use_pass_environment = layer.use_pass_emit = True
    layer.cycles.denoising_store_passes = True


def _numbers(values: NDArray) -> NDArray[np.float32]:
    """Return the values as float32, with 0 in place of what is infinite or no number."""
    return np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0).astype(np.float32)
