"""Renderers of a price list's cases: one whose source was rendered before, and one with the heuristic mask."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...errors import BadInputError
from ...images.passes import MASKED_PASS, Passes
from ...images.reflected_light import glossy_mask
from ...settings.frame import StereoSettings
from ...trace.fill import SourceCost
from ...views.camera import Camera
from ..engines.ray_passes import LIGHT_SWITCHES
from ..engines.renderer import BlenderRenderer
from ..scene.rendered import CYCLES
from ..scene.working import rendered_layer


@dataclass(frozen=True)
class RenderedSource:
    """The source eye that all cases share: the name of its view, passes and cost as its renderer gave them, and the
    seconds of the whole call.

    samples_rendered and uncounted are those of `BlenderRenderer`, for scenes with a time limit.
    """

    view: str
    passes: Passes
    cost: SourceCost
    seconds: float
    samples_rendered: int | None = None
    uncounted: str | None = None


def render_shared_source(working: bpy.types.Scene, settings: StereoSettings, work: Path) -> RenderedSource:
    """Render the source eye that the cases share, and return it."""
    renderer = BlenderRenderer(working, work, packed_by=settings.packed_by)
    start = time.perf_counter()
    passes, cost = renderer.render_source(settings.source)
    seconds = time.perf_counter() - start
    return RenderedSource(settings.source, passes, cost, seconds, renderer.samples_rendered, renderer.uncounted)


class SharedSourceRenderer(BlenderRenderer):
    """A renderer whose source was rendered before: it only traces."""

    def __init__(
        self, scene: bpy.types.Scene, folder: Path, source: RenderedSource, *, packed_by: str = "auto"
    ) -> None:
        super().__init__(scene, folder, packed_by=packed_by)
        self._source = source
        self.samples_rendered, self.uncounted = source.samples_rendered, source.uncounted

    def render_source(self, view: str, *, probed: bool = True) -> tuple[Passes, SourceCost]:
        """Return a copy of the passes of the shared source, and its cost; `view` must be the shared one's."""
        assert view == self._source.view
        self._rays.tell_light_apart(self.scene, probed=probed)
        # What a case does to its source must not reach the next one.
        return {name: image.copy() for name, image in self._source.passes.items()}, self._source.cost


class HeuristicRenderer(BlenderRenderer):
    """A renderer whose source has a mask of the pixels that are glossy or transparent and must not be warped: the
    simple method that probes are compared with.
    """

    def _may_see_mirrors(self, eyes: Mapping[str, Camera]) -> bool:  # noqa: ARG002
        """Return False: the simple method knows nothing of mirrors."""
        return False

    def render_source(self, view: str, *, probed: bool = False) -> tuple[Passes, SourceCost]:  # noqa: ARG002
        """Render the source eye with the mask as a pass of its own, and nothing for probes, of which there are none.
        Raises BadInputError for any engine but Cycles: others lack the light passes that the mask is made of.
        """
        if self.scene.render.engine != CYCLES:
            raise BadInputError("only Cycles has the light passes of which the mask is made")
        with _light_passes(self.scene) as added:
            passes, cost = super().render_source(view, probed=False)
        passes[MASKED_PASS] = glossy_mask(passes)
        return {name: image for name, image in passes.items() if name not in added}, cost


@contextmanager
def _light_passes(scene: bpy.types.Scene) -> Iterator[set[str]]:
    """Have glossy and transmission passes switched on, for the time of a `with` block; yields the names of those that
    were off before, and are switched off afterwards.
    """
    layer = rendered_layer(scene)
    off = {switch: names for switch, names in LIGHT_SWITCHES.items() if not getattr(layer, switch)}
    try:
        for switch in off:
            setattr(layer, switch, True)
        yield {name for names in off.values() for name in names}
    finally:
        for switch in off:
            setattr(layer, switch, False)
