"""The frames of a scene, one after the other, into the files that the scene's own output settings ask for."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy

from ..errors import BadInputError, StereoReprojectError
from ..exr import VIEWS, read_eye, write_eye
from ..passes import COLOUR_PASS, Passes
from ..report import write_json
from ..settings import StereoSettings
from .delivery import deliver_movie, deliver_to_result
from .frame import render_pair
from .scene import scene_frames, scene_warnings

ANIMATION_FILES = ("left.exr", "right.exr", "report.json")
"""What is left of an animation besides its own files: the last frame's eyes, and what became of each frame."""


def render_animation_files(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    work: Path,
    *,
    frames: range | None = None,
    on_stage: Callable[[str, str], None] = lambda _stage, _detail: None,
) -> dict[str, Any]:
    """Render the pair of each frame, and have Blender write it to the scene's output path, format and layout.

    A file appears under its final name when it is whole; a frame whose files are there is left out when the scene's
    Overwrite is off. The last frame's eyes and the report are left in work/out. work is a private folder. on_stage is
    told a stage's name and which frame it is of. Raises BadInputError and StereoReprojectError.
    """
    frames = scene_frames(scene) if frames is None else frames
    movie = scene.render.is_movie_format
    writer = (_Movie if movie else _Stills)(scene, frames, work)
    (work / "out").mkdir(exist_ok=True)
    rows = []
    for frame in writer.missing:
        of_frame = f"frame {frame} of {frames[0]} to {frames[-1]}"

        def tell(stage: str, detail: str = of_frame) -> None:
            on_stage(stage, detail)

        of_this = replace(settings, compare=False, scene=replace(settings.scene, frame=frame))
        pair, report = render_pair(scene, of_this, work, on_stage=tell)
        tell("write")
        writer.write(frame, pair.eyes)
        rows.append({"frame": frame, "files": [], **{key: report[key] for key in ("seconds", "fractions", "fill")}})
        for view in VIEWS:
            write_eye(work / "out" / f"{view}.exr", pair.eyes[view], view=view)
    on_stage("write", "")
    report = {
        "schema": 1,
        "scene": Path(bpy.data.filepath).stem or scene.name,
        "frames": rows,
        "there_already": [frame for frame in frames if frame not in writer.missing],
        "files": [str(path) for path in writer.finish()],
        "warnings": scene_warnings(scene, compositor=False),
    }
    write_json(work / "out" / "report.json", report)
    return report


class _Stills:
    """Each frame in files of its own, as soon as it is there."""

    def __init__(self, scene: bpy.types.Scene, frames: range, work: Path) -> None:
        self._scene, self._work = scene, work
        self._files: list[Path] = []
        paths = {frame: output_files(scene, frame) for frame in frames}
        self.missing = [frame for frame in frames if not _is_done(scene, paths[frame])]
        if not self.missing:
            raise BadInputError("every frame is there already: switch on Overwrite in Output to render them again")
        for paths_of_frame in paths.values():
            _make_folder(paths_of_frame[0].parent)

    def write(self, frame: int, eyes: Mapping[str, Passes]) -> None:
        final = output_files(self._scene, frame)[0]
        with _empty_folder(self._work / "tmp" / "frame") as folder:
            deliver_to_result(self._scene, eyes, folder / _plain_name(self._scene, frame), frame=frame)
            self._files += _move_all(folder, final.parent)

    def finish(self) -> list[Path]:
        return self._files


class _Movie:
    """All frames in one file, or one for each eye, when the last of them is there."""

    def __init__(self, scene: bpy.types.Scene, frames: range, work: Path) -> None:
        self._scene, self._frames, self._work = scene, frames, work
        self._size = (0, 0)
        paths = output_files(scene, frames[0])
        if _is_done(scene, paths):
            raise BadInputError(f"{paths[0]} is there already: switch on Overwrite in Output to render it again")
        self.missing = list(frames)
        self._folder = paths[0].parent
        _make_folder(self._folder)

    def write(self, frame: int, eyes: Mapping[str, Passes]) -> None:
        for view in VIEWS:
            wanted = eyes[view] if self._scene.render.use_compositing else {COLOUR_PASS: eyes[view][COLOUR_PASS]}
            write_eye(self._eye(frame, view), wanted, view=view)
        height, width = eyes["left"][COLOUR_PASS].shape[:2]
        self._size = (width, height)

    def finish(self) -> list[Path]:
        with _empty_folder(self._work / "tmp" / "movie") as folder:
            path = folder / _plain_name(self._scene, self._frames[0])
            deliver_movie(self._scene, self._eyes_at, path, size=self._size, frames=self._frames)
            return _move_all(folder, self._folder)

    def _eyes_at(self, frame: int) -> dict[str, Passes]:
        return {view: read_eye(self._eye(frame, view)) for view in VIEWS}

    def _eye(self, frame: int, view: str) -> Path:
        return self._work / "tmp" / f"{view}.{frame}.exr"


def output_files(scene: bpy.types.Scene, frame: int) -> list[Path]:
    """The files that a frame's pair is written to by the scene's own settings; a movie's for any of its frames.

    Raises BadInputError when the output path cannot be used.
    """
    render = scene.render
    if not getattr(render, "save_output", True):
        raise BadInputError("Output is switched off in Output properties: no file of an animation would be written")
    if render.filepath.startswith("//") and not bpy.data.filepath:
        raise BadInputError("the output path is relative to a file that was never saved: save it, or change the path")
    multiview = render.use_multiview
    try:
        render.use_multiview = True
        single = render.image_settings.views_format != "INDIVIDUAL"
        names = [render.frame_path(frame=frame, view="" if single else view) for view in VIEWS[: 1 if single else 2]]
    except RuntimeError as error:
        raise BadInputError(f"the output path cannot be used: {' '.join(str(error).split())}") from error
    finally:
        render.use_multiview = multiview
    return [Path(name) for name in names]


def _plain_name(scene: bpy.types.Scene, frame: int) -> str:
    """The file's name without a view's suffix."""
    return Path(scene.render.frame_path(frame=frame)).name


def _is_done(scene: bpy.types.Scene, paths: Sequence[Path]) -> bool:
    return not scene.render.use_overwrite and all(path.exists() for path in paths)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            raise PermissionError(13, "it is read-only")
    except OSError as error:
        raise BadInputError(f"{folder} cannot be written ({error.strerror}): change the output path") from error


@contextmanager
def _empty_folder(folder: Path) -> Iterator[Path]:
    folder.mkdir(parents=True)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _move_all(folder: Path, final: Path) -> list[Path]:
    """Move finished files to where they belong; each appears there whole, also from another drive."""
    moved = []
    for path in sorted(folder.iterdir()):
        destination = final / path.name
        beside = final / f".{path.name}.{os.getpid()}.tmp"
        try:
            shutil.move(path, beside)
            beside.replace(destination)
        except OSError as error:
            beside.unlink(missing_ok=True)
            raise BadInputError(f"{destination} cannot be written ({error.strerror}): is it in use?") from error
        moved.append(destination)
    if not moved:
        raise StereoReprojectError(f"Blender wrote no file for {final}: check the output settings")
    return moved
