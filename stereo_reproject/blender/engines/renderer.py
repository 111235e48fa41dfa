"""The renderer that the pipeline asks for pictures: a working scene, rendered by Blender."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from types import MappingProxyType

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import BadInputError
from ...estimate.tracing import ProbedTracing, TargetTracing, WarpedTarget
from ...holes.classifier import Optics, has_ray_lengths
from ...images.denoising import Denoise
from ...images.depth_pass import distances, with_depth, with_depth_at
from ...images.effects import Effect
from ...images.effects_pass import MATERIAL_CRYPTOMATTE
from ...images.passes import COLOUR_PASS, DEPTH_PASS, Passes, cryptomatte_of
from ...jobs.memory import give_back_freed
from ...settings.frame import EYES
from ...trace.costs import TraceCosts
from ...trace.fill import SourceCost
from ...trace.measuring import TraceRender, learned_costs, open_share
from ...trace.planner import FillPlanner
from ...trace.requests import TraceRequest
from ...views.camera import Camera, PerspectiveCamera
from ...views.frustum import covered_by
from ...views.panorama import PanoramicCamera, share_between_eyes
from ...warp.tuning import TUNING as WARP_TUNING
from ...words import Words
from ..gpu.warp import gpu_warper
from ..scene.cryptomatte import cryptomatte_asked_for
from ..scene.denoiser import denoises
from ..scene.effects import plan_effects
from ..scene.motion import eyes_in_motion, vector_pass_asked_for
from ..scene.rendered import CYCLES
from ..scene.rig import stereo_cameras
from ..scene.visible import lens_of, mirror_boxes, volume_boxes
from ..scene.working import changed, evaluated
from .denoise import denoise_pictures, guided_by
from .mask_card import card_blocker, trace_card
from .packed_camera import PackedCamera
from .packed_trace import PackedCameras, check_packed_by
from .packed_views import switch_on_positions, without_added_positions
from .portal_sheet import hide_sheet, without_sheet
from .ray_passes import RayPasses
from .render import Rendered, render_views
from .shared_render import trace_together
from .source_render import effects_in, effects_passes, has_first_sample, render_source_view, single_sample
from .time_limit import (
    has_time_limit,
    samples_rendered,
    why_uncounted,
    without_counts,
    without_time_limit,
)

TRACE_SEED_STEP = 1_000_003
"""Added to the scene's seed for traced pixels: noise that the source already shows must not come twice."""

LEAST_SHARE_BETWEEN_EYES = 0.0005
"""Share of the picture from which things between the eyes are warned of: less is a pixel here and there."""


def standing_at_eye(view: str) -> AbstractContextManager[str]:
    """Return a context in which Blender can render this view whole, an eye, and which gives Blender's name for it."""
    check_blenders(view)
    return nullcontext(view)


def check_blenders(view: str) -> None:
    """Raise BadInputError unless the view is an eye: only those can Blender render by itself."""
    if view not in EYES:
        raise BadInputError(Words("view {view} is none of Blender's: it can be traced packed alone", view=repr(view)))


