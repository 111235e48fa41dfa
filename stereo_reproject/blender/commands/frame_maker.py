"""Renders an animation's frames, one after the other, and has each written while the next is rendered."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...errors import StereoReprojectError, in_one_line
from ...images.exr import VIEWS, write_eye
from ...images.tuning import TUNING
from ...jobs.memory import give_back_freed
from ...jobs.supervisor import FRAME, HANDED_OVER
from ...jobs.work_folder import CUTOUTS
from ...pipeline.onlooker import NOBODY, Onlooker
from ...pipeline.shared_findings import SharedFindings
from ...pipeline.stages import RENDERING, Stage
from ...pipeline.stereo_frame import colour
from ...pipeline.stereo_pair import StereoPair
from ...report.as_json import as_json
from ...report.frame_report import FrameReport
from ...sequence.fingerprints import Fingerprints, digest
from ...sequence.frame_record import Record
from ...sequence.journal import Journal
from ...sequence.output_errors import blamed_on_output, failed_output
from ...sequence.writer_process import WriterJob, WriterProcess, WrittenFrame
from ...settings.animation import AnimationSettings
from ...settings.frame import StereoSettings
from ...trace.costs import AGREED, ASSUMED, TraceCosts, costs_of
from ...trace.fill import SourceCost
from ...views.cutouts import cutouts_of
from ..output.cutout_sheet import write_cutouts
from ..output.pictures import write_hole_mask
from ..output.stamp import with_render_time
from ..scene.rendered import camera_at
from ..scene.working import WorkingScenes
from .compare import compare_with_multiview
from .frame import render_pair, value_warnings
from .processes import module_in_blender

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
    "memory",
)
"""Keys of a pair's report that the report of an animation has for each frame."""

FRAMES_OF_ONE_NOISE_LEVEL = 24
"""Frames in a row, by the same camera, for which the denoiser is taken to leave the same share of the noise."""


@dataclass(frozen=True)
class FrameContext:
    """Common ground of the frames of a run: settings, options, and the journal; the fingerprints that a frame's record
    needs; the run's token; and whether the files hold half floats.
    """

    settings: StereoSettings
    options: AnimationSettings
    journal: Journal
    wanted: Fingerprints
    token: str
    half_floats: bool


class AgreedFindings(SharedFindings):
    """Findings of an animation's first frame, whichever run has rendered it, so that a frame rendered again comes out
    the same.

    They are kept in the journal, which all runs share: the first finding of a key holds. block is what a frame shares
    with its neighbours; findings about noise are made once for each block. Methods raise OutputError where the journal
    cannot be used.
    """

    def __init__(self, context: FrameContext, layer: str, block: tuple[int, str]) -> None:
        self._journal = context.journal
        of_layer = [context.wanted.settings, dict(context.wanted.scene), layer]
        self._of_layer, self._of_block = (digest(values)[:16] for values in (of_layer, [*of_layer, block]))

    def cost(self, found: SourceCost) -> SourceCost:
        """Return the agreed cost of a source; `found`, this frame's own, becomes it if there is none yet."""
        known = self._agree(self._of_layer, asdict(found))
        return SourceCost(**known) if known.keys() == asdict(found).keys() else found

    def trace_costs(self, known: TraceCosts, measure: Callable[[], TraceCosts], *, packed_by: str) -> TraceCosts:
        """Return the agreed costs of tracing by this packed camera. If there are none yet, `known` become them, those
        of this machine; or where they are just assumed, those that `measure` returns.
        """
        key = f"{self._of_layer}-costs-{packed_by}"
        agreed = costs_of(self._journal.agreed.read(key), AGREED)
        if agreed is None:
            found = measure() if known.source == ASSUMED else known
            agreed = costs_of(self._agree(key, found.numbers), AGREED) or found
        return agreed

    def remaining_noise(self, find: Callable[[], float]) -> float:
        """Return the agreed share of noise that the denoiser leaves, 0 to 1; `find` is called only if there is none
        yet.
        """
        return float(np.clip(self._found(self._of_block, "noise_left", find), TUNING.min_remaining_noise, 1.0))

    def gpu_is_faster(self, find: Callable[[], bool]) -> bool:
        """Return whether the GPU is agreed to warp faster than NumPy; `find` is called only if that is not known
        yet.
        """
        return bool(self._found(f"{self._of_layer}-gpu", "gpu_is_faster", lambda: float(find())))

    def _found(self, key: str, name: str, find: Callable[[], float]) -> float:
        """Return the number `name` that is agreed under this key; if there is none, that which `find` returns becomes
        it.
        """
        known = (self._journal.agreed.read(key) or {}).get(name)
        if known is None:
            found = find()
            known = self._agree(key, {name: found}).get(name, found)
        return known

    def _agree(self, key: str, values: dict[str, float]) -> dict[str, float]:
        """Return the numbers that are agreed under this key; `values` become them if there are none yet. Raises
        OutputError.
        """
        try:
            return self._journal.agreed.agree_on(key, values)
        except OSError as error:
            raise failed_output(self._journal.frames_folder, error) from error


