"""Renders the frames of an animation that are many views each."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from ...files import write_json
from ...jobs.work_folder import FILES, VIEWS_FOLDER
from ...pipeline.stages import RENDERING
from ...report.as_json import as_json
from ...report.views_report import RENDERED, ViewsReport
from ...sequence.quilt_frames import QUILT_ORDER
from ...settings.views import ViewsSettings
from ..output.view_files import runs_compositor
from .frame_maker import BlenderFrameMaker, MakerJob
from .views import SharedFrame, render_views_of_frame
from .views_pictures import ViewPlaces

KEYS_OF_A_FRAME = ("size", "samples", "accuracy", "seconds", "memory")
"""Keys of a report on many views that the report of an animation has for each frame."""


class ViewsFrameMaker(BlenderFrameMaker):
    """Maker of frames that are many views; `views` are their settings, and the job's order has their files."""

    def __init__(self, job: MakerJob, views: ViewsSettings) -> None:
        super().__init__(job)
        assert job.order.quilt is not None
        self._views, self._files = views, job.order.quilt

    def _made(self, frame: int, folder: Path) -> tuple[dict[str, Any], dict[str, str]]:
        """Render the views of a frame, as `BlenderFrameMaker` says. Its own report goes into the folder too."""
        start = time.perf_counter()
        (folder / VIEWS_FOLDER).mkdir(parents=True, exist_ok=True)
        settings = self._settings_at(frame)
        # A compositor may read any of them.
        keeps_passes = self._files.layout is not None or runs_compositor(self._scene)
        report, kept = render_views_of_frame(
            self._scene,
            settings,
            self._views,
            ViewPlaces(self._work, folder / VIEWS_FOLDER, keeps_passes=keeps_passes),
            self._onlooker_at(frame),
            self._listener.warn,
            SharedFrame(self._scenes, self._findings_of, learns=self._last is None),
        )
        wall = time.perf_counter() - start
        figures = {**_figures(report), "wall_seconds": wall, "compare": None}
        figures["beside_seconds"] = wall - sum(report.seconds.get(stage, 0.0) for stage in RENDERING)
        fields = {**as_json(report), "files": self._files.files(frame)}
        write_json(folder / FILES[-1], fields)
        write_json(folder / QUILT_ORDER, {"views": list(kept.rig.in_quilt)})
        return figures, {}


def _figures(report: ViewsReport) -> dict[str, Any]:
    """Return what the report of an animation has of the views of a frame, by its keys, apart from the seconds beside
    its stages.

    fractions["rerendered"] is the share of the pixels of all views that was rendered or traced. multiview_seconds are
    predicted for rendering each view, as Blender's multiview does.
    """
    fields = as_json(report)
    known = [view.honest_ratio for view in report.views if view.honest_ratio is not None]
    return {
        **{key: fields[key] for key in KEYS_OF_A_FRAME},
        "views": len(report.views),
        "rendered_views": sum(view.how == RENDERED for view in report.views),
        "honest_ratio": max(known, default=None),
        "fractions": {"rerendered": float(np.mean([view.traced for view in report.views]))},
        "multiview_seconds": report.predicted_speedup * report.seconds["total"],
        "warnings": list(report.warnings),
    }