class BlenderRenderer:
    """Renderer of a working scene for the pipeline; its subclasses differ in engine or source.

    scene is a working scene and user_scene the one that it is a copy of; folder is private and takes the files between
    the stages. `plan` says which effects the scene calls for. views are further cameras by name, besides Blender's two
    eyes: their pixels can be traced, by the packed method alone. packed_by is the packed camera that was asked for:
    "auto", "osl" or "portal". Raises BadInputError for "osl" where Cycles has no OSL camera.
    """

    gpu = staticmethod(gpu_warper)
    standing_at: Callable[[str], AbstractContextManager[str]] = staticmethod(standing_at_eye)
    own_seeds: Mapping[str, int] = MappingProxyType({})
    """Seeds, by view name, of whole renders that have another than the scene's."""

    @property
    def warnings(self) -> list[str]:
        """Warnings about parts of the scene that this way of rendering shows differently, or wrongly, a line each: here
        of things that stand between the eyes of a panorama."""
        return _warnings_between_eyes(self._between_eyes)

    def __init__(
        self,
        scene: bpy.types.Scene,
        folder: Path,
        *,
        user_scene: bpy.types.Scene | None = None,
        views: Mapping[str, PerspectiveCamera] | None = None,
        packed_by: str = "auto",
    ) -> None:
        self.scene = scene
        check_packed_by(scene, packed_by)
        self.folder = folder
        eyes = stereo_cameras(evaluated(scene.camera, scene), scene.render)
        self.cameras: dict[str, Camera] = {**(views or {}), **eyes}
        self.lens = lens_of(scene)
        self.plan = plan_effects(scene, user_scene=user_scene)
        self.volumes = volume_boxes(scene) if self.plan.called_for & Effect.VOLUME else ()
        self.seed = scene.cycles.seed
        self.motion = eyes_in_motion(scene, eyes) if vector_pass_asked_for(scene) else None
        self.metadata: dict[str, str] = {}
        self._between_eyes: float | None = 0.0
        if views and scene.render.engine == CYCLES:
            switch_on_positions(scene)
        self.denoise: Denoise | None = partial(denoise_pictures, scene, folder=folder) if denoises(scene) else None
        self._rays = RayPasses(scene, self.plan, denoised=bool(self.denoise), mirrors=self._may_see_mirrors(eyes))
        self._traces = 0
        self.trace_renders: list[TraceRender] = []
        """Measurements of the renders that traced pixels of this frame, in their order."""
        self._packed_cameras = PackedCameras(packed_by, self.cameras.values())
        self._deepest = 0.0
        """Greatest finite depth that `fill_blockers` was told last, in scene units."""
        self.samples_rendered: int | None = None
        """Samples of the source, where the scene has a time limit."""
        self.uncounted: str | None = None
        """Reason why those samples cannot be told, if they cannot: then nothing is traced."""

    def _may_see_mirrors(self, eyes: Mapping[str, Camera]) -> bool:
        """Return whether passes are worth rendering that tell of the images in flat mirrors."""
        optics = Optics(self.lens, self.volumes)
        return self.plan.may_mirror and _shows_mirrors(self.scene, eyes, optics, denoised=self.denoise is not None)

    def _guided(self, passes: Passes) -> Passes:
        """Return the passes of a render without those that only we switched on, with those that denoising needs."""
        passes = self._rays.without_added(passes if self.denoise is None else guided_by(passes))
        return without_added_positions(self.scene, passes)

    def first_look(self, view: str, *, probed: bool = True) -> tuple[NDArray[np.float32], SourceCost] | None:
        """Render an eye with one sample, as `pipeline.renderer.Renderer` says; EEVEE has none. It has the source's
        passes and size, since Cycles keeps what it syncs and dices for them."""
        if not has_first_sample(self.scene):
            return None
        self._rays.tell_light_apart(self.scene, probed=probed)
        with single_sample(self.scene):
            rendered = render_source_view(self.scene, view, self.cameras.values(), self.plan, self.folder, self.seed)
        return rendered.views[view][COLOUR_PASS], cost_of(rendered)

    def render_source(self, view: str, *, probed: bool = True) -> tuple[Passes, SourceCost]:
        """Render the source eye whole; return its passes and its cost. If anything may look different from each eye,
        passes of the effects and materials of each pixel are added. Counts the samples where the scene has a time
        limit. From now on the renders have what only probes are read by, if they are `probed`.
        """
        self._rays.tell_light_apart(self.scene, probed=probed)
        with _noisy(self), self.standing_at(view) as eye:
            seed = self.own_seeds.get(view, self.seed)
            rendered = render_source_view(self.scene, eye, self.cameras.values(), self.plan, self.folder, seed)
        give_back_freed()  # A fifth of all memory by now, of a large picture: reading the file has taken it.
        if has_time_limit(self.scene):
            self.samples_rendered = samples_rendered(self.scene, rendered, eye)
            self.uncounted = why_uncounted(self.scene) if self.samples_rendered is None else None
        self.metadata.update(without_sheet(rendered.attributes))
        self._between_eyes = _share_between_eyes(self.cameras[view], rendered.views[eye])
        found = with_depth(rendered.views[eye], self.cameras[view])
        passes = without_counts(self.scene, self._guided(found)) | self._rays.of(found)
        own = effects_passes(self.scene, self.plan, passes, rendered.attributes)
        return _as_asked_for(self.scene, passes) | own, cost_of(rendered)

    def expect_probes(self, *, probed: bool) -> None:
        """Have what only probes are read by in the renders that follow, as `pipeline.renderer.Renderer` says."""
        self._rays.tell_light_apart(self.scene, probed=probed)

    @property
    def traced_scene(self) -> bpy.types.Scene:
        """The scene in which Cycles traces pixels: the working scene itself."""
        return self.scene

    @property
    def packed(self) -> PackedCamera:
        """The packed camera that traces the scene, by the depths that `fill_blockers` was told last."""
        return self._packed_cameras.chosen(self.traced_scene, self._deepest)

    @property
    def packed_by(self) -> str:
        """Name by which the costs of that camera are known."""
        return self.packed.costs_key or self.packed.name

    def fill_blockers(self, deepest: float = 0.0) -> dict[str, str | None]:
        """Return for each fill method but "full" why the scene cannot be traced by it, in words, or None if it can.
        deepest is the greatest finite depth that was seen, in scene units; 0 before anything was rendered.
        """
        scene, self._deepest = self.traced_scene, deepest
        if scene.render.engine != CYCLES:
            return dict.fromkeys(("packed", "card"), "the scene renders with EEVEE")
        packed, card = self._packed_cameras.blocker(scene, deepest), card_blocker(scene)
        return {"packed": self.uncounted or packed, "card": self.uncounted or card}

    def measured_costs(self, planner: FillPlanner, request: TraceRequest) -> TraceCosts:
        """Return the costs of tracing once the pixels of a request were traced packed, as `calibration.CostMeasurer`
        says.
        """
        traces = self._traces
        self.trace("packed", [request])
        # The frame's own pixels have the seeds that they have where nothing was measured.
        self._traces = traces
        return learned_costs(planner.costs, planner.cost, self.trace_renders)

    def tracing_of(self, warped: WarpedTarget) -> TargetTracing:
        """Return what completes a warped target with probes, since one engine renders and traces."""
        return ProbedTracing(self, warped)

    def foreseen_fill(self, asked: str) -> tuple[str, str] | None:  # noqa: ARG002
        """Return the fill method and why, where no sketch can tell it; None here: a sketch tells."""
        return None

    def trace(self, method: str, requests: Sequence[TraceRequest]) -> list[Passes]:
        """Trace all requests by one method, as `trace.requests.Tracer` says. Packed pixels of several views are traced
        in as few renders as is exact; the other methods render view by view. Of several renders, nobody knows which has
        traced what, and none is noted.
        """
        # A whole render of the eye is one as the user asks for, with the limit.
        enough = has_time_limit(self.scene) and method != "full"
        with _noisy(self), without_time_limit(self.scene, self.samples_rendered) if enough else nullcontext():
            if method == "packed":
                renders, traced = self._traced_together(requests)
                if len(renders) == 1:
                    pixels = sum(float(np.mean(mask)) for request in requests for mask in request.masks)
                    self._note("packed", renders[0], pixels)
            else:
                traced = [self._trace_whole(method, request) for request in requests]
        return [self._guided(passes) for passes in traced]

    def _traced_together(self, requests: Sequence[TraceRequest]) -> tuple[list[Rendered], list[Passes]]:
        """Trace all requests packed, with seeds of their own; return the renders, and each request's passes (N, C)."""
        scene, seed = self.traced_scene, self._next_seed
        renders, traced = trace_together(scene, self.cameras, self.volumes, requests, self.folder, seed, self.packed)
        return renders, [_with_effects(self, passes, renders[0]) for passes in traced]

    def _trace_whole(self, method: str, request: TraceRequest) -> Passes:
        """Return the passes (N, C) of a request, by the method "card" or "full". Each of its masks takes a render as
        large as the view.
        """
        hide_sheet(self.scene, self.cameras.values())
        probes = np.zeros_like(request.pixels) if request.twice is None else request.twice
        apart = []
        for mask in request.masks:
            with self.standing_at(request.view) as eye:
                rendered, passes = WHOLE_TRACES[method](self.scene, eye, mask, self.folder, seed=self._next_seed())
            self._note(method, rendered, open_share(mask & ~probes, probes) if method == "card" else 1.0)
            shown = _with_effects(self, passes, rendered)
            apart.append(with_depth_at(shown, self.cameras[request.view], np.argwhere(mask)))
        return {name: np.concatenate([part[name] for part in apart]) for name in apart[0]}

    def _note(self, method: str, rendered: Rendered, share: float) -> None:
        """Note the measurements of a render that traced a share of the frame's pixels; see `TraceRender`."""
        self.trace_renders.append(TraceRender(method, rendered.seconds, rendered.sync_seconds, share))

    def _next_seed(self) -> int:
        """Return a seed that no render of this frame has had, so that no noise comes twice. Each call returns
        another.
        """
        self._traces += 1
        return shifted_seed(self.seed, TRACE_SEED_STEP * self._traces)


