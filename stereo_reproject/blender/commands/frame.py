"""One frame of a .blend, from the file to the finished files: what the command line and scripts call."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...files import write_json
from ...images.exr import VIEWS, write_eye, write_stereo
from ...images.passes import DEPTH_PASS, Passes
from ...images.ranges import range_warnings
from ...images.seen_light import scaled_colour
from ...jobs.memory import give_back_freed
from ...jobs.work_folder import CUTOUTS, DIFFERENCE, MULTIVIEW_EYES, pair_files, with_cutouts
from ...pipeline.onlooker import NOBODY, Onlooker
from ...pipeline.shared_findings import SharedFindings
from ...pipeline.stages import Stage
from ...pipeline.stereo_frame import StereoFrame, colour
from ...pipeline.stereo_pair import StereoPair
from ...pipeline.stopwatch import Stopwatch
from ...report.as_json import ABSENT, as_json
from ...report.estimates import estimate_map
from ...report.frame_report import CompareReport, FrameReport, MemoryReport, ParallaxReport
from ...report.header import PictureHeader, ReportHeader, StereoReport
from ...report.making import LayerFacts, pair_report
from ...settings.frame import StereoSettings
from ...views.cutouts import cutouts_of
from ...views.parallax import visible_parallax
from ..engines.eevee import renderer_of
from ..engines.renderer import BlenderRenderer
from ..engines.time_limit import has_time_limit
from ..output.cutout_sheet import by_view_transform, write_cutouts
from ..output.delivery import deliver_composited, deliver_side_by_side, pixels_of
from ..output.output_paths import check_file_outputs
from ..output.pictures import write_difference, write_estimate, write_grid, write_holes
from ..output.stamp import with_render_time
from ..scene.compositor import is_composited
from ..scene.rendered import CYCLES, check_layers
from ..scene.rig import frame_region
from ..scene.warnings import scene_warnings
from ..scene.working import WorkingScenes, evaluated
from .compare import compare_with_multiview
from .key_frames import KeyFrames, Making, whole_frame
from .known_costs import learn_costs

STEREO_PICTURE = "stereo.png"
HOLES_PICTURE = "holes.png"


def render_files(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    work: Path,
    *,
    files: Sequence[str] | None = None,
    load_seconds: float = 0.0,
    onlooker: Onlooker = NOBODY,
) -> tuple[dict[str, Any], list[str]]:
    """Render the pair of one frame and write its files into work/out. Return the report, by the keys of report.json,
    and the files' names.

    work is a private folder that also takes what passes between the stages. files are some of `pair_files`; None stands
    for all. A panorama has the picture of its cut-outs besides, where that of the holes is among them. With stereo.png,
    the scene's compositor runs, and its File Output nodes write where they point. load_seconds, those of loading the
    .blend, go into the report. An onlooker is told the stages as they begin, and shown the eyes as they are made.
    Raises BadInputError and StereoReprojectError.
    """
    out = work / "out"
    out.mkdir(exist_ok=True)
    files = pair_files(compare=settings.compare) if files is None else files
    if STEREO_PICTURE in files and is_composited(scene):
        check_file_outputs(scene)
    pair, report = render_pair(scene, settings, work, onlooker=onlooker)
    onlooker.on_stage(Stage.WRITE)
    start = time.perf_counter()
    # Where the picture of the holes explains a panorama, so do its cut-outs.
    has_cutouts = HOLES_PICTURE in files and bool(cutouts_of(pair.main_frame.camera))
    files = with_cutouts(files, cutouts=has_cutouts)
    with pixels_of(scene, settings.scene.panorama):
        _write_pictures(scene, settings, pair, out, report, files)
    own = {Stage.LOAD.value: load_seconds, Stage.WRITE.value: time.perf_counter() - start}
    report = replace(report, seconds={**report.seconds, **own})
    if settings.compare:
        onlooker.on_stage(Stage.COMPARE)
        report = replace(report, compare=_compare(scene, settings, pair, work, files))
    late = [*scene_warnings(scene, settings.scene), *value_warnings(pair)]
    written = as_json(replace(report, warnings=(*report.warnings, *late)))
    write_json(out / "report.json", written)
    return written, list(files)


def _compare(
    scene: bpy.types.Scene, settings: StereoSettings, pair: StereoPair, work: Path, files: Sequence[str]
) -> CompareReport:
    """Render the same frame by multiview, and write those pictures of it that `files` names into work/out. Return the
    comparison.
    """
    out, wants_eyes = work / "out", not set(MULTIVIEW_EYES.values()).isdisjoint(files)
    compare, multiview = compare_with_multiview(scene, settings, pair, work, keeps_eyes=wants_eyes)
    if DIFFERENCE in files:
        ours, scale = colour(pair.main_frame.eyes[settings.target]), pair.main_frame.light_scale
        reference = scaled_colour(multiview.reference, scale)
        write_difference(out / DIFFERENCE, scaled_colour(ours, scale), reference)
    for view, name in MULTIVIEW_EYES.items():
        if name in files:
            write_eye(out / name, multiview.eyes[view], view=view, metadata=pair.metadata)
    return compare


@dataclass(frozen=True)
class InSequence:
    """Things that a frame of a sequence shares with its other frames.

    scenes are the working scenes, which go on to the next frame. findings returns, for a view layer's name, what other
    frames have found. learns: True where this user's costs of tracing are renewed by this frame; not for one whose
    scene Cycles has synced for an earlier frame. keys are the key frames, None where no frame is made from another.
    """

    scenes: WorkingScenes
    findings: Callable[[str], SharedFindings]
    learns: bool
    keys: KeyFrames | None = None


def render_pair(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    work: Path,
    *,
    onlooker: Onlooker = NOBODY,
    sequence: InSequence | None = None,
) -> tuple[StereoPair, FrameReport]:
    """Render the pair of one frame, all its view layers. Return it with its report, which lacks what only writing files
    adds.

    The first parameters are those of `render_files`. sequence is what it shares with other frames of one. The report
    tells of the main layer, but its seconds are those of all.
    """
    frames: dict[str, StereoFrame] = {}
    facts: list[LayerFacts] = []
    alone = WorkingScenes(scene) if sequence is None else nullcontext(sequence.scenes)
    with alone as open_scenes:
        together = sequence or InSequence(open_scenes, lambda _: SharedFindings(), learns=True)
        for layer in check_layers(scene):
            watch = Stopwatch(onlooker)
            watch.lap(Stage.PLAN)
            making = Making(scene, settings, work, watch, together.findings(layer))
            if together.keys is not None:
                together.keys.prepare(making, open_scenes, layer)
                watch.lap(Stage.PLAN)
            working = open_scenes.at(settings.scene, layer)
            frames[layer], found = _render_layer(working, making, together)
            facts.append(found)
    pair = StereoPair(frames)
    give_back_freed()
    return pair, pair_report(pair, facts, settings, memory_report())


def _render_layer(working: bpy.types.Scene, making: Making, sequence: InSequence) -> tuple[StereoFrame, LayerFacts]:
    """Render the pair of one view layer. Return the frame, and what the report tells of this layer. working is the copy
    of the user's scene that is rendered.
    """
    scene, settings = making.scene, making.settings
    header = report_header(scene, working, settings)
    with renderer_of(working, making.work, user_scene=scene, packed_by=settings.packed_camera) as renderer:
        frame, why_whole = (
            whole_frame(renderer, making) if sequence.keys is None else sequence.keys.frame(renderer, making)
        )
        if sequence.learns and frame.reused is None:
            learn_costs(working, renderer.packed_by, frame.source_cost, renderer.trace_renders)
        limited = has_time_limit(renderer.scene)
        facts = LayerFacts(
            header=header,
            plan=renderer.plan,
            parallax=parallax_report(renderer, frame.eyes[settings.source], frame_region(working.render).full_width),
            warnings=tuple(renderer.warnings),
            packed_by=renderer.packed.name,
            time_limit=renderer.scene.cycles.time_limit if limited else ABSENT,
            samples_rendered=renderer.samples_rendered if limited else ABSENT,
            why_whole=ABSENT if sequence.keys is None else why_whole,
        )
    return frame, facts


def picture_header(scene: bpy.types.Scene, working: bpy.types.Scene, settings: StereoSettings) -> PictureHeader:
    """Return the beginning of a report: what is rendered, and how. working is the copy of the scene that is
    rendered."""
    render = working.render
    region = frame_region(render)
    cycles = render.engine == CYCLES
    return PictureHeader(
        scene=Path(bpy.data.filepath).stem or scene.name,
        scene_datablock=scene.name,
        frame=working.frame_current,
        size=(region.width, region.height),
        samples=working.cycles.samples if cycles else working.eevee.taa_render_samples,
        engine=render.engine,
        device=working.cycles.device if cycles else "GPU",
        blender=bpy.app.version_string,
        accuracy=settings.accuracy,
    )


def report_header(scene: bpy.types.Scene, working: bpy.types.Scene, settings: StereoSettings) -> ReportHeader:
    """Return the beginning of a pair's report, with its stereo settings. working is the copy of the scene that is
    rendered.
    """
    stereo = evaluated(working.camera, working).data.stereo
    return ReportHeader(
        **vars(picture_header(scene, working, settings)),
        stereo=StereoReport(
            source=settings.source,
            interocular_distance=stereo.interocular_distance,
            convergence_distance=stereo.convergence_distance,
            convergence_mode=stereo.convergence_mode,
            pivot=stereo.pivot,
        ),
        panorama=settings.scene.panorama or ABSENT,
    )


def parallax_report(renderer: BlenderRenderer, source: Passes, frame_width: int) -> ParallaxReport | None:
    """Return the parallax of the nearest and the farthest point that the source eye sees; None where it sees none."""
    cameras = renderer.cameras
    found = visible_parallax(cameras["left"], cameras["right"], source[DEPTH_PASS], frame_width)
    return None if found is None else ParallaxReport(nearest=found[0], farthest=found[1])


def _write_pictures(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    pair: StereoPair,
    out: Path,
    report: FrameReport,
    files: Sequence[str],
) -> None:
    """Write those of the pair's pictures that `files` names into the folder `out`."""
    frame, eyes = pair.main_frame, {view: pair.eyes[view] for view in VIEWS}
    pictures = {view: colour(layers[pair.main]) for view, layers in eyes.items()}
    target = pictures[settings.target]
    estimates, number = estimate_map(frame.refinement, frame.traced), report.frame
    seconds = report.seconds["total"]
    why_none = report.estimate.from_ if frame.refinement.estimate is None else None
    writers: dict[str, Callable[[Path], None]] = {
        "left.exr": lambda path: write_eye(path, eyes["left"], view="left", metadata=pair.metadata),
        "right.exr": lambda path: write_eye(path, eyes["right"], view="right", metadata=pair.metadata),
        "stereo.exr": lambda path: write_stereo(path, eyes, metadata=pair.metadata),
        STEREO_PICTURE: lambda path: (
            deliver_composited(scene, eyes, path, frame=number, metadata=with_render_time(pair.metadata, seconds))
            if is_composited(scene)
            else deliver_side_by_side(scene, pictures, path, frame=number, metadata=with_render_time({}, seconds))
        ),
        HOLES_PICTURE: lambda path: write_holes(path, target, frame.reasons),
        "estimate.png": lambda path: write_estimate(path, target, estimates, why_none=why_none),
        "estimate.exr": lambda path: write_eye(path, {pair.main: _estimate_passes(estimates)}, view=settings.target),
        "grid.png": lambda path: write_grid(path, pictures[settings.source], frame.grid),
        CUTOUTS: lambda path: write_cutouts(path, frame, settings.target, shown=by_view_transform(scene, path, number)),
    }
    for name, write in writers.items():
        if name in files:
            write(out / name)


