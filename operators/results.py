"""Results of the last runs, for the panels: in memory, and gone with the session."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from ..stereo_reproject.jobs.work_folder import CUTOUTS, DIFFERENCE
from ..stereo_reproject.report.verdict import UNCERTAIN_AREAS
from ..stereo_reproject.settings.frame import StereoSettings
from ..stereo_reproject.views.depth_range import EdgeHit
from .run import BackgroundJob

OF_PANORAMAS = "CUTOUTS"
"""Key of the picture that pairs of panoramas alone have."""

PICTURES = {
    "HOLES": ("holes.png", "Rendered Again", "Which pixels of the second eye were rendered, and why"),
    "GRID": (
        "grid.png",
        "Grid",
        "The grid that warped the first eye's pixels: wide cells on one surface, fine ones where depth changes",
    ),
    "ERRORS": (
        "estimate.png",
        UNCERTAIN_AREAS,
        (
            "Where the second eye is still off by more than noise, as far as spot checks tell, after the uncertain"
            " areas that they found were rendered again"
        ),
    ),
    "DIFFERENCE": (DIFFERENCE, "Difference", "How far the second eye is from Blender's multiview; needs Compare"),
    OF_PANORAMAS: (
        CUTOUTS,
        "In a Headset",
        "What a headset shows of a panorama, in several directions: both eyes, and the pixels that were rendered again",
    ),
}
"""The pictures that explain a pair: file, name, and what it shows."""


@dataclass(frozen=True)
class SlotContent:
    """One render in a render slot: the slot's place, its name, and how often it had been rendered into by then."""

    place: int
    name: str
    renders: int


@dataclass(frozen=True)
class Delivery:
    """A picture that was handed over: what its render slot held then (None without a Render Result), its frame (None
    where it stands for many), the time of day, and whether it is a preview. multiview is what a slot held that got
    multiview's pair to compare with.
    """

    content: SlotContent | None
    frame: int | None
    clock: str
    preview: bool = False
    multiview: SlotContent | None = None


@dataclass(frozen=True)
class KnownDepth:
    """Nearest and farthest depth that the scene's camera saw at a frame, in scene units; +inf is the sky.

    edges is what was seen at the frame's edges, None where nobody looked there; that of a pair may have no names.
    seen_from is the camera's state at a measurement, and empty where a pair or a check found the depths.
    """

    near: float
    far: float
    frame: int
    edges: tuple[EdgeHit, ...] | None = None
    seen_from: tuple[float, ...] = ()

    @property
    def ends(self) -> tuple[tuple[str, float], tuple[str, float]]:
        """The names of both ends, for artists, with their depths."""
        return ("Nearest", self.near), ("Farthest", self.far)

    @classmethod
    def of_report(cls, report: Mapping[str, Any], edges: tuple[EdgeHit, ...] | None = None) -> KnownDepth | None:
        """Return the depths that the report of a pair or of a check has, with these edges; None if nothing was in
        view.
        """
        seen = report.get("parallax")
        if not seen:
            return None
        # JSON has no infinity: None stands for it.
        near, far = (
            float("inf") if seen[end]["depth"] is None else seen[end]["depth"] for end in ("nearest", "farthest")
        )
        return cls(near, far, report["frame"], edges)


@dataclass(frozen=True)
class DeliveredViews:
    """Many views that were rendered: their report, the folder with their files, and the time of day."""

    report: Mapping[str, Any]
    folder: Path
    clock: str


