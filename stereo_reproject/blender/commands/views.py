"""Many views of one frame of a .blend, from the file to the finished files: what the command line calls."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...delivery.quilts import quilt_name
from ...files import write_json
from ...images.exr import read_channels, read_eye, read_metadata, write_eye
from ...images.multi_view import write_multi_view
from ...jobs.memory import give_back_freed
from ...jobs.work_folder import ALL_VIEWS, CONTACT_SHEET, HOLES_FOLDER, SWEEP, VIEWS_FOLDER, views_files
from ...pipeline.many_views import render_many_views
from ...pipeline.onlooker import NOBODY, Onlooker
from ...pipeline.stages import OUTSIDE_TOTAL, Stage
from ...pipeline.stereo_frame import colour
from ...pipeline.stopwatch import Stopwatch
from ...pipeline.views_maker import FinishedView, ViewsMaker
from ...report.as_json import ABSENT, as_json
from ...report.views_report import ViewReport, ViewsReport, view_report
from ...settings.frame import StereoSettings
from ...settings.views import VIEWS_LAYOUTS, ViewsSettings
from ...trace.costs import TraceCosts
from ...words import Words
from ..engines.views_renderer import ManyViewsRenderer
from ..output.delivery import deliver_composited_view
from ..output.pictures import write_holes
from ..output.quilt_files import write_contact_sheet, write_quilt, write_sweep
from ..scene.compositor import file_outputs, gives_a_picture, is_composited
from ..scene.rendered import check_layers
from ..scene.warnings import scene_warnings
from ..scene.working import working_scene
from .compare_views import PlainViews, compare_views
from .frame import memory_report, picture_header
from .known_costs import known_costs, learn_costs
from .view_rigs import ViewRig, count_of_views, rig_of


class ViewFiles(Sequence):
    """The colour of views, (H, W, 4) each, read from their files in a folder when it is asked for."""

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        self._paths = [folder / f"{name}.exr" for name in names]

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, index: int) -> NDArray[np.float32]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the colour of one view; slices are not asked for."""
        channels = read_channels(self._paths[index])
        return np.stack([channels[letter] for letter in "RGBA"], axis=-1).astype(np.float32)


def render_views_files(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    views: ViewsSettings,
    work: Path,
    *,
    load_seconds: float = 0.0,
    onlooker: Onlooker = NOBODY,
    warn: Callable[[str], None] = lambda _: None,
) -> tuple[dict[str, Any], list[str]]:
    """Render many views of one frame and write their files into work/out. Return the report, by the keys of
    report.json, and the files' names.

    The parameters are those of `frame.render_files`; only the main view layer is rendered. warn is called with each
    warning that is known before anything is rendered; the report has them too. Raises BadInputError and
    StereoReprojectError.
    """
    in_one = views.layout == VIEWS_LAYOUTS[1]
    places = _Places(work, (work if in_one else work / "out") / VIEWS_FOLDER, work / "out" / HOLES_FOLDER)
    for folder in (places.views, places.holes):
        folder.mkdir(parents=True, exist_ok=True)
    report, kept = _render(scene, settings, views, places, onlooker, warn)
    onlooker.on_stage(Stage.WRITE)
    watch = Stopwatch()
    watch.lap(Stage.WRITE)
    files = _write_pictures(scene, settings, views, kept.rig, places)
    if in_one:
        named = zip(kept.rig.names, kept.rig.file_names, strict=True)
        write_multi_view(work / "out" / ALL_VIEWS, {name: places.views / f"{file}.exr" for name, file in named})
    watch.lap()
    report = replace(report, seconds={Stage.LOAD.value: load_seconds, **report.seconds, **watch.seconds})
    if settings.compare:
        onlooker.on_stage(Stage.COMPARE)
        report = replace(report, compare=compare_views(scene, settings, kept, report.seconds["total"], work))
    written = as_json(replace(report, files=tuple(files)))
    write_json(work / "out" / "report.json", written)
    return written, files


@dataclass(frozen=True)
class _Places:
    """Folders of a run: `work`, for what passes between the stages, and those of the views' files and of the pictures
    of their holes."""

    work: Path
    views: Path
    holes: Path


def _render(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    views: ViewsSettings,
    places: _Places,
    onlooker: Onlooker,
    warn: Callable[[str], None],
) -> tuple[ViewsReport, PlainViews]:
    """Render the views and write each into its folder as it is finished. Return the report, and what a comparison
    needs of them."""
    layer = check_layers(scene)[0]
    reports: dict[str, ViewReport] = {}

    count = count_of_views(scene, views, settings.scene.frame)
    views.check_places(count)

    def on_stage(stage: str) -> None:
        onlooker.on_stage(stage, f"view {min(len(reports) + 1, count)} of {count}")

    watch = Stopwatch(Onlooker(on_stage, onlooker.show))
    watch.lap(Stage.PLAN)
    with working_scene(scene, settings.scene, layer=layer) as working:
        rig = rig_of(scene, working, views)
        with rig.renderer(working, places.work, user_scene=scene, packed_by=settings.packed_camera) as renderer:
            facts = {**vars(picture_header(scene, working, settings)), **_facts(scene, renderer, rig)}
            for line in facts["warnings"]:
                warn(line)
            kept = PlainViews(rig, layer)
            files = dict(zip(rig.names, rig.file_names, strict=True))

            def on_view(finished: FinishedView) -> None:
                view = rig.named(finished)
                reports[view.name] = replace(view_report(view), camera=rig.cameras.get(view.name, ABSENT))
                if settings.compare:
                    kept.add(view)
                path = places.views / f"{files[view.name]}.exr"
                write_eye(path, {layer: view.passes}, view=view.name, metadata=renderer.metadata)
                if view.reasons is not None:
                    write_holes(places.holes / f"{files[view.name]}.png", colour(view.passes), view.reasons)
                watch.show(view.name, lambda: colour(view.passes))

            def costs() -> TraceCosts:
                return known_costs(working, renderer.packed_by)

            maker = render_many_views(renderer, settings, rig.asked, on_view, watch=watch, known_costs=costs)
            learn_costs(working, renderer.packed_by, maker.costs[0], renderer.trace_renders)
            kept.light_scale = maker.light_scale or 1.0
            facts |= {"packed_by": renderer.packed.name, "plan": rig.plan(maker.steps)}
    give_back_freed()
    ordered = tuple(reports[name] for name in rig.names)
    return _report(scene, settings, views, facts, maker, ordered), kept


