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
    """One view that is to be made from another one, or from others.

    renderer renders the scene, and settings say how the frame is asked for. source is the view that is rendered whole,
    or the first of several; target is the view that is made. findings are those of other frames of the same
    animation; known_costs returns the costs of tracing as far as they are known. The steps tell the watch which stages
    begin.
    """

    renderer: Renderer
    settings: StereoSettings
    source: View
    target: View
    findings: SharedFindings
    known_costs: Callable[[], TraceCosts]
    watch: Stopwatch

    @classmethod
    def of_pair(
        cls,
        renderer: Renderer,
        settings: StereoSettings,
        findings: SharedFindings,
        known_costs: Callable[[], TraceCosts],
        watch: Stopwatch,
    ) -> FrameTask:
        """Return the task of a stereo pair, whose two views the settings name; they are the same of a mono frame."""
        rig = Rig.of_cameras(renderer.cameras, renderer.motion)
        return cls(renderer, settings, rig[settings.source], rig[settings.target], findings, known_costs, watch)

    @property
    def may_differ(self) -> bool:
        """True where something may look different from each of the two views, so that probes are needed where anything
        is promised."""
        return bool(self.renderer.plan.view_dependent) and not see_the_same(self.source.camera, self.target.camera)
