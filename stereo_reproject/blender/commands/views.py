"""Many views of one frame of a .blend, from the file to the finished files: what the command line calls."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy

from ...estimate.shared_noise import NoiseOrigins, shared_noise
from ...files import write_json
from ...images.exr import write_eye
from ...images.multi_view import write_multi_view
from ...images.passes import COLOUR_PASS
from ...jobs.memory import give_back_freed
from ...jobs.work_folder import ALL_VIEWS, HOLES_FOLDER, VIEWS_FOLDER
from ...pipeline.many_views import WantedViews, render_many_views
from ...pipeline.onlooker import NOBODY, Onlooker
from ...pipeline.shared_findings import SharedFindings
from ...pipeline.stages import OUTSIDE_TOTAL, Stage
from ...pipeline.stereo_frame import colour
from ...pipeline.stopwatch import Stopwatch
from ...pipeline.views_maker import FinishedView, ViewsMaker
from ...report.as_json import ABSENT, as_json
from ...report.views_report import ViewReport, ViewsReport, fresh_report, neighbours_report, view_report
from ...settings.frame import StereoSettings
from ...settings.views import VIEWS_LAYOUTS, ViewsSettings
from ...trace.costs import TraceCosts
from ...words import Words
from ..engines.views_renderer import ManyViewsRenderer, stereo_moves, stereo_restored
from ..output.pictures import write_holes
from ..output.view_files import runs_compositor
from ..scene.compositor import file_outputs, gives_a_picture, is_composited
from ..scene.rendered import check_layers
from ..scene.warnings import scene_warnings
from ..scene.working import WorkingScenes, working_scene
from .compare_views import PlainViews, compare_views
from .frame import memory_report, picture_header
from .known_costs import known_costs, learn_costs
from .view_rigs import Copies, ViewRig, cameras_in, count_of_views, rig_of
from .views_pictures import ViewPlaces, write_pictures


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
    views_folder, holes_folder = (work if in_one else work / "out") / VIEWS_FOLDER, work / "out" / HOLES_FOLDER
    for folder in (views_folder, holes_folder):
        folder.mkdir(parents=True, exist_ok=True)
    places = ViewPlaces(work, views_folder, holes_folder)
    report, kept = render_views_of_frame(scene, settings, views, places, onlooker, warn)
    onlooker.on_stage(Stage.WRITE)
    watch = Stopwatch()
    watch.lap(Stage.WRITE)
    files = write_pictures(scene, settings, views, kept.rig, places)
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
class SharedFrame:
    """The things that a frame of an animation shares with the others: scenes are their working scenes; findings
    returns, for a view layer's name, what they have found; learns is as for `frame.render_pair`."""

    scenes: WorkingScenes
    findings: Callable[[str], SharedFindings]
    learns: bool


