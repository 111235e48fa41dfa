"""The renderer that the pipeline asks for pictures: a working scene, rendered by Blender."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..fill import SourceCost
from ..passes import Passes
from .effects import view_dependent_effects
from .hole_camera import packed_blocker, trace_packed
from .mask_card import card_blocker, trace_card
from .render import render_views
from .rig import stereo_cameras
from .scene import evaluated

FILL_SEED = 1_000_003
"""Added to the scene's seed for traced pixels: noise that the source already shows must not come twice."""


class BlenderRenderer:
    """Renders a scene that `scene.working_scene` made; `folder` is private and takes the files between the stages."""

    def __init__(self, scene: bpy.types.Scene, folder: Path) -> None:
        self.scene = scene
        self.folder = folder
        self.cameras = stereo_cameras(evaluated(scene.camera, scene), scene.render)
        self.view_dependent = view_dependent_effects(scene)
        self.seed = scene.cycles.seed
        self._traces = 0

    def render_source(self, view: str) -> tuple[Passes, SourceCost]:
        rendered = render_views(self.scene, (view,), self.folder, seed=self.seed)
        return rendered.views[view], SourceCost(rendered.seconds, rendered.sync_seconds)

    def fill_blockers(self, deepest: float = 0.0) -> dict[str, str | None]:
        return {
            "packed": packed_blocker(self.scene, self.cameras.values(), deepest),
            "card": card_blocker(self.scene),
        }

    def trace(
        self, method: str, view: str, pixels: NDArray[np.bool_], *, twice: NDArray[np.bool_] | None = None
    ) -> Passes:
        masks = [pixels] if twice is None else [pixels, twice]
        if method == "packed":
            places = np.concatenate([np.argwhere(mask) for mask in masks])
            return trace_packed(self.scene, self.cameras[view], view, places, self.folder, seed=self._next_seed())[1]
        traced = [self._trace_whole(method, view, mask) for mask in masks]
        return {name: np.concatenate([part[name] for part in traced]) for name in traced[0]}

    def _trace_whole(self, method: str, view: str, pixels: NDArray[np.bool_]) -> Passes:
        seed = self._next_seed()
        if method == "card":
            return trace_card(self.scene, view, pixels, self.folder, seed=seed)[1]
        return render_target(self, view, pixels, seed=seed)

    def _next_seed(self) -> int:
        """A seed that no render of this frame has had: noise that is there already must not come twice."""
        self._traces += 1
        return shifted_seed(self.seed, FILL_SEED * self._traces)


def render_target(renderer: BlenderRenderer, view: str, pixels: NDArray[np.bool_], *, seed: int) -> Passes:
    """A plain render of the view, as (N, C) of the given pixels."""
    rendered = render_views(renderer.scene, (view,), renderer.folder, seed=seed)
    return {name: image[pixels] for name, image in rendered.views[view].items()}


def shifted_seed(seed: int, by: int) -> int:
    """Another seed that Blender's property takes."""
    return (seed + by) % (1 << 31)
