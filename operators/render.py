"""Render the pair of a frame or of all frames, or have a look at what it would cost."""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..stereo_reproject.blender.commands.animation import ANIMATION_FILES
from ..stereo_reproject.blender.engines.time_limit import samples_asked_for
from ..stereo_reproject.blender.output.animation_output import existing_as_set, folders_of, output_of
from ..stereo_reproject.blender.output.delivery import deliver_to_result, pixels_of
from ..stereo_reproject.blender.output.stamp import with_render_time
from ..stereo_reproject.blender.scene.denoiser import has_denoiser
from ..stereo_reproject.blender.scene.depth import EDGE_ROWS, edge_hits
from ..stereo_reproject.blender.scene.rendered import CYCLES, layers_to_render
from ..stereo_reproject.blender.scene.rig import FrameRegion, frame_region
from ..stereo_reproject.blender.scene.working import MIN_SIDE_PX
from ..stereo_reproject.errors import BadInputError, StereoReprojectError
from ..stereo_reproject.images.exr import VIEWS, read_eye, read_metadata
from ..stereo_reproject.images.passes import DEPTH_PASS
from ..stereo_reproject.jobs.frames_progress import FramesProgress
from ..stereo_reproject.jobs.progress import USUAL, Progress, with_look
from ..stereo_reproject.jobs.work_folder import DIFFERENCE, MULTIVIEW_EYES
from ..stereo_reproject.pipeline.stages import Stage
from ..stereo_reproject.report.verdict import (
    quality_of,
    saved_by_animation,
    saved_words,
    time_words,
)
from ..stereo_reproject.sequence.journal_folder import JournalFolder
from ..stereo_reproject.sequence.record_store import RecordStore
from ..stereo_reproject.sequence.report import totals
from ..stereo_reproject.settings.animation import AnimationSettings
from ..stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from ..stereo_reproject.views.depth_range import EdgeHit, hits_of_pair, named
from ..stereo_reproject.views.parallax import visible_parallax
from ..stereo_reproject.words import Words
from . import under_way
from .animation_run import Animation
from .headset import asked_panorama, panorama_size, region_to_render
from .jobs import JobOperator
from .multiview import hand_over_multiview
from .prediction import full_gain_of, gain_words
from .preferences import preferred
from .results import (
    Delivery,
    KnownDepth,
    has_preview,
    keep_animation,
    keep_depth,
    keep_inspection,
    keep_pair,
    result_of,
)
from .run import BackgroundJob, Pictures, seconds_of
from .slots import content_now, leave_multiview, multiview_now, unused_slot
from .stereo import depth_of_cuts, eyes_of
from .text import reported
from .view_images import show_delivered
from .viewing import VIEWING, needs_our_player

Eyes = Mapping[str, Mapping[str, Mapping[str, NDArray]]]
"""Both eyes of a pair: for each its passes (H, W, C), by view layer and name."""

PAIR_FILES = ("left.exr", "right.exr", "holes.png", "estimate.png", "grid.png", "report.json")


MIN_SAMPLES_FOR_A_LOOK = 32
"""Samples of a full render from which on it begins with a first look, which takes one: about 3 % of them at most."""


PREVIEW_TOOLTIP = (
    "Render a small pair with few samples, denoised where Blender can, to look at the stereo before a full render."
    " Size and samples are set under Preview"
)


