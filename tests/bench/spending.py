"""What is spent on probes and refinement, and what it buys, when one of their numbers is changed at a time.

    python tests/bench/spending.py --scenes DIR [--accuracy NAME] [--seeds 4] [--cache DIR] [--json FILE] [SCENE ...]

DIR holds a folder with a .blend of the same name for each scene. Of each, the source eye is rendered once, and the
target four times with other seeds. Then the target is made at the given accuracy as the pipeline makes it, but traces
come from two of the four renders; the other two tell the true ratios, worst and wrong tiles. A seed places the probes,
and shifts which two are which. Every value of a knob sees the same renders and seeds, so rows may be compared though
each depends on chance. The fill is chosen as for a source that took a minute: by time, so small a picture would often
be rendered whole. Prints a table in Markdown, means over scenes and seeds, with the values that ship in bold. What
Blender prints goes to standard error.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from stereo_reproject.errors import StereoReprojectError
from stereo_reproject.estimate.noise_ratio import AS_RENDERED, Estimate
from stereo_reproject.estimate.target import Target
from stereo_reproject.estimate.tracing import ProbedTracing, WarpedTarget
from stereo_reproject.estimate.tuning import EstimateTuning
from stereo_reproject.holes.classifier import Optics
from stereo_reproject.holes.reprojection import Reprojection, reproject
from stereo_reproject.holes.tuning import HoleTuning
from stereo_reproject.images.metrics import honest_ratio, noise_ratio, worst_tiles, wrong_tiles
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS, EFFECTS_PASS, MATERIAL_PASS, Passes
from stereo_reproject.images.seen_light import display_scale, scaled_colour, scaled_light
from stereo_reproject.pipeline.warping import interpolations_of
from stereo_reproject.settings.accuracy import SETTINGS, Accuracy, for_size
from stereo_reproject.settings.frame import StereoSettings
from stereo_reproject.trace.planner import FillPlanner
from stereo_reproject.trace.requests import TraceRequest
from stereo_reproject.views.view import Rig
from stereo_reproject.warp.composite import replace_non_finite
from stereo_reproject.warp.options import WarpOptions
from stereo_reproject.warp.rendered_view import RenderedView
from tests.bench.coverage import REFERENCE_SEED, SCENES, overrides, own_output, parse_scenes, scenes_parser
from tests.bench.performance.plan import EYES
from tests.bench.stored_renders import COST, RENDERS, SOURCE_SEED, looked_up
from tests.bench.tuning import in_use

SHIPPED = SETTINGS["balanced"]

SOURCE = "source "
TARGET = "target "
"""What the names of arrays in the cache begin with."""


TUNINGS = (EstimateTuning(), HoleTuning())
"""The tuned numbers that ship, of the rooms that have a say after the warp."""


@dataclass(frozen=True)
class Knob:
    """A number that ships, and those to try in its place: a field of one of `TUNINGS`, or of `Accuracy`."""

    name: str
    values: tuple[float, ...]

    @property
    def tuning(self) -> Any:
        """The tuned numbers of the room that has the field; None where it is the accuracy's."""
        return next((tuning for tuning in TUNINGS if self.name in {field.name for field in fields(tuning)}), None)

    def shipped(self, accuracy: Accuracy = SHIPPED) -> float:
        return getattr(self.tuning or accuracy, self.name)

    @contextmanager
    def turned(self, value: float, accuracy: Accuracy = SHIPPED) -> Iterator[Accuracy]:
        """The accuracy to run with while the knob stands at `value`."""
        if self.tuning is None:
            yield replace(accuracy, **{self.name: value})
            return
        with in_use(replace(self.tuning, **{self.name: value})):
            yield accuracy


KNOBS = (
    Knob("probe_spacing", (6, 8, 12, 16)),
    Knob("frame_reach_tiles", (1, 2, 3)),
    Knob("even_probe_chance", (1.0, 0.5, 0.2)),
    Knob("promise_margin_sigmas", (0.0, 0.5, 1.0)),
    Knob("tile_limit", (1.25, 1.5, 2.0)),
    Knob("max_flagged_weight", (0.005, 0.02, 0.1)),
    Knob("isolated_share", (0.2, 1.0 / 3.0, 0.5)),
)


@dataclass(frozen=True)
class Outcome:
    """Of one finished target: the share that was traced, probes counted, its true honest ratio and noise ratio, worst
    tiles and the share of wrong ones, and the honest ratio that it tells of itself."""

    scene: str
    knob: str
    value: float
    seed: int
    traced: float
    honest: float
    noise: float
    worst: float
    wrong: float
    estimate: float


