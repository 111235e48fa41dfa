"""The task of making one frame: all that its steps share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..settings.frame import StereoSettings
from ..trace.costs import TraceCosts
from ..views.camera import see_the_same
from ..views.view import Rig, View
from .renderer import Renderer
from .shared_findings import SharedFindings
from .stopwatch import Stopwatch


@dataclass(frozen=True)
class FrameTask:
    """One frame that is to be made.

    renderer renders its scene, and settings say how it is asked for. findings are those of other frames of the same
    animation; known_costs returns the costs of tracing as far as they are known. The steps tell the watch which stages
    begin.
    """

    renderer: Renderer
    settings: StereoSettings
    findings: SharedFindings
    known_costs: Callable[[], TraceCosts]
    watch: Stopwatch

    @property
    def source(self) -> View:
        """The view that is rendered whole."""
        return self._rig[self.settings.source]

    @property
    def target(self) -> View:
        """The view that is made from the source."""
        return self._rig[self.settings.target]

    @property
    def may_differ(self) -> bool:
        """True where something may look different from each of the two views, so that probes are needed where anything
        is promised."""
        return bool(self.renderer.plan.view_dependent) and not see_the_same(self.source.camera, self.target.camera)

    @property
    def _rig(self) -> Rig:
        """All views of the renderer."""
        return Rig.of_cameras(self.renderer.cameras, self.renderer.motion)
