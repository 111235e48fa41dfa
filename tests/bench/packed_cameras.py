"""Pairs whose holes are traced by a packed OSL camera and by one through a Ray Portal, with one source for both.

    python -m tests.bench.packed_cameras --scenes DIR [--size 320x180] [--samples 16] [--turns 3] [--by osl portal]
        [--denoise] [--passes] [--accuracy balanced] [--json FILE] [SCENE ...]

DIR holds a folder with a .blend of the same name for each scene. For each scene the source is rendered once, and the
target plainly twice, with seeds of their own. Then the pair is made --turns times by each camera, each time with
another seed, the cameras in turns. A row has the medians of the turns:

* speed-up: two plain renders of the target (the mean of both), over all seconds of the pair; and by its own source:
  twice the source's seconds over the same.
* honest ratio, FLIP ratio: as `--compare` has them, against the first plain render.
* packed: seconds of the trace renders, over 1.25 times the traced share of the source's seconds, plus one second.
* portal: the portal's speed-up over that of the OSL camera.
* by processor time: the speed-up, and the portal's over that of the OSL camera, by the seconds that all threads of this
  process were at work. On a machine that others use too they say more than a clock does.

With --passes the scene's layer gets every light pass and those of depth, place and normal besides, and each pass is
told by its error at the traced pixels, over that of a second plain render (`error`), and by its mean difference
(`bias`), with its standard error: light after tone mapping, the others as they are. The first of two plain renders is
as wrong as the second, so the error is the root of the mean over both.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stereo_reproject.settings.frame import ACCURACIES, SceneOverrides, StereoSettings
from tests.bench.coverage import own_output, parse_scenes
from tests.bench.coverage import scenes_parser as bench_parser
from tests.bench.performance.plan import EYES

CAMERAS = ("osl", "portal")
SEED = 1
PLAIN_SEEDS = (1_500_000_000, 1_500_000_001)
LIGHT_PASSES = tuple(
    f"use_pass_{kind}_{part}" for kind in ("diffuse", "glossy", "transmission") for part in ("direct", "indirect")
)
OTHER_PASSES = ("use_pass_z", "use_pass_position", "use_pass_normal", "use_pass_diffuse_color")
BLOCKS = 25
"""Parts of the traced pixels, one of which at a time is left out for the standard error of a mean."""


@dataclass(frozen=True)
class PassError:
    """Error of one pass at the traced pixels: over that between two plain renders, and its mean with its error."""

    error: float
    bias: float
    bias_error: float


@dataclass(frozen=True)
class Turn:
    """One pair. seconds are all of it, processor_seconds those of all threads together, and trace_seconds those of its
    trace renders; shares are of the target's pixels.
    """

    by: str
    seconds: float
    processor_seconds: float
    trace_seconds: float
    traced: float
    share: float
    honest_ratio: float
    flip_ratio: float | None
    worst_tiles: float
    estimate: tuple[float, float, float] | None
    passes: dict[str, PassError] = field(default_factory=dict)


@dataclass(frozen=True)
class Measured:
    """What was measured of a scene: seconds of the source, of its sync, and of the plain renders of one eye, these also
    as processor_seconds.
    """

    scene: str
    source: float
    sync: float
    plain: float
    processor_plain: float
    turns: list[Turn]

    def median(self, by: str, value: Callable[[Turn], float]) -> float:
        return statistics.median(value(turn) for turn in self.turns if turn.by == by)

    def speedup(self, by: str) -> float:
        return self.median(by, lambda turn: 2.0 * self.plain / turn.seconds)

    def speedup_by_processor(self, by: str) -> float:
        return self.median(by, lambda turn: 2.0 * self.processor_plain / turn.processor_seconds)

    def allowed(self, turn: Turn) -> float:
        return 1.25 * turn.share * (self.source - self.sync) + 1.0


def measure(name: str, options: argparse.Namespace) -> Measured:
    """Measure a scene by the options."""
    from stereo_reproject.blender.commands.compare import MultiviewReference
    from stereo_reproject.blender.commands.price_list_renderers import SharedSourceRenderer, render_shared_source
    from stereo_reproject.blender.engines.render import render_views
    from stereo_reproject.blender.scene.working import open_blend, rendered_layer, working_scene
    from stereo_reproject.images.seen_light import display_scale
    from stereo_reproject.pipeline.stereo_frame import colour
    from stereo_reproject.warp.composite import replace_non_finite

    interocular, convergence = EYES[name]
    overrides = SceneOverrides(
        size=options.size,
        samples=options.samples,
        interocular_distance=interocular,
        convergence_distance=convergence,
        convergence_mode="off-axis",
        denoise=options.denoise,
    )
    settings = StereoSettings(accuracy=options.accuracy, fill="packed")
    scene = open_blend(options.scenes / name / f"{name}.blend")
    with working_scene(scene, overrides) as working, tempfile.TemporaryDirectory() as folder:
        if options.passes:
            for switch in (*LIGHT_PASSES, *OTHER_PASSES):
                setattr(rendered_layer(working), switch, True)
        working.cycles.seed = SEED
        began = time.process_time()
        source = render_shared_source(working, settings, Path(folder))
        rendered = time.process_time()
        renders = [render_views(working, (settings.target,), Path(folder), seed=seed) for seed in PLAIN_SEEDS]
        processor = rendered - began, (time.process_time() - rendered) / len(renders)
        plain = [replace_non_finite(render.views[settings.target])[0] for render in renders]
        a, b = map(colour, plain)
        reference = MultiviewReference("CYCLES", 0.0, a, b, display_scale(a))
        turns = []
        for number in range(options.turns):
            for by in options.by[:: -1 if number % 2 else 1]:
                working.cycles.seed = SEED + number
                renderer = SharedSourceRenderer(working, Path(folder), source, packed_by=by)
                turn = _turn(by, renderer, settings, reference, plain, Path(folder), options.passes)
                turns.append(replace(turn, processor_seconds=turn.processor_seconds + processor[0]))
        eye = statistics.mean(render.seconds for render in renders)
        return Measured(name, source.seconds, source.cost.sync_seconds, eye, processor[1], turns)


def _turn(
    by: str,
    renderer: Any,
    settings: StereoSettings,
    reference: Any,
    plain: Sequence[Mapping],
    folder: Path,
    with_passes: bool,
) -> Turn:
    from stereo_reproject.blender.commands.compare import flips
    from stereo_reproject.pipeline.frame import render_stereo_frame
    from stereo_reproject.pipeline.stereo_frame import colour

    began = time.process_time()
    frame = render_stereo_frame(renderer, settings)
    processor_seconds = time.process_time() - began
    eye = frame.eyes[settings.target]
    errors = reference.judge(colour(eye), frame.variance_share)
    flip, noise_flip = flips(renderer.scene, settings, colour(eye), reference, folder)
    estimate = frame.refinement.estimate
    told = None if estimate is None else (estimate.honest_ratio, estimate.honest_low, estimate.honest_high)
    return Turn(
        by=by,
        seconds=frame.seconds["total"] - frame.seconds["source"] + frame.source_cost.seconds,
        processor_seconds=processor_seconds,
        trace_seconds=sum(render.seconds for render in renderer.trace_renders),
        traced=float(frame.traced.mean()),
        share=sum(render.share for render in renderer.trace_renders),
        honest_ratio=errors["honest_ratio"],
        flip_ratio=flip / noise_flip if flip is not None and noise_flip else None,
        worst_tiles=errors["worst_tiles"],
        estimate=told,
        passes=pass_errors(eye, plain, frame.traced) if with_passes else {},
    )


def pass_errors(ours: Mapping, plain: Sequence[Mapping], traced: NDArray[np.bool_]) -> dict[str, PassError]:
    """The errors of those passes (H, W, C) that both have, at the traced pixels (H, W)."""
    from stereo_reproject.images.metrics import judged
    from stereo_reproject.images.passes import is_light

    result = {}
    for name in sorted(set(ours) & set(plain[0])):
        pictures = [np.asarray(passes[name][traced], np.float64) for passes in (ours, *plain)]
        pictures = [judged(picture) if is_light(name) and picture.shape[1] >= 3 else picture for picture in pictures]
        known = np.logical_and.reduce([np.isfinite(picture) & (np.abs(picture) < 1e9) for picture in pictures])
        one, a, b = (np.where(known, picture, 0.0) for picture in pictures)
        noise = np.mean((a - b) ** 2)
        error = np.mean((one - a) ** 2 + (one - b) ** 2) / 2.0
        means = (one - (a + b) / 2.0).mean(axis=1)
        parts = [part.mean() for part in np.array_split(np.random.default_rng(0).permutation(means), BLOCKS)]
        spread = float(np.std(parts, ddof=1) / np.sqrt(BLOCKS))
        result[name] = PassError(float(np.sqrt(error / noise)) if noise else 1.0, float(means.mean()), spread)
    return result


def rows(measured: Measured, cameras: Sequence[str]) -> Iterator[str]:
    """Lines of Markdown, one for each camera and one for each of its passes."""
    for by in cameras:
        flip = [turn.flip_ratio for turn in measured.turns if turn.by == by and turn.flip_ratio is not None]
        against_osl = by != "osl" and "osl" in cameras
        told = [turn.estimate[0] for turn in measured.turns if turn.by == by and turn.estimate is not None]
        cells = [
            measured.scene,
            by,
            f"{measured.speedup(by):.2f}",
            f"{measured.median(by, lambda turn: 2.0 * measured.source / turn.seconds):.2f}",
            f"{measured.median(by, lambda turn: turn.honest_ratio):.3f}",
            f"{statistics.median(flip):.3f}" if flip else "–",
            f"{measured.median(by, lambda turn: turn.worst_tiles):.2f}",
            f"{statistics.median(told):.3f}" if told else "no probes",
            f"{measured.median(by, lambda turn: turn.traced):.1%}",
            f"{measured.median(by, lambda turn: turn.trace_seconds):.2f} s",
            f"{measured.median(by, lambda turn: turn.trace_seconds / measured.allowed(turn)):.2f}",
            f"{measured.speedup(by) / measured.speedup('osl'):.3f}" if against_osl else "–",
            f"{measured.speedup_by_processor(by):.2f}",
            f"{measured.speedup_by_processor(by) / measured.speedup_by_processor('osl'):.3f}" if against_osl else "–",
        ]
        yield f"| {' | '.join(cells)} |"
    for by in cameras:
        turns = [turn for turn in measured.turns if turn.by == by]
        for name in turns[0].passes:
            found = [turn.passes[name] for turn in turns]
            error = statistics.median(one.error for one in found)
            bias = statistics.mean(one.bias for one in found)
            # Ours has two thirds of a turn's variance, the mean of two plain renders, which all turns share, one third.
            doubt = statistics.mean(one.bias_error for one in found) * (2.0 / (3.0 * len(found)) + 1.0 / 3.0) ** 0.5
            yield f"| {measured.scene} | {by} | {name} | {error:.3f} | {bias:+.1e} ± {doubt:.0e} |"


HEAD = (
    "| scene | camera | speed-up | by its own source | honest ratio | FLIP ratio | worst tiles | by estimate | traced "
    "| trace renders | of what is allowed | over OSL | by processor time | over OSL |"
)


def main(arguments: Sequence[str] | None = None) -> int:
    options = _options(arguments)
    tell = own_output()
    tell(f"source seconds and the like are in --json; {options.size[0]} x {options.size[1]}, {options.samples} samples")
    tell(HEAD)
    found = []
    for name in options.names:
        found.append(measure(name, options))
        for line in rows(found[-1], options.by):
            tell(line)
        if options.json is not None:
            options.json.write_text(json.dumps([asdict(one) for one in found], indent=1))
    return 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = bench_parser(str(__doc__))
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--by", nargs="+", choices=CAMERAS, default=list(CAMERAS))
    parser.add_argument("--accuracy", choices=ACCURACIES, default="balanced")
    parser.add_argument("--denoise", action="store_true")
    parser.add_argument("--passes", action="store_true")
    return parse_scenes(parser, arguments, EYES)


if __name__ == "__main__":
    sys.exit(main())