@dataclass(frozen=True)
class StoredTracer:
    """Traces pixels (N, C) by looking them up in two finished renders (H, W, C) of the target."""

    once: NDArray
    again: NDArray

    def trace(self, _method: str, requests: Sequence[TraceRequest]) -> list[Passes]:
        once, again = {COLOUR_PASS: self.once}, {COLOUR_PASS: self.again}
        return [looked_up(request, once, again) for request in requests]


@dataclass(frozen=True)
class Scene:
    """The warped source, and the colours (H, W, 4) of RENDERS renders of the target, all times light_scale.
    needs_probes: whether something may look different from each eye.
    """

    name: str
    warped: Reprojection
    targets: Sequence[NDArray]
    light_scale: float
    needs_probes: bool

    def outcome(self, knob: Knob, value: float, seed: int, accuracy: Accuracy) -> Outcome:
        with knob.turned(value, accuracy) as accuracy:
            target, estimate = self.finished(accuracy, seed)
        _, _, reference, again = self.shifted(seed)
        ours = target.colour
        renders = ours, reference, again
        honest = honest_ratio(*renders, target.variance_share(self.warped.variance_share, averages_probes=True))
        truth = honest, noise_ratio(*renders), worst_tiles(*renders), wrong_tiles(*renders)
        traced = float(np.mean(target.traced))
        told = AS_RENDERED if estimate is None else estimate
        return Outcome(self.name, knob.name, value, seed, traced, *truth, told.honest_ratio)

    def finished(self, accuracy: Accuracy, seed: int) -> tuple[Target, Estimate | None]:
        """As `frame.render_stereo_frame` makes it from what was warped; and its estimate, None without probes."""
        once, again, _, _ = self.shifted(seed)
        names = [name for name in (COLOUR_PASS, DEPTH_PASS, EFFECTS_PASS, MATERIAL_PASS) if name in self.warped.passes]
        # Copies: pixels are traced into them in place.
        passes = {name: self.warped.passes[name].copy() for name in names}
        views = tuple(replace(view, accuracy=accuracy) for view in self.warped.views)
        warped = replace(self.warped, warped=replace(self.warped.warped, passes=passes), views=views)
        tracer, planner, view = StoredTracer(once, again), FillPlanner("auto", COST, {}), StereoSettings().target
        warped = warped.answered()
        tracing = ProbedTracing(tracer, WarpedTarget(view, warped, planner, accuracy, None, self.needs_probes, seed))
        if tracing.wants_pilot:
            tracing.send_pilot()
        tracing.fill()
        # Refining gives the tracing another target.
        refinement = tracing.refine()
        return tracing.target, refinement.estimate

    def shifted(self, seed: int) -> list[NDArray]:
        """The renders of the target, those to trace from first and then those to judge by."""
        return [self.targets[(seed + number) % RENDERS] for number in range(RENDERS)]


def prepare(
    name: str, options: argparse.Namespace, arrange: Callable[[Any], None] = lambda _: None, label: str = ""
) -> Scene:
    """The scene's renders, made or from the cache, and the source warped by the cameras that it has, at the accuracy
    that was asked for. `arrange` changes the working scene before; the cache knows the change by its label.
    """
    from stereo_reproject.blender.engines.renderer import BlenderRenderer
    from stereo_reproject.blender.scene.working import open_blend, working_scene

    settings = StereoSettings()
    scene = open_blend(options.scenes / name / f"{name}.blend")
    with working_scene(scene, overrides(name, options)) as working, tempfile.TemporaryDirectory() as folder:
        working.cycles.seed = SOURCE_SEED
        arrange(working)
        renderer = BlenderRenderer(working, Path(folder))
        rendered, targets = make_pictures(name + label, renderer, settings, options)
        source, invalid = replace_non_finite(rendered)
        scale = display_scale(source[COLOUR_PASS])
        source, targets = scaled_light(source, scale), [scaled_colour(target, scale) for target in targets]
        views, needs_probes = Rig.of_cameras(renderer.cameras), bool(renderer.plan.view_dependent)
        warped = reproject(
            [RenderedView(views[settings.source], source, invalid)],
            views[settings.target],
            SETTINGS[options.accuracy],
            optics=Optics(renderer.lens, renderer.volumes),
            options=WarpOptions(settings.grid_threshold, *interpolations_of(settings.interpolation, denoised=False)),
        )
    return Scene(name, warped, targets, scale, needs_probes)


def make_pictures(
    name: str, renderer: Any, settings: StereoSettings, options: argparse.Namespace
) -> tuple[Passes, list[NDArray]]:
    """The source's passes and the target's colours, rendered or from the cache."""
    import bpy

    width, height = options.size
    seeds = f"seed{SOURCE_SEED}-{REFERENCE_SEED}-{RENDERS}"
    key = f"spending-shown-{name}-{width}x{height}-{options.samples}-{seeds}-{bpy.app.version_string}.npz"
    kept = None if options.cache is None else options.cache / key.replace(" ", "-")
    if kept is not None and kept.exists():
        return load_pictures(kept)
    source = renderer.render_source(settings.source)[0]
    targets = render_targets(renderer, settings.target)
    if kept is not None:
        kept.parent.mkdir(parents=True, exist_ok=True)
        save_pictures(kept, source, targets)
    return source, targets