@dataclass
class Result:
    """Results of one scene: its last pair's report and pictures, and the findings of its last check."""

    report: Mapping[str, Any] | None = None
    animation: Mapping[str, Any] | None = None
    """Report of the animation that was rendered last, where no pair was rendered since."""
    new_totals: Mapping[str, Any] | None = None
    """Totals of those of its frames that this run has rendered; None where there is no such animation."""
    delivery: Delivery | None = None
    """Picture that `report` or `animation` is about; None before the first."""
    inspection: Mapping[str, Any] | None = None
    inspected: StereoSettings | None = None
    """Settings for which the check was made."""
    warnings: list[str] = field(default_factory=list)
    depth: KnownDepth | None = None
    """Depths that a measurement, a pair or a check saw last."""
    fitted: str = ""
    """Line about the last fit to comfort; "" before the first."""
    fitted_to: tuple[float, float] = (0.0, 0.0)
    """Interocular and convergence distance that the fit has set."""
    views: DeliveredViews | None = None
    """Many views that were rendered last; None before the first."""
    run: BackgroundJob | None = None
    """Job that still holds the pictures."""
    ended: str = ""
    """Reason in a line for which the last job ended without a result; "" where it has one, or none has ended."""
    failed: bool = False
    """True where that job failed, and was not cancelled."""
    frames_stay: bool = False
    """True where that job was an animation that was cancelled when frames of it were there."""

    def picture(self, which: str) -> Path | None:
        """Return the path of one of the last pair's pictures, by its key in `PICTURES`; None if there is none."""
        if self.run is None:
            return None
        path = self.run.folder / PICTURES[which][0]
        return path if path.exists() else None


_by_scene: dict[int, Result] = {}


def result_of(scene: bpy.types.Scene) -> Result:
    """Return the results kept for a scene; empty ones where nothing is kept yet. They are found by an id that stays
    when the scene is renamed or an undo moves it.
    """
    return _by_scene.setdefault(scene.session_uid, Result())


def has_preview(scene: bpy.types.Scene) -> bool:
    """Return whether the picture of a scene that was handed over last is a preview."""
    delivery = result_of(scene).delivery
    return delivery is not None and delivery.preview


def _forget_gone() -> None:
    """Forget results of scenes that were deleted, or of a file that is no longer open."""
    there = {scene.session_uid for scene in bpy.data.scenes}
    for uid in [uid for uid in _by_scene if uid not in there]:
        _forget(uid)


def _forget(uid: int) -> None:
    """Forget the results of the scene with this session id, and remove the files of its last pair."""
    result = _by_scene.pop(uid)
    if result.run is not None:
        result.run.close()


def keep_pair(
    scene: bpy.types.Scene, run: BackgroundJob, delivery: Delivery, edges: tuple[EdgeHit, ...] | None
) -> None:
    """Keep the report, warnings and pictures of a finished run for the panels; delivery is its picture, and edges is
    what it shows at the frame's edges, None if that is not known. Files of the scene's earlier pair are removed, and
    results of deleted scenes are forgotten.
    """
    _forget_gone()
    result = result_of(scene)
    if result.run is not None:
        result.run.close()
    result.report, result.warnings, result.run = run.report, run.warnings, run
    result.animation, result.new_totals, result.delivery = None, None, delivery
    if run.report is not None:
        result.depth = KnownDepth.of_report(run.report, edges) or result.depth


def keep_animation(
    scene: bpy.types.Scene, run: BackgroundJob, delivery: Delivery, new_totals: Mapping[str, Any]
) -> None:
    """Keep the report and warnings of a finished animation for the panels, in place of those of the scene's last
    pair, whose files are removed. delivery is the picture that is shown, and new_totals are those of the frames that
    the run has rendered.
    """
    _forget_gone()
    result = result_of(scene)
    if result.run is not None:
        result.run.close()
    result.report = result.run = None
    result.animation, result.new_totals = run.report, new_totals
    result.warnings, result.delivery = run.warnings, delivery


def keep_depth(scene: bpy.types.Scene, depth: KnownDepth | None) -> None:
    """Keep the depths that a picture of the scene shows, in place of those that were known; None is passed over."""
    result = result_of(scene)
    result.depth = depth or result.depth


def keep_views(scene: bpy.types.Scene, views: DeliveredViews) -> None:
    """Keep what is known of many views for the panels. What is kept of the scene's last pair stays."""
    _forget_gone()
    result_of(scene).views = views


def keep_inspection(scene: bpy.types.Scene, run: BackgroundJob) -> None:
    """Keep the findings of a finished check for the panels."""
    assert run.report is not None
    result = result_of(scene)
    result.inspection, result.inspected = run.report, run.settings
    result.depth = KnownDepth.of_report(run.report) or result.depth


def forget_all() -> None:
    """Forget the results of all scenes, and remove their files from the disk."""
    for uid in list(_by_scene):
        _forget(uid)
