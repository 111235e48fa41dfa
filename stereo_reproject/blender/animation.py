"""The frames of a scene, one after the other, into the files that the scene's own output settings ask for."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy

from ..errors import BadInputError, StereoReprojectError
from ..exr import VIEWS, read_eye, write_eye
from ..passes import COLOUR_PASS, Passes
from ..report import write_json
from ..settings import StereoSettings
from ..stereo_pair import StereoPair
from ..work_folder import flush, work_folder
from .compositor import is_composited
from .delivery import Eyes, EyesAt, deliver_frames
from .frame import render_pair, value_warnings
from .image_settings import writes_half_floats
from .output_paths import check_file_outputs, output_files
from .scene import scene_frames
from .scene_warnings import scene_warnings

ANIMATION_FILES = ("left.exr", "right.exr", "report.json")
"""What is left of an animation besides its own files: the last frame's eyes, and what became of each frame."""

OF_A_FRAME = ("seconds", "fractions", "fill", "estimate", "correction", "layers")
"""What of a pair's report an animation's has for each frame."""


def frames_to_render(scene: bpy.types.Scene, frames: range) -> dict[int, list[Path]]:
    """Those whose files are not there yet, or all when the scene's Overwrite is on, with their files.

    Raises BadInputError when there are none, or when their files cannot be written.
    """
    if not isinstance(frames, range):
        raise BadInputError(f"frames must be a range, not {frames!r}")
    if not frames or frames.step < 0:
        raise BadInputError(f"frames {frames.start} to {frames.stop - 1} are none: name at least one, in rising order")
    check_file_outputs(scene)
    paths = {frame: output_files(scene, frame, span=frames) for frame in frames}
    kept = not scene.render.use_overwrite
    missing = {frame: files for frame, files in paths.items() if not (kept and all(path.exists() for path in files))}
    if not missing:
        raise BadInputError(f"{paths[frames[0]][0]} and all others are there already: switch on Overwrite in Output")
    for folder in folders_of(missing):
        # Made and removed again: whether it can be is known before anything is rendered.
        with work_folder(folder, ()):
            pass
    for path in dict.fromkeys(path for files in missing.values() for path in files):
        _check_can_be_written(path)
    return paths if scene.render.is_movie_format else missing


def folders_of(files: Mapping[int, list[Path]]) -> list[Path]:
    """The folders that the files of these frames lie in, each once."""
    return list(dict.fromkeys(of_frame[0].parent for of_frame in files.values()))


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
    told a stage's name and which frame it is of. Raises BadInputError and StereoReprojectError; frames that are
    finished stay.
    """
    frames = scene_frames(scene) if frames is None else frames
    wanted = frames_to_render(scene, frames)
    (work / "out").mkdir(exist_ok=True)
    writer = (_Movie if scene.render.is_movie_format else _Stills)(scene, frames, work)
    rows, warnings = [], list[str]()
    for frame in wanted:
        where = f"frame {frame} of {frames[0]} to {frames[-1]}"
        row, more = _render_frame(scene, settings, work, frame, writer, lambda stage, of=where: on_stage(stage, of))
        rows.append(row)
        warnings += more
    on_stage("write", "")
    report = {
        "schema": 1,
        "scene": Path(bpy.data.filepath).stem or scene.name,
        "frames": rows,
        "there_already": [frame for frame in frames if frame not in wanted],
        "files": [str(path) for path in writer.finish()],
        "warnings": [*scene_warnings(scene), *dict.fromkeys(warnings)],
    }
    write_json(work / "out" / "report.json", report)
    return report


def _render_frame(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    work: Path,
    frame: int,
    writer: _Stills | _Movie,
    on_stage: Callable[[str], None],
) -> tuple[dict[str, Any], list[str]]:
    """The frame's row of the report, and what is to be said of it."""
    of_this = replace(settings, compare=False, scene=replace(settings.scene, frame=frame))
    pair, report = render_pair(scene, of_this, work, on_stage=on_stage)
    on_stage("write")
    writer.write(frame, pair)
    for view in VIEWS:
        write_eye(work / "out" / f"{view}.exr", pair.eyes[view], view=view, metadata=pair.metadata)
    return {"frame": frame, **{key: report[key] for key in OF_A_FRAME if key in report}}, [
        *report["warnings"],
        *value_warnings(pair, half=writes_half_floats(scene)),
    ]


