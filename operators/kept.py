"""Pairs that were rendered and could not be handed over: their folders, and the operator that opens them."""

from __future__ import annotations

import contextlib
import shutil
from pathlib import Path

import bpy

from ..stereo_reproject.errors import StereoReprojectError
from ..stereo_reproject.files import flush
from ..stereo_reproject.images.exr import VIEWS, read_eye, read_metadata, write_stereo
from ..stereo_reproject.words import Words
from .pictures import show_image
from .run import BackgroundJob
from .text import reported, shown

BOTH = "stereo.exr"

_kept: list[Path] = []
"""The folders of those that nobody has opened yet."""


def kept_pair() -> Path | None:
    """Return the folder of the last kept pair that nobody has opened yet; None if there is none."""
    return next((folder for folder in reversed(_kept) if folder.is_dir()), None)


def keep_files(run: BackgroundJob) -> Path | None:
    """Put the files of a finished pair into a new folder where they stay: beside the .blend that was rendered, or else
    among temporary files.

    Return the folder, or None if the run holds no pair. Raises OSError if neither place takes the files.
    """
    if not run.holds_pair:
        return None
    folder = None
    if run.beside is not None:
        with contextlib.suppress(OSError):
            folder = _copied(run, run.beside)
    if folder is None:
        folder = _new_folder(run, run.temporary)
        for path in sorted(run.folder.iterdir()):
            # On the same drive, and so without any room on it.
            path.rename(folder / path.name)
    _kept.append(folder)
    return folder


def _copied(run: BackgroundJob, place: Path) -> Path:
    """Copy the run's files into a new folder in `place`, and return that folder. After an OSError, which is raised
    again, the new folder is gone.
    """
    folder = _new_folder(run, place)
    try:
        for path in sorted(run.folder.iterdir()):
            shutil.copy2(path, folder / path.name)
            flush(folder / path.name)
    except OSError:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return folder


def _new_folder(run: BackgroundJob, place: Path) -> Path:
    """Make a folder in `place`, named after the .blend and numbered where the name is taken; return it. Raises
    OSError.
    """
    for number in range(1, 1000):
        folder = place / f"{run.name}_stereo_pair{'' if number == 1 else f'_{number}'}"
        try:
            folder.mkdir()
        except FileExistsError:
            continue
        return folder
    raise FileExistsError(f"all names of kept pairs are taken in {place}")


class STEREO_REPROJECT_OT_open_kept(bpy.types.Operator):
    """Open the pair that could not be handed over to Blender, as an image with both eyes"""

    bl_idname = "stereo_reproject.open_kept"
    bl_label = "Open Kept Stereo Pair"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        """Return whether there is a kept pair that nobody has opened."""
        cls.poll_message_set(shown("Every pair was handed over: it is the Render Result"))
        return kept_pair() is not None

    def execute(self, _context: bpy.types.Context) -> set[str]:
        """Load the last kept pair as one image with both eyes, and show it in an Image Editor."""
        folder = kept_pair()
        assert folder is not None
        try:
            path = folder / BOTH
            if not path.exists():
                eyes = {view: read_eye(folder / f"{view}.exr") for view in VIEWS}
                write_stereo(path, eyes, metadata=read_metadata(folder / f"{VIEWS[0]}.exr"))
            image = bpy.data.images.load(str(path))
        except (StereoReprojectError, OSError, RuntimeError) as error:
            reason = str(error) if isinstance(error, StereoReprojectError) else " ".join(str(error).split())
            what = Words("The pair in {folder} cannot be opened: {reason}", folder=folder, reason=reason)
            self.report({"ERROR"}, reported(what))
            return {"CANCELLED"}
        _kept.remove(folder)
        shown = show_image(image)
        elsewhere = Words(
            "{path} is the image {image}: choose it in an Image Editor", path=path, image=repr(image.name)
        )
        self.report({"INFO"}, str(path) if shown else reported(elsewhere))
        return {"FINISHED"}