class RENDER_OT_stereo_reproject_image(JobOperator, bpy.types.Operator):
    """Render both eyes for little more than the price of one: the second is made from the first, and only what the
    first does not show is rendered"""

    bl_idname = "render.stereo_reproject_image"
    bl_label = "Render Stereo Image (Reprojected)"

    preview: bpy.props.BoolProperty(
        name="Preview",
        description="Smaller and with fewer samples, as set in the panel",
        default=False,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the button's tooltip; a preview has its own."""
        return PREVIEW_TOOLTIP if properties.preview else " ".join((cls.__doc__ or "").split())

    def start(self, scene: bpy.types.Scene) -> BackgroundJob:
        """Start a job that renders the pair of the present frame, and return it."""
        settings = settings_of(scene, preview=self.preview)
        files = (DIFFERENCE, *MULTIVIEW_EYES.values(), *PAIR_FILES) if settings.compare else PAIR_FILES
        pictures = under_way.wanted_pictures(first_look=_has_look(scene, preview=self.preview))
        progress = _pair_progress(scene, settings, looks=pictures is Pictures.FROM_THE_FIRST_SAMPLE)
        return BackgroundJob(scene, settings, "render", files, progress, pictures=pictures)

    def fits_pictures(self, scene: bpy.types.Scene) -> bool:
        """Return whether the pair is fitted to the Image Editor: a preview, and a picture of another size after it."""
        return self.preview or super().fits_pictures(scene)

    def take(self, scene: bpy.types.Scene | None, run: BackgroundJob) -> str:
        """Make the pair the Render Result, keep its report for the panels, and return its summary."""
        frame = run.settings.scene.frame
        where, eyes = _deliver(scene, run, frame=frame, to_look_at=self.preview, preview=self.preview)
        assert scene is not None
        assert run.report is not None
        delivery = _delivery(frame, preview=self.preview, compared=run.settings.compare)
        keep_pair(scene, run, delivery, _edges_of(scene, eyes, frame))
        return reported(Words("{result}{where}", result=summary(scene), where=where))


class RENDER_OT_stereo_reproject_animation(JobOperator, bpy.types.Operator):
    """Render both eyes of every frame into the scene's output path, in its own format and stereo layout"""

    bl_idname = "render.stereo_reproject_animation"
    bl_label = "Render Stereo Animation (Reprojected)"

    def start(self, scene: bpy.types.Scene) -> BackgroundJob:
        """Start a job that renders the scene's animation into its output path, and return it."""
        distance = scene.stereo_reproject.key_frame_distance
        asked = AnimationSettings(existing=existing_as_set(scene), reuse=distance if distance > 1 else None)
        settings = settings_of(scene, preview=False)
        _, output = output_of(scene, asked, settings.scene)
        of_frame = partial(Progress, stages=USUAL["animate"], frames=len(layers_to_render(scene)))
        progress = FramesProgress(time.monotonic(), len(output.files), of_frame)
        records = RecordStore(JournalFolder(output.folder, output.name))
        animation = Animation(asked, folders_of(output), output.files, records)
        pictures = under_way.wanted_pictures(first_look=False)
        return BackgroundJob(
            scene, settings, "animate", ANIMATION_FILES, progress, animation=animation, pictures=pictures
        )

    def take(self, scene: bpy.types.Scene | None, run: BackgroundJob) -> str:
        """Show the last frame as the Render Result, and return a line about the frames that were rendered."""
        report = run.report
        assert report is not None
        where, shown = "", False
        if report["last"] is not None:
            try:
                # What its File Output nodes write was written with each frame.
                where, eyes = _deliver(scene, run, frame=report["last"], to_look_at=True)
                shown = True
                assert scene is not None
                keep_depth(scene, _depth_of(scene, eyes, run.settings.source, report["last"]))
            except StereoReprojectError as error:
                run.warnings.append(Words("the last frame is not shown: {reason}", reason=str(error)))
        run.close()
        assert run.animation is not None
        frames = sorted({*run.animation.frames} - {*report["there_already"]})
        new = totals([row for row in report["frames"] if row["frame"] in frames])
        if scene is not None:
            delivery = _delivery(report["last"] if shown else None)
            keep_animation(scene, run, delivery if shown else replace(delivery, content=None), new)
        by_ours = scene is not None and needs_our_player(scene)
        plays = Words("; {name} plays the left eye", name=VIEWING) if by_ours else ""
        return reported(_words_of_animation(report, len(frames), saved_by_animation(new), where, plays))


def _words_of_animation(report: Mapping[str, Any], rendered: int, saved: float, where: str, plays: str) -> Words:
    """Return a line about an animation: how many frames its run has rendered, the seconds that these have saved, how
    many were there already, and the folder of all; where and plays are parts of it, or empty.
    """
    there = len(report["there_already"])
    message = "1 stereo frame rendered, {saved}" if rendered == 1 else "{count} stereo frames rendered, {saved}"
    before = "; 1 was there already" if there == 1 else "; {count} were there already"
    return Words(
        "{rendered}{skipped}, in {folder}{where}{plays}",
        rendered=Words(message, count=rendered, saved=saved_words(saved)),
        skipped=Words(before, count=there) if there else "",
        folder=Path(report["files"][-1]).parent,
        where=where,
        plays=plays,
    )


class STEREO_REPROJECT_OT_check_scene(JobOperator, bpy.types.Operator):
    """Find out what the scene calls for, how far things stand out of the screen, and what reprojection would gain;
    renders only a small sketch"""

    bl_idname = "stereo_reproject.check_scene"
    bl_label = "Check Scene"
    uses_render_result = False

    def start(self, scene: bpy.types.Scene) -> BackgroundJob:
        """Start a job that inspects the scene, and return it."""
        return BackgroundJob(
            scene, settings_of(scene, preview=False), "inspect", (), Progress(time.monotonic(), USUAL["inspect"])
        )

    def take(self, scene: bpy.types.Scene | None, run: BackgroundJob) -> str:
        """Keep the findings for the panels, and return a line with the predicted gain."""
        assert run.report is not None
        if scene is None:
            raise _deleted(run)
        keep_inspection(scene, run)
        run.close()
        return reported(gain_words(run.report["predicted"]))


def _by_cycles(scene: bpy.types.Scene) -> bool:
    """Return whether Cycles renders the rendered eye, by the panel's choice or else the scene's."""
    chosen = scene.stereo_reproject.source_engine
    return chosen == "cycles" or (chosen == "scene" and scene.render.engine == CYCLES)


def _has_look(scene: bpy.types.Scene, *, preview: bool) -> bool:
    """Return whether a render begins with a first look: a preview, or one of so many samples that the look's costs next
    to nothing, and only where Cycles can render the first sample alone.
    """
    if not _by_cycles(scene) or scene.cycles.use_sample_subset:
        return False
    return preview or scene.cycles.samples >= MIN_SAMPLES_FOR_A_LOOK


def settings_of(scene: bpy.types.Scene, *, preview: bool) -> StereoSettings:
    """Return the settings chosen in the scene's panel, for its present frame; with preview, with the preview's size and
    samples. Raises BadInputError.
    """
    chosen = scene.stereo_reproject
    engine = None if chosen.source_engine == "scene" else chosen.source_engine
    panorama = asked_panorama(scene)
    own = None if panorama is None else panorama_size(scene, panorama)
    overrides = SceneOverrides(frame=scene.frame_current, source_engine=engine, panorama=panorama, size=own)
    if preview:
        denoise = True if _by_cycles(scene) and has_denoiser(scene) else None
        size = preview_size_of(scene)
        overrides = replace(overrides, size=size, samples=preview_samples_of(scene), denoise=denoise)
    return StereoSettings(
        source=chosen.source,
        accuracy=chosen.accuracy,
        fill=chosen.fill,
        packed_by=chosen.packed_by,
        grid_threshold=chosen.grid_threshold,
        interpolation=chosen.interpolation,
        warp=chosen.warp,
        compare=chosen.compare and not preview,
        scene=overrides,
    )


def preview_size_of(scene: bpy.types.Scene) -> tuple[int, int]:
    """Return the width and height in pixels of the whole frame of the scene's preview, as it is set up now."""
    percentage = scene.stereo_reproject.preview_percentage
    return preview_size(region_to_render(scene), percentage, preferred("preview_pixels"))


def preview_size_words(scene: bpy.types.Scene) -> Words:
    """Return a sentence about the pixels of the scene's preview, and why they are more than was asked for, if they
    are.
    """
    size, region = preview_size_of(scene), region_to_render(scene)
    message = "{width} x {height} pixels for each eye."
    if size != preview_size(region, scene.stereo_reproject.preview_percentage, 0):
        message = "{width} x {height} pixels for each eye, the least that the preferences allow."
        if size == (region.full_width, region.full_height):
            message = "{width} x {height} pixels for each eye, as many as the whole picture has."
    return Words(message, width=size[0], height=size[1])


def preview_samples_of(scene: bpy.types.Scene) -> int:
    """Return the samples per pixel of the scene's preview, as it is set up now: never more than a full render
    has, of view layers with numbers of their own the greatest."""
    full = scene.eevee.taa_render_samples
    if _by_cycles(scene):
        of_layers = (samples_asked_for(scene, layer) for layer in scene.view_layers if layer.use)
        full = max(of_layers, default=scene.cycles.samples)
    return min(scene.stereo_reproject.preview_samples, full)


def fewer_samples_words(scene: bpy.types.Scene) -> Words | None:
    """Return a sentence about the samples of the scene's preview where they are fewer than what was asked for; None
    where they are not."""
    count = preview_samples_of(scene)
    if count >= scene.stereo_reproject.preview_samples:
        return None
    message = "{count} samples, as many as the whole picture has." if count > 1 else "1 sample, as the whole picture."
    return Words(message, count=count)


def preview_size(region: FrameRegion, percentage: int, least_px: int) -> tuple[int, int]:
    """Return the width and height in pixels of the whole frame of a preview: this percentage of the scene's, but so
    large that the longer side of the rendered part has `least_px`, and never larger than the scene's.
    """
    scale = min(max(percentage / 100.0, least_px / max(region.width, region.height, 1)), 1.0)
    width, height = (max(math.ceil(scale * side), MIN_SIDE_PX) for side in (region.full_width, region.full_height))
    return width, height


def _delivery(frame: int | None, *, preview: bool = False, compared: bool = False) -> Delivery:
    """Return the picture of this frame that was handed over just now; if it was compared, with multiview's."""
    return Delivery(content_now(), frame, time.strftime("%H:%M"), preview, multiview_now() if compared else None)


def _pair_progress(scene: bpy.types.Scene, settings: StereoSettings, *, looks: bool) -> Progress:
    """Return the progress of a pair that is about to be rendered, with looks after a first look. The expected seconds
    of each stage are those of the last pair with the same settings, or else those that a check with them predicted;
    without either, the usual shares of the stages are taken.
    """
    result, now, usual = result_of(scene), time.monotonic(), USUAL["render"]
    layers = len(layers_to_render(scene))
    if result.run is not None and result.report is not None and result.run.settings == settings:
        each = {stage: seconds / max(layers, 1) for stage, seconds in seconds_of(result.report, usual).items()}
        return Progress(now, each, in_seconds=True, frames=layers)
    checked = result.inspection
    if checked is not None and result.inspected == settings and checked["predicted"]["total_seconds"] is not None:
        each = {**dict.fromkeys(usual, 0.0), **_predicted_stages(checked["predicted"])}
        return Progress(now, each, in_seconds=True, frames=layers)
    stages = with_look(usual) if looks else usual
    stages = {**stages, Stage.COMPARE: 4.0 * usual[Stage.SOURCE]} if settings.compare else stages
    return Progress(now, stages, frames=layers)


def _predicted_stages(predicted: Mapping[str, Any]) -> dict[str, float]:
    """Return the seconds of each stage, by its name, that a check has predicted."""
    refine = predicted["refine_seconds"]
    return {
        Stage.SOURCE: predicted["source_seconds"],
        Stage.DENOISE_SOURCE: 0.5 * predicted["denoise_seconds"],
        Stage.WARP: predicted["warp_seconds"],
        Stage.FILL: predicted["fill"]["seconds"],
        Stage.REFINE: 0.5 * (refine["low"] + refine["high"]),
        Stage.DENOISE_TARGET: 0.5 * predicted["denoise_seconds"],
    }


def _deliver(
    scene: bpy.types.Scene | None, run: BackgroundJob, *, frame: int | None, to_look_at: bool, preview: bool = False
) -> tuple[str, Eyes]:
    """Make the eyes that a run has written the scene's Render Result, and show it. The run's EXR files are removed.

    Return "", or words for the message if the result is in another render slot than the user's; and the eyes. frame is
    the one at which the scene's compositor is run; to_look_at is as for `deliver_to_result`. A preview, a picture after
    one, which has another size, and a result whose pictures were fitted under way are fitted to the editor. Raises
    BadInputError if the scene is None, since it was deleted meanwhile.
    """
    if scene is None:
        raise _deleted(run)
    before = result_of(scene).delivery
    leave_multiview(None if before is None else before.content)
    with pixels_of(scene, run.settings.scene.panorama):
        hand_over_multiview(scene, run, frame=frame)
    eyes = {view: read_eye(run.folder / f"{view}.exr") for view in VIEWS}
    metadata = with_render_time(read_metadata(run.folder / f"{VIEWS[0]}.exr"), _render_seconds(run, frame))
    with unused_slot() as slot, pixels_of(scene, run.settings.scene.panorama):
        gone = deliver_to_result(
            scene, eyes, frame=frame, to_look_at=to_look_at, metadata=metadata, layers_then=run.layers
        )
    for view in VIEWS:
        (run.folder / f"{view}.exr").unlink()
    if gone:
        run.warnings.append(_words_of_deleted(gone))
    if bpy.context.window is not None and not bpy.app.background:
        fit = preview or has_preview(scene) or under_way.is_fitted()
        # An editor that the user has turned to something else since the job began is left alone.
        show_delivered(scene, fit=fit, opens=not under_way.hand_over())
    if slot is None:
        return "", eyes
    return Words("; in the render slot {slot}, as another render was made meanwhile", slot=repr(slot)), eyes


def _depth_of(scene: bpy.types.Scene, eyes: Eyes, source: str, frame: int) -> KnownDepth | None:
    """Return the depths that a frame's rendered eye, named by source, shows; None where that is nothing, or where the
    scene's camera has no screen.
    """
    cameras = eyes_of(scene)
    if cameras is None:
        return None
    left, right, width = cameras
    seen = visible_parallax(left, right, _nearest(eyes[source]), width)
    return None if seen is None else KnownDepth(seen[0].depth, seen[1].depth, frame, _edges_of(scene, eyes, frame))


def _edges_of(scene: bpy.types.Scene, eyes: Eyes, frame: int | None) -> tuple[EdgeHit, ...] | None:
    """Return what both eyes show at the frame's edges, at this frame of the scene; None where a render region leaves
    the edges out. Where something is in front of the screen and the scene stands at that frame, ray casts find names.
    """
    region = frame_region(scene.render)
    if (region.left, region.width) != (0, region.full_width):
        return None
    hits = hits_of_pair({eye: _nearest(layers) for eye, layers in eyes.items()}, EDGE_ROWS)
    depth = depth_of_cuts(scene)
    is_cut = depth is not None and any(hit.depth < depth for hit in hits)
    if not is_cut or scene != bpy.context.scene or frame != scene.frame_current:
        return hits
    return named(hits, edge_hits(scene, bpy.context.evaluated_depsgraph_get()))


def _nearest(layers: Mapping[str, Mapping[str, NDArray]]) -> NDArray:
    """Return the depth (H, W) of what is nearest in the view layers of an eye."""
    return np.min([passes[DEPTH_PASS][..., 0] for passes in layers.values()], axis=0)


def _render_seconds(run: BackgroundJob, frame: int | None) -> float | None:
    """Return the seconds that a finished run's picture took: the pair's, or those of this frame of an animation. None
    where the animation's report has none for it.
    """
    report = run.report
    assert report is not None
    rows = {row["frame"]: row for row in report["frames"]} if "frames" in report else {frame: report}
    return rows[frame]["seconds"]["total"] if frame in rows else None


def _words_of_deleted(layers: Sequence[str]) -> Words:
    """Return a warning about view layers that were deleted while the pair was rendered."""
    one = "the view layer {names} was deleted meanwhile: the pair is as it was before the scene's compositor"
    more = "the view layers {names} were deleted meanwhile: the pair is as it was before the scene's compositor"
    return Words(one if len(layers) == 1 else more, names=", ".join(map(repr, layers)))


def _deleted(run: BackgroundJob) -> BadInputError:
    """Return an error, for the caller to raise, that says that the run's scene was deleted while it was rendered."""
    return BadInputError(Words("the scene {scene} was deleted meanwhile", scene=repr(run.scene_name)))


def summary(scene: bpy.types.Scene) -> str:
    """Return a line about the scene's last pair: how good it is, and the time that was saved."""
    report, gain = result_of(scene).report, full_gain_of(scene)
    assert report is not None
    quality = quality_of(report, preview=gain is not None).words
    return Words("{quality}. {time}", quality=quality, time=time_words(report, full_gain=gain))
