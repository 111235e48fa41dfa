"""A job that renders many views of a frame into a folder, in a process of its own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import bpy

from ..stereo_reproject.jobs.views_progress import ViewsProgress
from ..stereo_reproject.jobs.work_folder import views_files
from ..stereo_reproject.pipeline.stages import Stage
from ..stereo_reproject.settings.frame import StereoSettings
from ..stereo_reproject.settings.views import ViewsSettings
from .run import BackgroundJob, Pictures


class ViewsJob(BackgroundJob):
    """A `BackgroundJob` that renders many views. Their files go straight into the folder `output`, which stays; what is
    removed in the end is only the copy of the .blend."""

    stage_words: ClassVar[Mapping[str, str]] = {
        Stage.SOURCE: "Rendering a view whole",
        Stage.DENOISE_SOURCE: "Denoising a view",
        Stage.FILL: "Rendering what other views do not show",
        Stage.COMPOSITE: "Putting a view together",
        Stage.DENOISE_TARGET: "Denoising a view",
        Stage.WRITE: "Writing the quilt",
        Stage.COMPARE: "Rendering views plainly to compare",
    }

    def __init__(
        self,
        scene: bpy.types.Scene,
        settings: StereoSettings,
        views: ViewsSettings,
        output: Path,
        pictures: Pictures,
    ) -> None:
        self.views, self.output = views, output
        progress = ViewsProgress(views.count)
        super().__init__(scene, settings, "views", views_files(views.names), progress, pictures=pictures)
