"""The pictures of many views of a frame: quilt, contact sheet and sweep, as the scene's compositor has them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy

from ...delivery.quilts import quilt_name
from ...jobs.work_folder import CONTACT_SHEET, HOLES_FOLDER, SWEEP, views_files
from ...settings.frame import StereoSettings
from ...settings.views import ViewsSettings
from ..output.quilt_files import quilt_of, write_contact_sheet, write_quilt, write_sweep
from ..output.view_files import ViewFiles, composited_files
from .view_rigs import ViewRig


@dataclass(frozen=True)
class ViewPlaces:
    """Folders of a run: `work`, for what passes between the stages, that of the views' files, and that of the pictures
    of their holes, None where none are made. keeps_passes: True where the views' files are what users get; else they
    have the colour alone."""

    work: Path
    views: Path
    holes: Path | None = None
    keeps_passes: bool = True


def write_pictures(
    scene: bpy.types.Scene, settings: StereoSettings, views: ViewsSettings, rig: ViewRig, places: ViewPlaces
) -> list[str]:
    """Write the quilt, the contact sheet and the sweep of the views; return the names of all files of the result."""
    frame, out, files = settings.scene.frame, places.work / "out", rig.files
    folder = composited_files(scene, places.views, rig.file_names, places.work / "composited", frame=frame)
    pictures, along = ViewFiles(folder, rig.file_names), ViewFiles(folder, [files[name] for name in rig.made])
    quilts: list[str] = []
    height, width = pictures[0].shape[:2]
    quilt = quilt_of(scene, views, (width, height))
    if quilt is not None:
        name = quilt_name(quilt.columns, quilt.rows, quilt.aspect)
        quilts = [f"{name}.png", f"{name}.exr"]
        for file in quilts:
            write_quilt(scene, ViewFiles(folder, rig.in_quilt), quilt.columns, quilt.rows, out / file, frame=frame)
    write_contact_sheet(scene, pictures, rig.names, out / CONTACT_SHEET, frame=frame)
    write_sweep(scene, along, out / SWEEP, frame=frame)
    holes = [] if places.holes is None else sorted(f"{HOLES_FOLDER}/{path.name}" for path in places.holes.glob("*.png"))
    return [*quilts, *holes, *views_files(rig.file_names, views.layout)]