def render_targets(renderer: Any, view: str) -> list[NDArray]:
    from stereo_reproject.blender.engines.render import render_views

    seeds = range(REFERENCE_SEED, REFERENCE_SEED + RENDERS)
    rendered = (render_views(renderer.scene, (view,), renderer.folder, seed=seed).views[view] for seed in seeds)
    return [replace_non_finite(passes)[0][COLOUR_PASS] for passes in rendered]


def save_pictures(path: Path, source: Passes, targets: Sequence[NDArray]) -> None:
    # Written whole under another name first: a run that was interrupted leaves no half cache.
    part = path.with_suffix(".part.npz")
    named = {f"{TARGET}{number}": image for number, image in enumerate(targets)}
    np.savez(part, **{f"{SOURCE}{name}": image for name, image in source.items()}, **named)
    part.replace(path)


def load_pictures(path: Path) -> tuple[Passes, list[NDArray]]:
    with np.load(path) as stored:
        source = {name.removeprefix(SOURCE): stored[name] for name in stored.files if name.startswith(SOURCE)}
        return source, [stored[name] for name in stored.files if name.startswith(TARGET)]


COLUMNS = (
    "traced",
    "rendered whole",
    "honest ratio",
    "greatest",
    "noise ratio",
    "worst tiles",
    "wrong tiles",
    "estimate",
    "off by",
)


def table(outcomes: Sequence[Outcome], knobs: Sequence[Knob] = KNOBS, accuracy: Accuracy = SHIPPED) -> str:
    """A row per value of each knob, over all its outcomes; the value that ships is bold.

    Targets that were rendered whole are counted apart as well: one of them moves the mean share that is traced by more
    than most knobs do. `greatest` is of the honest ratio, and `off by` is the root mean square of what the estimate is
    from it.
    """
    lines = [f"| knob | value | {' | '.join(COLUMNS)} |", "|---" * (2 + len(COLUMNS)) + "|"]
    for knob in knobs:
        for value in knob.values:
            of_value = [outcome for outcome in outcomes if (outcome.knob, outcome.value) == (knob.name, value)]
            shown = f"**{value:g}**" if value == knob.shipped(accuracy) else f"{value:g}"
            lines.append(f"| `{knob.name}` | {shown} | {_row(of_value)} |")
    return "\n".join(lines)


def _row(outcomes: Sequence[Outcome]) -> str:
    traced, honest, noise, worst, wrong, estimate = (
        np.array([getattr(outcome, name) for outcome in outcomes])
        for name in ("traced", "honest", "noise", "worst", "wrong", "estimate")
    )
    spent = f"{100.0 * traced.mean():.1f} % | {np.sum(traced == 1.0)} of {traced.size}"
    bought = f"{honest.mean():.3f} | {honest.max():.3f} | {noise.mean():.3f}"
    tiles = f"{worst.mean():.2f} | {100.0 * wrong.mean():.2f} %"
    told = f"{estimate.mean():.3f} | {np.sqrt(np.mean((estimate - honest) ** 2)):.3f}"
    return f"{spent} | {bought} | {tiles} | {told}"


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    parser = scenes_parser(__doc__)
    promising = [name for name, accuracy in SETTINGS.items() if accuracy.promise is not None]
    parser.add_argument("--accuracy", choices=promising, default="balanced")
    parser.add_argument("--seeds", type=int, default=4, help="targets per scene and value")
    return parse_scenes(parser, arguments, EYES, SCENES)


def measure(options: argparse.Namespace, tell: Callable[[str], None]) -> list[Outcome]:
    outcomes: list[Outcome] = []
    width, height = options.size
    accuracy = for_size(SETTINGS[options.accuracy], width * height)
    for name in options.names:
        scene = prepare(name, options)
        for knob in KNOBS:
            for value in knob.values:
                outcomes += [scene.outcome(knob, value, seed, accuracy) for seed in range(1, options.seeds + 1)]
    tell(table(outcomes, accuracy=accuracy))
    return outcomes


def main() -> None:
    options = parse()
    tell = own_output()
    try:
        outcomes, status = measure(options, tell), 0
    except StereoReprojectError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        outcomes, status = [], error.exit_status
    if options.json is not None and status == 0:
        options.json.write_text(json.dumps([asdict(outcome) for outcome in outcomes], indent=1))
    # Blender's own clean-up at exit may not come to an end in 4.5.
    os._exit(status)


if __name__ == "__main__":
    main()
