"""Many views of one frame of a .blend, from the file to the finished files: what the command line calls."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy

from ...delivery.quilts import quilt_name
from ...estimate.shared_noise import NoiseOrigins, shared_noise
from ...files import write_json
from ...images.exr import write_eye
from ...images.passes import COLOUR_PASS
from ...jobs.memory import give_back_freed
from ...jobs.work_folder import CONTACT_SHEET, SWEEP, VIEWS_FOLDER, views_files
from ...pipeline.many_views import render_many_views
from ...pipeline.onlooker import NOBODY, Onlooker
from ...pipeline.shared_findings import SharedFindings
from ...pipeline.stages import OUTSIDE_TOTAL, Stage
from ...pipeline.stereo_frame import colour
from ...pipeline.stopwatch import Stopwatch
from ...pipeline.views_maker import FinishedView, ViewsMaker
from ...report.as_json import as_json
from ...report.views_report import (
    ViewReport,
    ViewsReport,
    fresh_report,
    neighbours_report,
    plan_lines,
    view_report,
)
from ...settings.frame import StereoSettings
from ...settings.views import ViewsSettings
from ...trace.costs import TraceCosts
from ...views.cone import baseline_of, cone_degrees, offsets_of
from ...words import Words
from ..engines.views_renderer import ViewsRenderer, stereo_moves, stereo_restored
from ..output.quilt_files import write_contact_sheet, write_quilt, write_sweep
from ..output.view_files import ViewFiles
from ..scene.compositor import is_composited
from ..scene.cone_room import cone_warnings
from ..scene.rendered import check_layers
from ..scene.warnings import scene_warnings
from ..scene.working import WorkingScenes, evaluated, working_scene
from .compare_views import PlainViews, compare_views
from .frame import memory_report, picture_header
from .known_costs import known_costs, learn_costs


@dataclass(frozen=True)
class Cone:
    """The places of many views: the distance of the plane that all show alike, and that between the outermost cameras,
    in scene units."""

    focus_distance: float
    baseline: float
    count: int

    @property
    def offsets(self) -> list[float]:
        """Places of the cameras beside the scene's camera, in scene units, from the leftmost on."""
        return offsets_of(self.count, self.baseline)


def cone_of(working: bpy.types.Scene, views: ViewsSettings) -> Cone:
    """Return the places of the views that are asked for, before the camera of a working scene."""
    stereo = evaluated(working.camera, working).data.stereo
    focus = stereo.convergence_distance if views.focus_distance is None else views.focus_distance
    return Cone(focus, baseline_of(views, focus), views.count)


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
    folder = work / "out" / VIEWS_FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    report, kept = render_views_of_frame(scene, settings, views, ViewPlaces(work, folder), onlooker, warn)
    onlooker.on_stage(Stage.WRITE)
    watch = Stopwatch()
    watch.lap(Stage.WRITE)
    files = _write_pictures(scene, settings, views, work / "out")
    watch.lap()
    report = replace(report, seconds={Stage.LOAD.value: load_seconds, **report.seconds, **watch.seconds})
    if settings.compare:
        onlooker.on_stage(Stage.COMPARE)
        report = replace(report, compare=compare_views(scene, settings, kept, report.seconds["total"], work))
    written = as_json(replace(report, files=tuple(files)))
    write_json(work / "out" / "report.json", written)
    return written, files


@dataclass(frozen=True)
class ViewPlaces:
    """Folders of a run: `work`, for what passes between the stages, and that of the views' files. keeps_passes: True
    where these are what users get; else they have the colour alone."""

    work: Path
    views: Path
    keeps_passes: bool = True


@dataclass(frozen=True)
class SharedFrame:
    """The things that a frame of an animation shares with the others: scenes are their working scenes; findings
    returns, for a view layer's name, what they have found; learns is as for `frame.render_pair`."""

    scenes: WorkingScenes
    findings: Callable[[str], SharedFindings]
    learns: bool


@contextmanager
def _working(
    scene: bpy.types.Scene, settings: StereoSettings, layer: str, shared: SharedFrame | None
) -> Iterator[bpy.types.Scene]:
    """Have a working scene for the views of a view layer, for the time of a `with` block: that of an animation's frames
    if they share one, with its camera set as before afterwards."""
    if shared is None:
        with working_scene(scene, settings.scene, layer=layer) as working:
            yield working
        return
    working = shared.scenes.at(settings.scene, layer)
    if stereo_moves(working):
        yield working
        # They were held still, and another frame needs what moves them.
        shared.scenes.close()
        return
    with stereo_restored(working):
        yield working