class BlenderFrameMaker:
    """Maker of an animation's frames: renders them with one working scene that stays, and hands them to the writer
    process. It is a `frames.FrameMaker`; use `close` in the end.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        order: WriterJob,
        context: FrameContext,
        work: Path,
        on_stage: Callable[[str, str], None],
        *,
        keeps_last: bool,
        onlooker: Onlooker = NOBODY,
    ) -> None:
        """order says how frames are written; work is a private folder for what passes between the stages of a frame.
        on_stage gets each stage's name and its frame. keeps_last: True where the last frame's eyes are asked for in the
        end. An onlooker is shown the eyes as they are made."""
        self._scene, self._settings, self._options = scene, context.settings, context.options
        self._context, self._on_stage = context, on_stage
        self._work, self._private = work, Path(order.private)
        self._scenes = WorkingScenes(scene)
        self._writer = WriterProcess(order, module_in_blender("programs.writer"))
        self._writer.start()
        self._keeps_last, self._onlooker = keeps_last, onlooker
        self._last: tuple[int, StereoPair | None] | None = None

    def render(self, frame: int, claim: int) -> None:
        """Render a frame and hand it over to the writer; claim is the number of this run's claim of it. Raises
        StereoReprojectError if it cannot be rendered; the next frame then begins with a scene that is set up anew.
        """
        try:
            self._render(frame, claim)
        except Exception as error:
            # Whatever one frame meets with, the others may be spared, with a scene that is set up anew.
            self._scenes.close()
            raise blamed_on_output(self._context.journal.frames_folder, in_one_line(error)) from error

    def _render(self, frame: int, claim: int) -> None:
        """Render a frame, compare it with multiview where that is asked for, and hand it over with its record."""
        start = time.perf_counter()
        where = f"{FRAME}{frame}"
        self._on_stage(Stage.PREPARE, where)
        of_this = replace(self._settings, compare=False, scene=replace(self._settings.scene, frame=frame))
        pair, report = render_pair(
            self._scene,
            of_this,
            self._work,
            onlooker=replace(self._onlooker, on_stage=lambda stage: self._on_stage(stage, where)),
            scenes=self._scenes,
            findings=lambda layer: AgreedFindings(self._context, layer, self._block_of(frame)),
            learns=self._last is None,
        )
        figures = self._figures(pair, report)
        folder = self._hand_out(frame, pair)
        figures["wall_seconds"] = wall = time.perf_counter() - start
        figures["beside_seconds"] = wall - sum(report.seconds.get(stage, 0.0) for stage in RENDERING)
        if self._is_compared(frame):
            self._on_stage(Stage.COMPARE, where)
            figures["compare"] = self._compared(of_this, pair)
        self._on_stage(HANDED_OVER, where)
        metadata = with_render_time(pair.metadata, report.seconds["total"])
        self._writer.hand_over(WrittenFrame(frame, claim, str(folder), metadata, self._record(frame, figures)))
        # A pair is much to hold while the next one is rendered.
        self._last = frame, pair if self._keeps_last else None
        del pair
        give_back_freed()

    def _figures(self, pair: StereoPair, report: FrameReport) -> dict[str, Any]:
        """Return what the report of an animation has of this frame, by its keys, apart from the seconds beside its
        stages and from the comparison.
        """
        fields = as_json(report)
        figures = {key: fields[key] for key in KEYS_OF_A_FRAME if key in fields}
        figures["multiview_seconds"] = report.predicted_speedup * report.seconds["total"]
        figures["warnings"] = [*report.warnings, *value_warnings(pair, half=self._context.half_floats)]
        return figures

    def _compared(self, settings: StereoSettings, pair: StereoPair) -> dict[str, Any]:
        """Return how the pair of a frame compares with multiview by the same settings, by the keys of its report."""
        self._scenes.close()
        compared = compare_with_multiview(self._scene, settings, pair, self._work)[0]
        # Multiview's scene is not kept for the next frame: that would hold all of it twice, and Blender too syncs
        # each frame of an animation anew, unless Persistent Data is on.
        return {**as_json(compared), "synced_anew": True}

    def _record(self, frame: int, figures: dict[str, Any]) -> dict[str, Any]:
        """Return the fields of a frame's record, with these figures, but for its files."""
        return {
            "frame": frame,
            "settings": self._context.wanted.settings,
            "scene": dict(self._context.wanted.scene),
            "run": self._context.token,
            "figures": figures,
        }

    def _hand_out(self, frame: int, pair: StereoPair) -> Path:
        """Write the files that the writer needs of a frame into a folder of its own, and return that. Raises
        OutputError.
        """
        folder = self._private / f"frame-{frame}"
        try:
            folder.mkdir(exist_ok=True)
            for view in VIEWS:
                layers = pair.eyes[view]
                write_eye(folder / f"{view}.exr", layers, view=view, metadata=pair.metadata, compressed=False)
            if self._options.holes:
                target = colour(pair.eyes[self._settings.target][pair.main])
                write_hole_mask(folder / "holes.png", target, pair.main_frame.reasons)
                if cutouts_of(pair.main_frame.camera):
                    write_cutouts(folder / CUTOUTS, pair.main_frame, self._settings.target, with_legend=False)
        except (OSError, StereoReprojectError) as error:
            raise failed_output(self._context.journal.frames_folder, error) from error
        return folder

    def _block_of(self, frame: int) -> tuple[int, str]:
        """Return the key of the block of frames, seen by one camera, that share a noise level with this one: the
        frame's number divided by `FRAMES_OF_ONE_NOISE_LEVEL`, rounded down, and the camera's name.
        """
        camera = camera_at(self._scene, frame)
        return frame // FRAMES_OF_ONE_NOISE_LEVEL, camera.name_full if camera else ""

    def _is_compared(self, frame: int) -> bool:
        """Return whether this frame is one of those that are compared with multiview."""
        every = self._options.compare_every
        return every is not None and (frame - self._scene.frame_start) % every == 0

    def finished(self, *, wait: bool) -> list[tuple[int, Record | StereoReprojectError | None]]:
        """Return the frames whose writing has ended since the last call, each with its record, or with the error, or
        with None where another run has claimed it meanwhile. With wait, first wait until all are written.
        """
        folder = self._context.journal.frames_folder
        return [
            (frame, blamed_on_output(folder, result) if isinstance(result, StereoReprojectError) else result)
            for frame, result in self._writer.finished(wait=wait)
        ]

    def leave(self, folder: Path) -> int | None:
        """Write the eyes of the last frame rendered into `folder`, if this maker was told to keep them, and return the
        frame's number; None if no frame was rendered.
        """
        if self._last is None:
            return None
        frame, pair = self._last
        folder.mkdir(exist_ok=True)
        for view in VIEWS:
            if pair is not None:
                write_eye(folder / f"{view}.exr", pair.eyes[view], view=view, metadata=pair.metadata)
        return frame

    def close(self) -> None:
        """Remove the working scenes, and end the writer process."""
        self._scenes.close()
        self._writer.close()
