"""Renders an animation's frames, one after the other, and has each written while the next is rendered."""

from __future__ import annotations

import shutil
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import bpy

from ...errors import StereoReprojectError, in_one_line
from ...jobs.memory import give_back_freed
from ...jobs.supervisor import FRAME, HANDED_OVER
from ...pipeline.onlooker import Onlooker
from ...pipeline.shared_findings import SharedFindings
from ...pipeline.stages import Stage
from ...pipeline.view_plan import ViewCosts
from ...sequence.fingerprints import Fingerprints, digest
from ...sequence.frame_record import Record
from ...sequence.journal import Journal
from ...sequence.output_errors import blamed_on_output, failed_output
from ...sequence.progress import Listener
from ...sequence.writer_process import WriterJob, WriterProcess, WrittenFrame
from ...settings.animation import AnimationSettings
from ...settings.frame import StereoSettings
from ...trace.costs import AGREED, ASSUMED, TraceCosts, costs_of
from ...trace.fill import SourceCost
from ..scene.working import WorkingScenes
from .processes import module_in_blender


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

    They are kept in the journal, which all runs share: the first finding of a key holds. Methods raise OutputError
    where the journal cannot be used.
    """

    def __init__(self, context: FrameContext, layer: str) -> None:
        self._journal = context.journal
        self._of_layer = digest([context.wanted.settings, dict(context.wanted.scene), layer])[:16]

    def cost(self, found: SourceCost) -> SourceCost:
        """Return the agreed cost of a source; `found`, this frame's own, becomes it if there is none yet."""
        known = self._agree(self._of_layer, asdict(found))
        return SourceCost(**known) if known.keys() == asdict(found).keys() else found

    def view_costs(self, found: ViewCosts) -> ViewCosts:
        """Return the agreed costs of a view; `found`, those of this frame's first decision, become them if there are
        none yet."""
        known = self._agree(f"{self._of_layer}-views", asdict(found))
        return ViewCosts(**known) if known.keys() == asdict(found).keys() else found

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


@dataclass(frozen=True)
class MakerJob:
    """The job of a maker of frames: the user's scene; the order, which says how frames are written; the context; and a
    private folder for what passes between the stages of a frame. The listener is told each stage with its frame, and
    its onlooker is shown the pictures as they are made. keeps_last: True where files of the last frame are asked for in
    the end."""

    scene: bpy.types.Scene
    order: WriterJob
    context: FrameContext
    work: Path
    listener: Listener
    keeps_last: bool


class BlenderFrameMaker(ABC):
    """Maker of an animation's frames: renders them with one working scene that stays, and hands them to the writer
    process. It is a `frames.FrameMaker`; use `close` in the end. Subclasses say what is rendered of a frame.
    """

    def __init__(self, job: MakerJob) -> None:
        self._scene, self._context = job.scene, job.context
        self._settings, self._options = job.context.settings, job.context.options
        self._listener, self._on_stage = job.listener, job.listener.on_stage
        self._work, self._private = job.work, Path(job.order.private)
        self._keeps_last = job.keeps_last
        self._scenes = WorkingScenes(job.scene)
        self._writer = WriterProcess(job.order, module_in_blender("programs.writer"))
        self._writer.start()
        self._last: int | None = None
        """Number of the last frame that was rendered; None before the first."""

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
        """Render a frame, and hand it over with its record."""
        self._on_stage(Stage.PREPARE, f"{FRAME}{frame}")
        folder = self._private / f"frame-{frame}"
        try:
            figures, metadata = self._made(frame, folder)
        except Exception:
            # What is half made of it is of no use to anyone.
            shutil.rmtree(folder, ignore_errors=True)
            raise
        self._on_stage(HANDED_OVER, f"{FRAME}{frame}")
        self._writer.hand_over(WrittenFrame(frame, claim, str(folder), metadata, self._record(frame, figures)))
        self._last = frame
        give_back_freed()

    @abstractmethod
    def _made(self, frame: int, folder: Path) -> tuple[dict[str, Any], dict[str, str]]:
        """Render a frame, compare it where that is asked for, and write what the writer process needs of it into
        `folder`. Return its figures for the animation's report, and metadata for its files."""

    def _settings_at(self, frame: int) -> StereoSettings:
        """Return the settings by which a frame is rendered."""
        return replace(self._settings, compare=False, scene=replace(self._settings.scene, frame=frame))

    def _onlooker_at(self, frame: int) -> Onlooker:
        """Return who is told the stages of a frame, with its number, and shown its pictures."""

        def on_stage(stage: str, detail: str = "") -> None:
            self._on_stage(stage, f"{FRAME}{frame}, {detail}" if detail else f"{FRAME}{frame}")

        return replace(self._listener.onlooker, on_stage=on_stage)

    def _findings_of(self, layer: str) -> SharedFindings:
        """Return what the frames of the animation have found about a view layer."""
        return AgreedFindings(self._context, layer)

    def _record(self, frame: int, figures: dict[str, Any]) -> dict[str, Any]:
        """Return the fields of a frame's record, with these figures, but for its files."""
        return {
            "frame": frame,
            "settings": self._context.wanted.settings,
            "scene": dict(self._context.wanted.scene),
            "run": self._context.token,
            "figures": figures,
        }

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

    def leave(self, folder: Path) -> int | None:  # noqa: ARG002 - for subclasses
        """Write the files of the last frame rendered that are asked for into `folder`, and return the frame's number;
        None if no frame was rendered.
        """
        return self._last

    def close(self) -> None:
        """Remove the working scenes, and end the writer process."""
        self._scenes.close()
        self._writer.close()
