"""The files of an animation whose frames are many views: their names, and what a writer needs to know of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..delivery.quilts import Quilt
from ..jobs.work_folder import ALL_VIEWS, VIEWS_FOLDER
from ..settings.views import VIEWS_LAYOUTS

FRAMES_NAME = "quilt_"
"""Common beginning of the names of quilts; the number of the frame follows."""

SCENE_VIEWS_NAME = "views_"
"""Name of the frames of a scene's own views, which may have no quilt, in the journal and in that of their report."""

QUILT_ORDER = "quilt.json"
"""Name of the file that is handed to the writer with a frame: "views" are the names of its views' files, without an
extension, in the order of their places in the quilt. Of a scene's own views it may differ from frame to frame."""

REPORTS_FOLDER = "reports"
"""Name of the folder, in that of the frames, for each frame's own report."""


@dataclass(frozen=True)
class QuiltFrames:
    """The files of the frames of many views: their quilt, None where they have none; the names of the views' files,
    without an extension, by view; and how the views of a frame are stored besides, one of `VIEWS_LAYOUTS`, None where
    they are not. All names of files are paths in the folder of the frames."""

    quilt: Quilt | None
    views: Mapping[str, str]
    layout: str | None

    def __post_init__(self) -> None:
        assert self.layout is None or self.layout in VIEWS_LAYOUTS
        assert self.layout is not None or self.quilt is not None

    @classmethod
    def of_fields(cls, fields: Mapping[str, Any]) -> QuiltFrames:
        """Return what has these fields, which may come out of JSON, where tuples are lists."""
        quilt = None
        if fields["quilt"] is not None:
            size = fields["quilt"]["view_size"]
            quilt = Quilt(**{**fields["quilt"], "view_size": (int(size[0]), int(size[1]))})
        return cls(quilt, dict(fields["views"]), fields["layout"])

    def quilts(self, frame: int) -> list[str]:
        """Return the names of the files of a frame's quilt, such as "quilt_0007_qs8x6a0.75.png", the PNG first; none
        without a quilt."""
        if self.quilt is None:
            return []
        return [f"{FRAMES_NAME}{frame:04d}_{self.quilt.tag}.{extension}" for extension in ("png", "exr")]

    def report(self, frame: int) -> str:
        """Return the name of a frame's report, such as "reports/0007.json"."""
        return f"{REPORTS_FOLDER}/{frame:04d}.json"

    def view_files(self, frame: int) -> dict[str, str]:
        """Return the names of the files of a frame's views, by the views' names, such as "views/view_00_0007.exr": the
        frames of one view are a sequence of pictures. Empty where views have no files of their own."""
        if self.layout != VIEWS_LAYOUTS[0]:
            return {}
        return {view: f"{VIEWS_FOLDER}/{file}_{frame:04d}.exr" for view, file in self.views.items()}

    def all_views(self, frame: int) -> str | None:
        """Return the name of the one file of all views of a frame, such as "views_0007.exr"; None where there is
        none."""
        stem, dot, extension = ALL_VIEWS.rpartition(".")
        return f"{stem}_{frame:04d}{dot}{extension}" if self.layout == VIEWS_LAYOUTS[1] else None

    def stored_views(self, frame: int) -> list[str]:
        """Return the names of the files that have a frame's views besides its quilt."""
        all_views = self.all_views(frame)
        return [*self.view_files(frame).values(), *([] if all_views is None else [all_views])]

    def pictures(self, frame: int) -> list[str]:
        """Return the names of those files that show a frame: the PNG of its quilt, or without one the views."""
        return self.quilts(frame)[:1] or self.stored_views(frame)

    def files(self, frame: int) -> list[str]:
        """Return the names of all files of a frame, the report last."""
        return [*self.quilts(frame), *self.stored_views(frame), self.report(frame)]