@contextmanager
def _working(
    scene: bpy.types.Scene, settings: StereoSettings, views: ViewsSettings, layer: str, shared: SharedFrame | None
) -> Iterator[tuple[bpy.types.Scene, Copies]]:
    """Have a working scene for the views of a view layer, with the cameras of the scene's own views, for the time of a
    `with` block: that of an animation's frames if they share one, with its camera set as before afterwards."""
    if shared is None:
        with working_scene(scene, settings.scene, layer=layer) as working, cameras_in(scene, working, views) as copies:
            yield working, copies
        return
    working = shared.scenes.at(settings.scene, layer)
    copies = shared.scenes.beside(lambda kept: cameras_in(scene, kept, views))
    if views.from_scene:
        yield working, copies
        return
    if stereo_moves(working):
        yield working, copies
        # They were held still, and another frame needs what moves them.
        shared.scenes.close()
        return
    with stereo_restored(working):
        yield working, copies


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
    reports: dict[str, ViewReport] = {}
    origins: dict[int, NoiseOrigins] = {}
    count = count_of_views(scene, views, settings.scene.frame)
    views.check_places(count)

    def on_stage(stage: str) -> None:
        onlooker.on_stage(stage, f"view {min(len(reports) + 1, count)} of {count}")

    watch = Stopwatch(Onlooker(on_stage, onlooker.show))
    watch.lap(Stage.PLAN)
    with _working(scene, settings, views, layer, shared) as (working, copies):
        rig = rig_of(scene, working, views, copies)
        with rig.renderer(working, places.work, user_scene=scene, packed_by=settings.packed_camera) as renderer:
            facts = {**vars(picture_header(scene, working, settings)), **_facts(scene, views, renderer, rig)}
            for line in facts["warnings"]:
                warn(line)
            kept = PlainViews(rig, rig.named_cameras(renderer.cameras), layer, places.views)

            def on_view(finished: FinishedView) -> None:
                view = rig.named(finished)
                reports[view.name] = replace(view_report(view), camera=rig.cameras.get(view.name, ABSENT))
                if view.origins is not None:
                    origins[view.number] = view.origins
                if settings.compare:
                    kept.add(view)
                _write_view(view, rig.files[view.name], places, layer, renderer.metadata)
                watch.show(view.name, lambda: colour(view.passes))

            def costs() -> TraceCosts:
                return known_costs(working, renderer.packed_by)

            maker = render_many_views(
                renderer,
                settings,
                WantedViews(rig.asked, views.fresh),
                on_view,
                watch=watch,
                findings=None if shared is None else shared.findings(layer),
                known_costs=costs,
            )
            if shared is None or shared.learns:
                learn_costs(working, renderer.packed_by, maker.costs[0], renderer.trace_renders)
            kept.light_scale = maker.light_scale or 1.0
            facts |= {"packed_by": renderer.packed.name, "plan": rig.plan(maker.steps)}
            facts |= _noise_facts(maker, rig, [origins[number] for number in sorted(origins)])
    give_back_freed()
    ordered = tuple(reports[name] for name in rig.names)
    return _report(scene, settings, views, facts, maker, ordered), kept


def _write_view(view: FinishedView, name: str, places: ViewPlaces, layer: str, metadata: Mapping[str, str]) -> None:
    """Write a finished view into a file of this name, and the picture of its holes into another; layer is the view
    layer."""
    kinds = view.passes if places.keeps_passes else (COLOUR_PASS,)
    passes = {kind: view.passes[kind] for kind in kinds}
    path = places.views / f"{name}.exr"
    write_eye(path, {layer: passes}, view=view.name, metadata=metadata, compressed=places.keeps_passes)
    if places.holes is not None and view.reasons is not None:
        write_holes(places.holes / f"{name}.png", colour(view.passes), view.reasons)


def _facts(scene: bpy.types.Scene, views: ViewsSettings, renderer: ManyViewsRenderer, rig: ViewRig) -> dict[str, Any]:
    """Return the fields of the report, beside its header, that are known before anything is rendered."""
    warnings = [*renderer.warnings, *rig.warnings, *views_warnings(scene)]
    if views.fresh > 0.0 and renderer.denoise is not None:
        warnings.append(Words("in denoised pictures nothing is traced anew: such pixels would stand out"))
    return {**rig.facts, "warnings": tuple(warnings)}


def _noise_facts(maker: ViewsMaker, rig: ViewRig, origins: Sequence[NoiseOrigins]) -> dict[str, Any]:
    """Return the fields of the report about the noise that views have in common; origins are those of all views in
    order, none in denoised pictures."""
    before = shared_noise(origins) if origins else None
    noise = shared_noise([each.anew() for each in origins]) if origins else None
    return {"neighbours": neighbours_report(noise, rig.made), "fresh": fresh_report(maker, before)}


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
        if gives_a_picture(scene):
            warnings.append(Words("the compositor is not run on many views: several view layers are switched on"))
        else:
            warnings.append(Words("the compositor is not run on many views: nothing is linked to its output"))
    elif runs_compositor(scene) and any(not node.mute for node in file_outputs(scene)):
        warnings.append(Words("File Output nodes write nothing of many views"))
    return warnings