def _estimate_passes(estimates: NDArray[np.float32]) -> Passes:
    """Return the three channels of `estimates` (H, W, 3) as passes by name: the honest ratio, and the low and high end
    of its interval. The names are those of older versions.
    """
    names = ("Noise Ratio", "Noise Ratio Low", "Noise Ratio High")
    return {name: estimates[..., k : k + 1] for k, name in enumerate(names)}


def value_warnings(pair: StereoPair, *, half: bool = False) -> list[str]:
    """Return a line for each kind of value that a pass should not hold: no number, or with half the too large for half
    floats.
    """
    invalid = pair.invalid_pixels.items()
    warnings = [
        f"{count} pixels of the {view} eye were no numbers in a pass, and are 0 there"
        for view, count in invalid
        if count
    ]
    for view, layers in pair.eyes.items():
        for passes in layers.values():
            warnings += range_warnings(passes, view=view, half=half)
    return list(dict.fromkeys(warnings))


def memory_report() -> MemoryReport:
    """Return the memory of this process, at its peak and now, in MiB; None for what this system does not tell."""
    try:
        import resource
    except ImportError:
        return MemoryReport(peak_mb=None, resident_mb=None)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    resident = None
    with suppress(OSError):
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        resident = pages * resource.getpagesize() / (1 << 20)
    return MemoryReport(peak_mb=peak / (1 << 20 if sys.platform == "darwin" else 1 << 10), resident_mb=resident)