def _facts(scene: bpy.types.Scene, renderer: ManyViewsRenderer, rig: ViewRig) -> dict[str, Any]:
    """Return the fields of the report, beside its header, that are known before anything is rendered."""
    return {**rig.facts, "warnings": (*renderer.warnings, *rig.warnings, *views_warnings(scene))}


def _report(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    views: ViewsSettings,
    facts: Mapping[str, Any],
    maker: ViewsMaker,
    reports: tuple[ViewReport, ...],
) -> ViewsReport:
    """Return the report of finished views, of which these are the reports in order; facts are the fields that are known
    by then."""
    seconds = maker.watch.seconds
    total = sum(spent for stage, spent in seconds.items() if stage not in OUTSIDE_TOTAL)
    warnings = (*facts["warnings"], *scene_warnings(scene, settings.scene))
    return ViewsReport(
        **{**facts, "warnings": tuple(dict.fromkeys(warnings))},
        display=views.display,
        views=reports,
        seconds={**seconds, "total": total},
        predicted_speedup=maker.plain_seconds(len(reports)) / total,
        memory=memory_report(),
    )


def views_warnings(scene: bpy.types.Scene) -> list[str]:
    """Return a line for each part of the user's scene that many views do not have."""
    warnings = []
    layers = check_layers(scene)
    if len(layers) > 1:
        warnings.append(Words("only the view layer {layer} is rendered in many views", layer=repr(layers[0])))
    if scene.view_layers[layers[0]].use_pass_vector:
        warnings.append(Words("many views have no Vector pass"))
    if is_composited(scene) and not runs_compositor(scene):
        warnings.append(Words("the compositor is not run on many views of several view layers, or without a picture"))
    elif runs_compositor(scene) and any(not node.mute for node in file_outputs(scene)):
        warnings.append(Words("File Output nodes write nothing of many views"))
    return warnings


def runs_compositor(scene: bpy.types.Scene) -> bool:
    """Return whether pictures of many views show them as they are after the scene's compositor: not where it gives no
    picture, or shows view layers that many views do not have."""
    return is_composited(scene) and gives_a_picture(scene) and len(check_layers(scene)) == 1


def _composited(scene: bpy.types.Scene, rig: ViewRig, places: _Places, frame: int | None) -> Path:
    """Return the folder of the views' files as pictures show them: after the scene's compositor, where it is run."""
    if not runs_compositor(scene):
        return places.views
    folder = places.work / "composited"
    folder.mkdir(exist_ok=True)
    for name in rig.file_names:
        path = places.views / f"{name}.exr"
        deliver_composited_view(scene, read_eye(path), folder / path.name, frame=frame, metadata=read_metadata(path))
    return folder


def _write_pictures(
    scene: bpy.types.Scene, settings: StereoSettings, views: ViewsSettings, rig: ViewRig, places: _Places
) -> list[str]:
    """Write the quilt, the contact sheet and the sweep of the views; return the names of all files of the result."""
    frame, out, files = settings.scene.frame, places.work / "out", dict(zip(rig.names, rig.file_names, strict=True))
    folder = _composited(scene, rig, places, frame)
    pictures, along = ViewFiles(folder, rig.file_names), ViewFiles(folder, [files[name] for name in rig.made])
    quilts: list[str] = []
    if views.columns is not None and views.rows is not None:
        height, width = pictures[0].shape[:2]
        render = scene.render
        aspect = views.aspect or width * render.pixel_aspect_x / (height * render.pixel_aspect_y)
        name = quilt_name(views.columns, views.rows, aspect)
        quilts = [f"{name}.png", f"{name}.exr"]
        in_quilt = along if rig.is_line else pictures
        for quilt in quilts:
            write_quilt(scene, in_quilt, views.columns, views.rows, out / quilt, frame=frame)
    write_contact_sheet(scene, pictures, rig.names, out / CONTACT_SHEET, frame=frame)
    write_sweep(scene, along, out / SWEEP, frame=frame)
    holes = [f"{HOLES_FOLDER}/{name}.png" for name in rig.file_names if (places.holes / f"{name}.png").exists()]
    return [*quilts, *holes, *views_files(rig.file_names, views.layout)]