def _with_effects(renderer: BlenderRenderer, passes: Passes, rendered: Rendered) -> Passes:
    """Return the passes (N, C) of traced pixels with that of the effects that they show, where their render tells it;
    in a noisy picture nothing asks for it."""
    if renderer.denoise is None:
        return passes
    return {**passes, **effects_in(renderer.scene, renderer.plan, passes, rendered.attributes)}


def _noisy(renderer: BlenderRenderer) -> AbstractContextManager[None]:
    """Return a context in which renders are left noisy, if pictures are to be denoised here afterwards."""
    return nullcontext() if renderer.denoise is None else changed(renderer.scene.cycles, use_denoising=False)


def _shows_mirrors(scene: bpy.types.Scene, eyes: Mapping[str, Camera], optics: Optics, *, denoised: bool) -> bool:
    """Return whether the eyes may see flat mirrors whose images can be found, worth the passes that tell of them.

    A denoised picture has most of these passes anyway; for a noisy one, boxes around what may be a mirror must cover
    min_mirror_boxes_share of the picture.
    """
    # A target may be the eye of another frame.
    if not has_ray_lengths(eyes["left"], optics):
        return False
    if denoised:
        return True
    covered = covered_by(mirror_boxes(scene), eyes["left"], optics.lens)
    return float(covered.mean()) >= WARP_TUNING.min_mirror_boxes_share