def render_views_of_frame(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    views: ViewsSettings,
    places: ViewPlaces,
    onlooker: Onlooker,
    warn: Callable[[str], None],
    shared: SharedFrame | None = None,
) -> tuple[ViewsReport, PlainViews]:
    """Render the views and write each into its folder as it is finished. Return the report, and what a comparison
    needs of them. The parameters are those of `render_views_files`; shared is None for a frame on its own."""
    layer = check_layers(scene)[0]
    reports: dict[int, ViewReport] = {}
    origins: dict[int, NoiseOrigins] = {}

    def on_stage(stage: str) -> None:
        onlooker.on_stage(stage, f"view {min(len(reports) + 1, views.count)} of {views.count}")

    watch = Stopwatch(Onlooker(on_stage, onlooker.show))
    watch.lap(Stage.PLAN)
    with _working(scene, settings, layer, shared) as working:
        cone = cone_of(working, views)
        renderer = ViewsRenderer(
            working, places.work, cone.offsets, cone.focus_distance, user_scene=scene, packed_by=settings.packed_camera
        )
        facts = {**vars(picture_header(scene, working, settings)), **_facts(scene, working, renderer, cone)}
        if views.fresh > 0.0 and renderer.denoise is not None:
            facts["warnings"] += (Words("in denoised pictures nothing is traced anew: such pixels would stand out"),)
        for line in facts["warnings"]:
            warn(line)
        kept = PlainViews(cone.offsets, cone.focus_distance, layer, renderer.cameras)

        def on_view(view: FinishedView) -> None:
            reports[view.number] = view_report(view)
            if view.origins is not None:
                origins[view.number] = view.origins
            if settings.compare:
                kept.add(view)
            kinds = view.passes if places.keeps_passes else (COLOUR_PASS,)
            write_eye(
                places.views / f"{view.name}.exr",
                {layer: {name: view.passes[name] for name in kinds}},
                view=view.name,
                metadata=renderer.metadata,
                compressed=places.keeps_passes,
            )
            watch.show(view.name, lambda: colour(view.passes))

        def costs() -> TraceCosts:
            return known_costs(working, renderer.packed_by)

        findings = None if shared is None else shared.findings(layer)
        maker = render_many_views(
            renderer,
            settings,
            views.names,
            on_view,
            fresh=views.fresh,
            watch=watch,
            findings=findings,
            known_costs=costs,
        )
        if shared is None or shared.learns:
            learn_costs(working, renderer.packed_by, maker.costs[0], renderer.trace_renders)
        kept.light_scale = maker.light_scale or 1.0
        facts["packed_by"] = renderer.packed.name
        facts.update(_noise_facts(maker, [origins[number] for number in sorted(origins)]))
    give_back_freed()
    ordered = tuple(reports[number] for number in sorted(reports))
    return _report(scene, settings, views, facts, maker, ordered), kept


def _facts(scene: bpy.types.Scene, working: bpy.types.Scene, renderer: ViewsRenderer, cone: Cone) -> dict[str, Any]:
    """Return the fields of the report, beside its header, that are known as long as the working scene is there."""
    return {
        "cone_degrees": cone_degrees(cone.baseline, cone.focus_distance),
        "baseline": cone.baseline,
        "focus_distance": cone.focus_distance,
        "warnings": (
            *renderer.warnings,
            *cone_warnings(working, cone.offsets, cone.focus_distance),
            *views_warnings(scene),
        ),
    }


def _noise_facts(maker: ViewsMaker, origins: Sequence[NoiseOrigins]) -> dict[str, Any]:
    """Return the fields of the report about the noise that views have in common; origins are those of all views in
    order, none in denoised pictures."""
    names = [view.name for view in maker.views]
    before = shared_noise(origins) if origins else None
    noise = shared_noise([each.anew() for each in origins]) if origins else None
    return {"neighbours": neighbours_report(noise, names), "fresh": fresh_report(maker, before)}


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
        plan=plan_lines(maker.steps),
        seconds={**seconds, "total": total},
        predicted_speedup=maker.plain_seconds(views.count) / total,
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
    if is_composited(scene):
        warnings.append(Words("the compositor is not run on many views"))
    return warnings


def _write_pictures(scene: bpy.types.Scene, settings: StereoSettings, views: ViewsSettings, out: Path) -> list[str]:
    """Write the quilt, the contact sheet and the sweep of the views into the folder `out`; return the names of all
    files there."""
    pictures, frame = ViewFiles(out / VIEWS_FOLDER, views.names), settings.scene.frame
    quilts: list[str] = []
    if views.columns is not None and views.rows is not None:
        height, width = pictures[0].shape[:2]
        render = scene.render
        aspect = views.aspect or width * render.pixel_aspect_x / (height * render.pixel_aspect_y)
        name = quilt_name(views.columns, views.rows, aspect)
        quilts = [f"{name}.png", f"{name}.exr"]
        for quilt in quilts:
            write_quilt(scene, pictures, views.columns, views.rows, out / quilt, frame=frame)
    write_contact_sheet(scene, pictures, out / CONTACT_SHEET, frame=frame)
    write_sweep(scene, pictures, out / SWEEP, frame=frame)
    return [*quilts, *views_files(views)]
