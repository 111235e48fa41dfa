"""A frame's eyes from the renderer's files into the scene's own format, and into their place."""

from __future__ import annotations

import errno
import json
import shutil
import time
from collections.abc import Collection, Mapping
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Any

import bpy

from ...delivery.quilts import Quilt
from ...errors import StereoReprojectError
from ...files import made_in
from ...images.exr import VIEWS, read_eye
from ...images.multi_view import write_multi_view
from ...jobs.memory import give_back_freed
from ...jobs.supervisor import Session
from ...jobs.work_folder import ALL_VIEWS, FILES, VIEWS_FOLDER
from ...sequence.frames import publish_frame
from ...sequence.journal import Journal
from ...sequence.output_errors import blamed_on_output, failed_output, is_full
from ...sequence.quilt_frames import QUILT_ORDER, QuiltFrames
from ...sequence.writer_process import WriterJob, WrittenFrame
from ...words import Words
from ..scene.compositor import compositor_tree
from .delivery import deliver_frames, pixels_of
from .layouts import as_ordered, deliver_anaglyph, is_our_own
from .opening import open_session
from .pictures import check_png
from .quilt_files import write_quilt
from .view_files import ViewFiles, composited_files

HOLES = "holes"
"""The folder, in the frames' own, for pictures of what was traced, and what such a picture is called before."""


CUTOUTS = "cutouts"
"""Folder and name of the pictures of a panorama's cut-outs, as `HOLES` has them."""


def picture_name(journal: Journal, frame: int, kind: str = HOLES) -> str:
    """Return the path, in the frames' folder, of the picture of a frame's traced pixels; with `CUTOUTS` as kind of its
    cut-outs."""
    return f"{kind}/{journal.name}{frame:04d}.png"


FULL_DRIVE_BYTES = 1 << 16
"""Bytes free on a drive on which a file may have been cut off."""


class FrameWriter:
    """Writer of an animation's frames, in the writer process. It is made with the fields of a `WriterJob`, whose .blend
    it opens. Raises BadInputError.
    """

    def __init__(self, job: Mapping[str, Any]) -> None:
        quilt = None if job["quilt"] is None else QuiltFrames.of_fields(job["quilt"])
        self._job = WriterJob(**{**job, "session": Session(**job["session"]), "quilt": quilt})
        scene = open_session(Path(self._job.blend), self._job.session)
        strip(scene)
        self._journal = Journal(Path(self._job.folder), self._job.name)
        self._pictures = PairPictures(scene, self._job, self._journal) if quilt is None else QuiltPictures(scene, quilt)

    def write(self, fields: Mapping[str, Any]) -> dict[str, Any] | None:
        """Write a frame's files in their final place, and remove the folder that it was handed over in. fields are
        those of a `WrittenFrame`. Return the fields of its record; None where the frame was left to another run. Raises
        StereoReprojectError.
        """
        frame = WrittenFrame(**fields)
        start = time.perf_counter()
        folder = Path(frame.folder)
        try:
            made = self._delivered(frame, folder)
            figures = {**frame.record["figures"], "write_seconds": time.perf_counter() - start}
            record = publish_frame(self._journal, made, {**frame.record, "figures": figures}, frame.claim)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        give_back_freed()
        return None if record is None else asdict(record)

    def _delivered(self, frame: WrittenFrame, folder: Path) -> dict[str, Path]:
        """Write the frame's files into its private folder. Return their paths, by the paths that they are to have in
        the frames' folder.
        """
        try:
            made = self._pictures.deliver(frame, folder)
        except OSError as error:
            raise failed_output(self._journal.frames_folder, error) from error
        except StereoReprojectError as error:
            raise blamed_on_output(self._journal.frames_folder, error) from error
        self._check_whole(made.values(), frame.frame)
        return made

    def _check_whole(self, files: Collection[Path], number: int) -> None:
        """Raise StereoReprojectError unless the files of the frame of this number are there and whole. Blender says
        nothing when a full disk cuts a file off.
        """
        if not files:
            raise StereoReprojectError(
                Words("Blender wrote no file for frame {number}: check the output settings", number=number)
            )
        place = self._journal.frames_folder
        if is_full(place, below=FULL_DRIVE_BYTES):
            raise failed_output(place, OSError(errno.ENOSPC, "No space left on device"))
        for path in files:
            if path.stat().st_size == 0:
                raise StereoReprojectError(
                    Words("Blender wrote {name} with nothing in it: check the output settings", name=path.name)
                )
            if path.suffix == ".png":
                check_png(path)


