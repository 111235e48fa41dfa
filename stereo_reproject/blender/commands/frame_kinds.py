"""What is rendered of each frame of an animation: a stereo pair, or many views. `animation` does all else."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
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
from ..scene.rendered import camera_at
from .frame_maker import BlenderFrameMaker
from .pair_maker import PairMaker
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
    def maker(self) -> Callable[..., BlenderFrameMaker]:
        """What returns the maker of the frames, with the parameters of `BlenderFrameMaker`."""
        ...


@dataclass(frozen=True)
class Pairs:
    """Frames that are stereo pairs, in files of the scene's own format: a `FrameKind`."""

    settings: StereoSettings

    def shaped(self, scene: bpy.types.Scene) -> AbstractContextManager[None]:
        """As `FrameKind` says."""
        return pixels_of(scene, self.settings.scene.panorama)

    def output(self, scene: bpy.types.Scene, options: AnimationSettings) -> tuple[AnimationSettings, Output]:
        """As `FrameKind` says."""
        return output_of(scene, options, self.settings.scene)

    def files(self, scene: bpy.types.Scene, output: Output, journal: Journal, options: AnimationSettings) -> Files:
        """As `FrameKind` says; with pictures of the holes where these are asked for."""
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
        """As `FrameKind` says."""
        return {"panorama": self.settings.scene.panorama}

    @property
    def maker(self) -> Callable[..., BlenderFrameMaker]:
        """As `FrameKind` says."""
        return PairMaker


@dataclass(frozen=True)
class Quilts:
    """Frames that are many views, each frame in a quilt: a `FrameKind`."""

    settings: StereoSettings
    views: ViewsSettings

    def shaped(self, scene: bpy.types.Scene) -> AbstractContextManager[None]:
        """As `FrameKind` says: as wide as the display."""
        return display_pixels(scene, self.views.aspect, self.settings.scene.size)

    def output(self, scene: bpy.types.Scene, options: AnimationSettings) -> tuple[AnimationSettings, QuiltOutput]:
        """As `FrameKind` says."""
        return quilt_output_of(scene, options, self.views, self.settings.scene.size)

    def files(
        self,
        scene: bpy.types.Scene,  # noqa: ARG002 - for pairs
        output: QuiltOutput,
        journal: Journal,  # noqa: ARG002 - for pairs
        options: AnimationSettings,  # noqa: ARG002 - for pairs
    ) -> Files:
        """As `FrameKind` says."""
        return {frame: [output.folder / name for name in output.frames.files(frame)] for frame in output.files}

    def order(self, output: QuiltOutput) -> dict[str, Any]:
        """As `FrameKind` says."""
        return {"quilt": output.frames}

    @property
    def maker(self) -> Callable[..., BlenderFrameMaker]:
        """As `FrameKind` says."""
        return partial(ViewsFrameMaker, views=self.views)
