"""The kinds of frames of an animation: stereo pairs, or many views. `animation` does what they have in common."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import bpy

from ...sequence.journal import Journal
from ...settings.animation import AnimationSettings
from ...settings.frame import StereoSettings
from ...settings.views import ViewsSettings
from ..output.animation_output import Output, output_of
from ..output.delivery import pixels_of
from ..output.frame_writer import CUTOUTS, picture_name
from ..output.quilt_files import display_pixels
from ..output.quilt_output import QuiltOutput, quilt_output_of
from ..scene.panoramas import is_panorama
from ..scene.rendered import camera_at, scene_frames
from .frame_maker import BlenderFrameMaker, MakerJob
from .pair_maker import PairMaker
from .view_rigs import files_of_views
from .views_frame_maker import ViewsFrameMaker

Files = dict[int, list[Path]]
"""Paths of files by the number of the frame."""


class FrameKind(Protocol):
    """The kind of an animation's frames, with the settings of each picture."""

    @property
    def settings(self) -> StereoSettings:
        """The settings of each picture."""
        ...

    def shaped(self, scene: bpy.types.Scene) -> AbstractContextManager[None]:
        """Have the scene's pixels of the shape that they are rendered in, for the time of a `with` block."""
        ...

    def output(self, scene: bpy.types.Scene, options: AnimationSettings) -> tuple[AnimationSettings, Output]:
        """Return the options completed by what the scene says, and the output of the frames. Raises BadInputError when
        files cannot be written."""
        ...

    def files(self, scene: bpy.types.Scene, output: Any, journal: Journal, options: AnimationSettings) -> Files:
        """Return all files that belong to each frame of this output."""
        ...

    def order(self, output: Any) -> dict[str, Any]:
        """Return those fields of the writer's job that say what a frame is."""
        ...

    @property
    def maker(self) -> Callable[[MakerJob], BlenderFrameMaker]:
        """The function or class that returns the maker of the frames for a job."""
        ...


@dataclass(frozen=True)
class Pairs:
    """Frames that are stereo pairs, or one view of mono, in files of the scene's own format: a `FrameKind`."""

    settings: StereoSettings

    def shaped(self, scene: bpy.types.Scene) -> AbstractContextManager[None]:
        """Have the pixels square for a panorama that is made of the scene; see `FrameKind`."""
        return pixels_of(scene, self.settings.scene.panorama)

    def output(self, scene: bpy.types.Scene, options: AnimationSettings) -> tuple[AnimationSettings, Output]:
        """Return the output that the scene's own settings ask for; see `FrameKind`."""
        return output_of(scene, options, self.settings.scene)

    def files(self, scene: bpy.types.Scene, output: Output, journal: Journal, options: AnimationSettings) -> Files:
        """Return the files of each frame, with pictures of the holes where these are asked for; see `FrameKind`."""
        files = {frame: list(paths) for frame, paths in output.files.items()}
        if not options.holes:
            return files
        known, asked = journal.known_frames(), self.settings.scene.panorama
        for frame, paths in files.items():
            paths.append(output.folder / picture_name(journal, frame))
            # A frame that is known has the cut-outs of its record: none where too little of the sphere is seen.
            if frame not in known and (asked is not None or is_panorama(camera_at(scene, frame))):
                paths.append(output.folder / picture_name(journal, frame, CUTOUTS))
        return files

    def order(self, output: Output) -> dict[str, Any]:  # noqa: ARG002 - for many views
        """Return the panorama that is made of the scene, and whether there is one view; see `FrameKind`."""
        return {"panorama": self.settings.scene.panorama, "mono": self.settings.scene.mono}

    @property
    def maker(self) -> Callable[[MakerJob], BlenderFrameMaker]:
        """The class that makes pairs; see `FrameKind`."""
        return PairMaker


@dataclass(frozen=True)
class Quilts:
    """Frames that are many views, each frame in a quilt, or of the scene's own views in files of theirs: a
    `FrameKind`."""

    settings: StereoSettings
    views: ViewsSettings

    def shaped(self, scene: bpy.types.Scene) -> AbstractContextManager[None]:
        """Have a view as wide over its height as the display; see `FrameKind`."""
        return display_pixels(scene, self.views.aspect, self.settings.scene.size)

    def output(self, scene: bpy.types.Scene, options: AnimationSettings) -> tuple[AnimationSettings, QuiltOutput]:
        """Return the output of many views in the folder of the options; see `FrameKind`. All frames are looked at."""
        overrides = self.settings.scene
        frames = scene_frames(scene) if options.frames is None else options.frames
        files = files_of_views(scene, overrides, self.views, frames)
        return quilt_output_of(scene, replace(options, frames=tuple(frames)), self.views, overrides.size, files)

    def files(
        self,
        scene: bpy.types.Scene,  # noqa: ARG002 - for pairs
        output: QuiltOutput,
        journal: Journal,  # noqa: ARG002 - for pairs
        options: AnimationSettings,  # noqa: ARG002 - for pairs
    ) -> Files:
        """Return the files of each frame: quilts, views where these are stored, and a report; see `FrameKind`."""
        return {frame: [output.folder / name for name in output.frames.files(frame)] for frame in output.files}

    def order(self, output: QuiltOutput) -> dict[str, Any]:
        """Return the names of the frames' files; see `FrameKind`."""
        return {"quilt": output.frames}

    @property
    def maker(self) -> Callable[[MakerJob], BlenderFrameMaker]:
        """The class that makes many views, by their settings; see `FrameKind`."""
        return partial(ViewsFrameMaker, views=self.views)