def _as_asked_for(scene: bpy.types.Scene, passes: Passes) -> Passes:
    """Return the source's passes without the materials' cryptomatte, unless the user has asked for it."""
    if scene.render.engine != CYCLES or cryptomatte_asked_for(scene):
        return passes
    return {name: image for name, image in passes.items() if cryptomatte_of(name) != MATERIAL_CRYPTOMATTE}


def _share_between_eyes(camera: Camera, passes: Passes) -> float | None:
    """Return what `share_between_eyes` does of a view's passes (H, W, C), as Blender has them; None where an eye of
    spherical stereo sees the background alone."""
    if not isinstance(camera, PanoramicCamera):
        return 0.0
    away = distances(camera, passes[DEPTH_PASS][..., 0])
    if camera.stereo is not None and camera.stereo.offset and not np.any(np.isfinite(away) & (away > 0.0)):
        return None
    return share_between_eyes(camera, away)


def _warnings_between_eyes(share: float | None) -> list[str]:
    """Return a warning of things that are nearer than the eyes are to each other, in this share of the picture; none
    where that is next to nothing. None is the share where the background alone is seen."""
    if share is None:
        said = "the eyes see the background alone: neither sees what is nearer to the camera than half its interocular "
        return [said + "distance; lower that distance, or move the camera"]
    message = (
        "{share} of the picture shows what is nearer to the camera than its interocular distance: the eyes do not see "
        "that alike, and the pair may be wrong there; move the camera, or lower the distance"
    )
    return [Words(message, share=f"{share:.1%}")] if share >= LEAST_SHARE_BETWEEN_EYES else []


def cost_of(rendered: Rendered) -> SourceCost:
    """Return the cost of a render, in seconds of the whole call and of Cycles' sync, as the pipeline has it."""
    return SourceCost(rendered.seconds, rendered.sync_seconds)


def trace_full(
    scene: bpy.types.Scene, view: str, pixels: NDArray[np.bool_], folder: Path, *, seed: int
) -> tuple[Rendered, Passes]:
    """Render a view whole. Return the render, and the passes (N, C) of the pixels set in `pixels` (H, W), row by
    row.
    """
    rendered = render_views(scene, (view,), folder, seed=seed)
    return rendered, {name: image[pixels] for name, image in rendered.views[view].items()}


def shifted_seed(seed: int, by: int) -> int:
    """Return the seed moved on by so much, kept from 0 to 2^31 - 1 as Blender's property takes it."""
    return (seed + by) % (1 << 31)


WHOLE_TRACES = {"card": trace_card, "full": trace_full}
"""Functions that trace pixels of one view by a render as large as the view, by fill method."""