class _Stills:
    """Each frame in files of its own, as soon as it is there."""

    def __init__(self, scene: bpy.types.Scene, _frames: range, _work: Path) -> None:
        self._scene = scene
        self._files: list[Path] = []

    def write(self, frame: int, pair: StereoPair) -> None:
        eyes = pair.eyes
        self._files += _write(self._scene, lambda _: eyes, range(frame, frame + 1), pair.metadata)

    def finish(self) -> list[Path]:
        return self._files


class _Movie:
    """All frames in one file, or one for each eye, when the last of them is there."""

    def __init__(self, scene: bpy.types.Scene, frames: range, work: Path) -> None:
        self._scene, self._frames, self._folder = scene, frames, work / "tmp"
        self._read: tuple[int, Eyes] | None = None
        self._metadata: dict[str, str] = {}

    def write(self, frame: int, pair: StereoPair) -> None:
        # Blender has one set of them for all that it writes in one call: of what changes, the last is told.
        self._metadata.update(pair.metadata)
        for view, eye in pair.eyes.items():
            layers = eye if is_composited(self._scene) else _picture_alone(eye)
            write_eye(self._eye(frame, view), layers, view=view)

    def finish(self) -> list[Path]:
        return _write(self._scene, self._eyes_at, self._frames, self._metadata)

    def _eyes_at(self, frame: int) -> Eyes:
        # Blender asks several times in a row.
        if self._read is None or self._read[0] != frame:
            self._read = frame, {view: read_eye(self._eye(frame, view)) for view in VIEWS}
        return self._read[1]

    def _eye(self, frame: int, view: str) -> Path:
        return self._folder / f"{view}.{frame}.exr"


def _picture_alone(layers: Mapping[str, Passes]) -> dict[str, Passes]:
    """All that a movie shows where no compositor runs."""
    main = next(iter(layers))
    return {main: {COLOUR_PASS: layers[main][COLOUR_PASS]}}


def _write(scene: bpy.types.Scene, eyes_at: EyesAt, frames: range, metadata: Mapping[str, str]) -> list[Path]:
    """Have Blender write the frames beside where they belong, and put them there."""
    folder = output_files(scene, frames[0], span=frames)[0].parent
    with work_folder(folder, ()) as beside:
        deliver_frames(scene, eyes_at, beside / "out", frames=frames, metadata=metadata)
        return _put_in_place(beside / "out", folder)


def _check_can_be_written(path: Path) -> None:
    """Raises BadInputError when something is in the way of a file, or holds it."""
    if path.is_dir():
        raise BadInputError(f"{path} is a folder where a file is to be written: change the output path")
    try:
        with contextlib.suppress(FileNotFoundError), path.open("r+b"):
            pass
    except OSError as error:
        raise BadInputError(f"{path} cannot be written ({error.strerror}): is it in use?") from error


def _put_in_place(folder: Path, final: Path) -> list[Path]:
    """Move finished files from a folder on the same drive to where they belong; each appears there whole."""
    placed = []
    for path in sorted(folder.iterdir()):
        destination = final / path.name
        flush(path)
        try:
            path.replace(destination)
        except OSError as error:
            spare = destination.with_stem(f"{destination.stem}-new-{path.stat().st_mtime_ns}")
            with contextlib.suppress(OSError):
                path.replace(spare)
            where = f"the new one is {spare.name}" if spare.exists() else "the new one is lost"
            raise BadInputError(f"{destination} cannot be replaced ({error.strerror}): {where}") from error
        placed.append(destination)
    if not placed:
        raise StereoReprojectError(f"Blender wrote no file for {final}: check the output settings")
    return placed