class PairPictures:
    """The files of frames that are pairs, or of one view, as Blender writes them: in the format of the scene's own
    output settings, or of the job's, which stay set."""

    def __init__(self, scene: bpy.types.Scene, job: WriterJob, journal: Journal) -> None:
        self._scene, self._job, self._journal = scene, job, journal
        self._changes = ExitStack()
        self._changes.enter_context(pixels_of(scene, job.panorama))
        self._changes.enter_context(as_ordered(scene, job.output, job.layout, job.file_format))

    def deliver(self, frame: WrittenFrame, folder: Path) -> dict[str, Path]:
        """Have Blender write a frame's files into its private folder. Return their paths, by the paths that they are to
        have in the frames' folder. Raises OSError and StereoReprojectError.
        """
        out, number = folder / "out", frame.frame
        deliver = deliver_anaglyph if is_our_own(self._job.layout) else deliver_frames
        if self._job.mono:
            eyes = {"": read_eye(folder / f"{VIEWS[0]}.exr")}
        else:
            eyes = {view: read_eye(folder / f"{view}.exr") for view in VIEWS}
        deliver(self._scene, lambda _: eyes, out, frames=range(number, number + 1), metadata=frame.metadata)
        made = {path.name: path for path in made_in(out)}
        for kind in (HOLES, CUTOUTS) if made else ():
            picture = folder / f"{kind}.png"
            if picture.exists():
                made[picture_name(self._journal, number, kind)] = picture
        return made


class QuiltPictures:
    """The files of frames that are many views: their quilt, if they have one, as a PNG through the scene's compositor
    and view transform and as an EXR, and what was handed over besides."""

    def __init__(self, scene: bpy.types.Scene, files: QuiltFrames) -> None:
        self._scene, self._files = scene, files

    def deliver(self, frame: WrittenFrame, folder: Path) -> dict[str, Path]:
        """Write a frame's files into its private folder; all else is as for `PairPictures.deliver`."""
        number, views = frame.frame, folder / VIEWS_FOLDER
        made = {} if self._files.quilt is None else self._quilts(self._files.quilt, number, folder)
        of_views = {view: views / f"{file}.exr" for view, file in self._files.views.items()}
        kept = {name: of_views[view] for view, name in self._files.view_files(number).items()}
        all_views = self._files.all_views(number)
        if all_views is not None:
            kept[all_views] = folder / ALL_VIEWS
            write_multi_view(kept[all_views], of_views)
        return {**made, **kept, self._files.report(number): folder / FILES[-1]}

    def _quilts(self, quilt: Quilt, number: int, folder: Path) -> dict[str, Path]:
        """Write the quilt of the frame of this number into its private folder. Return the files' paths, as `deliver`
        does."""
        views = json.loads((folder / QUILT_ORDER).read_text(encoding="utf-8"))["views"]
        composited = composited_files(self._scene, folder / VIEWS_FOLDER, views, folder / "composited", frame=number)
        made = {}
        for name in self._files.quilts(number):
            made[name] = path = folder / f"quilt{Path(name).suffix}"
            write_quilt(self._scene, ViewFiles(composited, views), quilt.columns, quilt.rows, path, frame=number)
        return made


def strip(scene: bpy.types.Scene) -> None:
    """Take out of a scene, and of the open file, what the delivery of finished pictures does not need: all that would
    be evaluated or kept in memory for nothing. Cameras stay, since Blender asks for one and markers switch between
    them. For processes that only write.
    """
    for_compositor = scene.render.use_compositing and compositor_tree(scene) is not None
    driven = scene.animation_data is not None and len(scene.animation_data.drivers) > 0
    cameras = {scene.camera, *(marker.camera for marker in scene.timeline_markers)} - {None}
    if scene.library is not None:
        return
    root = scene.collection
    for collection in list(root.children):
        root.children.unlink(collection)
    for item in list(root.objects):
        root.objects.unlink(item)
    for camera in cameras:
        root.objects.link(camera)
    if for_compositor or driven:
        # Nodes may show another scene, and drivers may look at any object.
        return
    for other in [other for other in bpy.data.scenes if other != scene]:
        bpy.data.scenes.remove(other)
    scene.world = None
    bpy.data.orphans_purge(do_local_ids=True, do_linked_ids=True, do_recursive=True)
