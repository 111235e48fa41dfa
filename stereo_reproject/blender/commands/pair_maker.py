"""Renders the frames of an animation that are stereo pairs, or one view of mono."""

from __future__ import annotations

import time
from functools import cached_property
from pathlib import Path
from typing import Any

from ...errors import StereoReprojectError
from ...images.exr import write_eye
from ...jobs.supervisor import FRAME
from ...jobs.work_folder import CUTOUTS
from ...pipeline.stages import RENDERING, Stage
from ...pipeline.stereo_frame import colour
from ...pipeline.stereo_pair import StereoPair
from ...report.as_json import as_json
from ...report.frame_report import FrameReport
from ...sequence.output_errors import failed_output
from ...settings.frame import StereoSettings
from ...views.cutouts import cutouts_of
from ..output.cutout_sheet import write_cutouts
from ..output.pictures import write_hole_mask
from ..output.stamp import with_render_time
from .compare import compare_with_multiview
from .frame import InSequence, render_pair, value_warnings
from .frame_flicker import FrameFlicker
from .frame_maker import BlenderFrameMaker
from .key_frames import KeyFrames

KEYS_OF_A_FRAME = (
    "size",
    "samples",
    "time_limit",
    "samples_rendered",
    "accuracy",
    "seconds",
    "fractions",
    "fill",
    "warp",
    "estimate",
    "correction",
    "layers",
    "reuse",
    "memory",
)
"""Keys of a pair's report that the report of an animation has for each frame."""


class PairMaker(BlenderFrameMaker):
    """Maker of frames that are stereo pairs, or of one view where the settings are those of mono frames."""

    _last_pair: StereoPair | None = None
    """Pair of the last frame, where it is kept."""

    @cached_property
    def _keys(self) -> KeyFrames | None:
        """The key frames of the animation; None where no frame is made from another."""
        distance = self._options.reuse
        return None if distance is None else KeyFrames(self._scene, distance)

    @cached_property
    def _flicker(self) -> FrameFlicker:
        """Measures flicker between frames that are compared."""
        return FrameFlicker()

    def _made(self, frame: int, folder: Path) -> tuple[dict[str, Any], dict[str, str]]:
        """Render the pair of a frame, as `BlenderFrameMaker` says."""
        start = time.perf_counter()
        settings = self._settings_at(frame)
        pair, report = render_pair(
            self._scene,
            settings,
            self._work,
            onlooker=self._onlooker_at(frame),
            sequence=InSequence(self._scenes, self._findings_of, self._last is None, self._keys),
        )
        figures = self._figures(pair, report)
        self._hand_out(folder, pair)
        figures["wall_seconds"] = wall = time.perf_counter() - start
        figures["beside_seconds"] = wall - sum(report.seconds.get(stage, 0.0) for stage in RENDERING)
        if self._is_compared(frame):
            self._on_stage(Stage.COMPARE, f"{FRAME}{frame}")
            figures["compare"] = self._compared(settings, pair, frame)
        # A pair is much to hold while the next one is rendered.
        self._last_pair = pair if self._keeps_last else None
        return figures, with_render_time(pair.metadata, report.seconds["total"])

    def _figures(self, pair: StereoPair, report: FrameReport) -> dict[str, Any]:
        """Return what the report of an animation has of this frame, by its keys, apart from the seconds beside its
        stages and from the comparison.
        """
        fields = as_json(report)
        figures = {key: fields[key] for key in KEYS_OF_A_FRAME if key in fields}
        if self._settings.scene.mono:
            figures["views"] = 1
        figures["multiview_seconds"] = report.predicted_speedup * report.seconds["total"]
        figures["warnings"] = [*report.warnings, *value_warnings(pair, half=self._context.half_floats)]
        return figures

    def _compared(self, settings: StereoSettings, pair: StereoPair, frame: int) -> dict[str, Any]:
        """Return how the pair of a frame compares with multiview by the same settings, or its one view with a plain
        render, by the keys of its report."""
        self._scenes.close()
        reuses = self._keys is not None
        compared, multiview = compare_with_multiview(self._scene, settings, pair, self._work, both=reuses)
        found = as_json(compared)
        if reuses:
            found["flicker"] = self._flicker.since_last(frame, pair, multiview)
        # Multiview's scene is not kept for the next frame: that would hold all of it twice, and Blender too syncs
        # each frame of an animation anew, unless Persistent Data is on.
        return {**found, "synced_anew": not settings.scene.mono}

    def _hand_out(self, folder: Path, pair: StereoPair) -> None:
        """Write the files that the writer needs of a pair into a folder. Raises OutputError."""
        try:
            folder.mkdir(exist_ok=True)
            for view, layers in pair.eyes.items():
                write_eye(folder / f"{view}.exr", layers, view=view, metadata=pair.metadata, compressed=False)
            if self._options.holes:
                target = colour(pair.eyes[self._settings.target][pair.main])
                write_hole_mask(folder / "holes.png", target, pair.main_frame.reasons)
                if cutouts_of(pair.main_frame.camera):
                    write_cutouts(folder / CUTOUTS, pair.main_frame, self._settings.target, with_legend=False)
        except (OSError, StereoReprojectError) as error:
            raise failed_output(self._context.journal.frames_folder, error) from error

    def leave(self, folder: Path) -> int | None:
        """Write the eyes of the last frame rendered into `folder`, if this maker was told to keep them, and return the
        frame's number; None if no frame was rendered.
        """
        if self._last_pair is not None:
            folder.mkdir(exist_ok=True)
            for view, eye in self._last_pair.eyes.items():
                write_eye(folder / f"{view}.exr", eye, view=view, metadata=self._last_pair.metadata)
        return self._last
