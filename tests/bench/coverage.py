"""How often the interval of the estimate covers the true excess, over runs in real scenes.

    python tests/bench/coverage.py --scenes DIR [--runs 8] [--cache DIR] [--json FILE] [SCENE ...]

DIR holds a folder with a .blend of the same name for each scene. A run is one pair, rendered with a seed of its own;
the accuracies take turns. Its finished target is held against plain renders of the target, together at least
--reference-samples samples a pixel (truth.py says how), with seeds that no run has. A run is covered when the truth
lies inside the interval of the honest ratio; apart from that is told how many are when the interval is widened by the
standard error that the references themselves have. z is (estimate - truth) in standard deviations of the estimate, as
the interval tells them. A run without an estimate (nothing was probed) counts for nothing and another is made in its
place, up to twice as many runs as asked for. Ends with status 1 where less than 90 % are covered. What Blender prints
goes to standard error.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tempfile
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from stereo_reproject.errors import StereoReprojectError
from stereo_reproject.settings.frame import FILL_METHODS, SceneOverrides, StereoSettings
from tests.bench.performance.plan import EYES
from tests.bench.truth import GROUPS, References, Truth, binomial_interval

SCENES = {name: EYES[name] for name in ("bathroom", "veach-mis", "living-room", "broken-window", "glass-vase")}
"""Interocular and convergence distance."""

ACCURACIES = ("preview", "balanced", "high", "exact")
MARK = 0.90
DEVIATIONS = 1.96
"""Standard deviations from the middle of a 95 % interval to its ends."""

WIDTH_TO_SPEAK_OF = 1e-4
"""A tenth of the standard error of references at the default size; and float32 draws are not exact."""

REFERENCE_SEED = 1_500_000_000
"""First seed of the references. Runs have 1, 2, ..., and their traces a few times 1 000 003 more."""


@dataclass(frozen=True)
class Run:
    """What one pair told of itself, and what is true of it: estimate, low, high and truth are honest ratios, estimate
    None without one; noise_ratio and true_noise_ratio stand beside them."""

    scene: str
    accuracy: str
    seed: int
    traced: float
    estimate: float | None = None
    low: float = math.nan
    high: float = math.nan
    truth: float = math.nan
    excess: float = math.nan
    standard_error: float = math.nan
    """Of `excess`, and from the references alone."""
    noise_ratio: float | None = None
    true_noise_ratio: float = math.nan

    @property
    def covered(self) -> bool:
        return self.low**2 - 1.0 <= self.excess <= self.high**2 - 1.0

    @property
    def nearly_covered(self) -> bool:
        """Covered when the interval is widened by the references' own standard error."""
        low, high = (ratio**2 - 1.0 for ratio in (self.low, self.high))
        return low - self.standard_error <= self.excess <= high + self.standard_error

    @property
    def z(self) -> float:
        """NaN where the interval has no width to speak of."""
        deviation = (self.high**2 - self.low**2) / (2.0 * DEVIATIONS)
        told = (self.estimate or 0.0) ** 2 - 1.0
        return (told - self.excess) / deviation if deviation > WIDTH_TO_SPEAK_OF else math.nan


def overrides(name: str, options: argparse.Namespace) -> SceneOverrides:
    interocular, convergence = EYES[name]
    return SceneOverrides(
        size=options.size,
        samples=options.samples,
        interocular_distance=interocular,
        convergence_distance=convergence,
        convergence_mode="off-axis",
        denoise=False,
    )


def measure_scene(name: str, options: argparse.Namespace) -> Iterator[Run]:
    """The runs of a scene, until as many as asked for have an estimate."""
    from stereo_reproject.blender.scene.working import open_blend, working_scene

    scene = open_blend(options.scenes / name / f"{name}.blend")
    with working_scene(scene, overrides(name, options)) as working, tempfile.TemporaryDirectory() as folder:
        references = make_references(name, working, Path(folder), options)
        told = 0
        for number in range(2 * options.runs):
            accuracy = options.accuracy[number % len(options.accuracy)]
            run = measure_run(name, working, Path(folder), references, accuracy, number + 1, options.fill)
            told += run.estimate is not None
            yield run
            if told == options.runs:
                return


def measure_run(
    name: str, working: Any, folder: Path, references: References, accuracy: str, seed: int, fill: str
) -> Run:
    from stereo_reproject.blender.engines.renderer import BlenderRenderer
    from stereo_reproject.pipeline.frame import render_stereo_frame
    from stereo_reproject.pipeline.stereo_frame import colour

    settings = StereoSettings(accuracy=accuracy, fill=fill)
    working.cycles.seed = seed
    frame = render_stereo_frame(BlenderRenderer(working, folder), settings)
    truth = references.truth(colour(frame.eyes[settings.target]), frame.variance_share)
    return _run(name, accuracy, seed, float(np.mean(frame.traced)), frame.refinement.estimate, truth)


def _run(name: str, accuracy: str, seed: int, traced: float, estimate: Any, truth: Truth) -> Run:
    known = truth.honest_ratio, truth.excess, truth.standard_error
    if estimate is None:
        told, noise_ratio = (None, math.nan, math.nan), None
    else:
        told, noise_ratio = (estimate.honest_ratio, estimate.honest_low, estimate.honest_high), estimate.noise_ratio
    return Run(name, accuracy, seed, traced, *told, *known, noise_ratio, truth.noise_ratio)


def make_references(name: str, working: Any, folder: Path, options: argparse.Namespace) -> References:
    """Rendered, or from the cache; enough to hold --reference-samples together, and two in each group at least."""
    import bpy

    from stereo_reproject.blender.engines.render import render_views
    from stereo_reproject.images.seen_light import display_scale
    from stereo_reproject.pipeline.stereo_frame import colour
    from stereo_reproject.warp.composite import replace_non_finite

    renders = max(math.ceil(options.reference_samples / options.samples), 2 * GROUPS)
    width, height = options.size
    key = f"seen-{name}-{width}x{height}-{options.samples}-seed{REFERENCE_SEED}-{renders}-{bpy.app.version_string}.npz"
    kept = None if options.cache is None else options.cache / key.replace(" ", "-")
    if kept is not None and kept.exists():
        return References.load(kept)
    references = None
    view = StereoSettings().target
    for number in range(renders):
        rendered = render_views(working, (view,), folder, seed=REFERENCE_SEED + number)
        picture = colour(replace_non_finite(rendered.views[view])[0])
        references = references or References.none(width, height, display_scale(picture))
        references.add(picture)
    assert references is not None
    if kept is not None:
        kept.parent.mkdir(parents=True, exist_ok=True)
        references.save(kept)
    return references


def line(run: Run) -> str:
    start = f"{run.scene:14s} {run.accuracy:9s} {run.seed:4d} {100.0 * run.traced:6.1f} %"
    truth = f"{run.truth:.4f} ± {run.standard_error / max(2.0 * run.truth, 1e-9):.4f}"
    if run.estimate is None or run.noise_ratio is None:
        return f"{start}  no estimate               {truth}"
    inside = "yes" if run.covered else ("nearly" if run.nearly_covered else "NO")
    noise = f"{run.noise_ratio:.4f} / {run.true_noise_ratio:.4f}"
    told = f"{run.estimate:.4f} [{run.low:.4f}, {run.high:.4f}]"
    return f"{start}  {told}  {truth}  {run.z:+6.2f}  {inside:6s}  {noise}"


def summary(title: str, runs: Sequence[Run]) -> str:
    told = [run for run in runs if run.estimate is not None]
    without = f"; {len(runs) - len(told)} without an estimate" if len(runs) > len(told) else ""
    if not told:
        return f"{title}: nothing to count{without}"
    hits, nearly = sum(run.covered for run in told), sum(run.nearly_covered for run in told)
    low, high = binomial_interval(hits, len(told))
    z = np.array([run.z for run in told])
    z = z[np.isfinite(z)]
    spread = f"; z {z.mean():+.2f}, rms {np.sqrt(np.mean(z**2)):.2f}" if z.size else ""
    return (
        f"{title}: {hits} of {len(told)} covered, {100.0 * hits / len(told):.0f} %"
        f" (95 % interval {100.0 * low:.0f} to {100.0 * high:.0f} %);"
        f" {nearly} with the references' own error{spread}{without}"
    )


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    parser = scenes_parser(__doc__)
    parser.add_argument("--runs", type=int, default=8, help="runs per scene that have an estimate")
    parser.add_argument("--reference-samples", type=int, default=1024)
    parser.add_argument("--accuracy", nargs="+", choices=ACCURACIES, default=list(ACCURACIES))
    # By time, as auto decides, so small a picture is often rendered whole, and then there is nothing to estimate.
    parser.add_argument("--fill", choices=FILL_METHODS, default="packed")
    return parse_scenes(parser, arguments)


def scenes_parser(description: str) -> argparse.ArgumentParser:
    """With what every script that renders these scenes is told."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="SCENE", help=f"default: {' '.join(SCENES)}")
    parser.add_argument("--scenes", type=Path, required=True, metavar="DIR")
    parser.add_argument("--size", type=_size, default=(320, 180), metavar="WxH")
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--cache", type=Path, metavar="DIR", help="keeps the plain renders for the next time")
    parser.add_argument("--json", type=Path, metavar="FILE")
    return parser


def parse_scenes(
    parser: argparse.ArgumentParser,
    arguments: Sequence[str] | None,
    known: Collection[str] = SCENES,
    default: Collection[str] | None = None,
) -> argparse.Namespace:
    """The options, with the default scenes where none is named: all that are known, unless others are given."""
    options = parser.parse_args(arguments)
    options.names = options.names or list(known if default is None else default)
    unknown = [name for name in options.names if name not in known]
    if unknown:
        parser.error(f"unknown scene {unknown[0]!r}: known are {', '.join(known)}")
    return options


def _size(text: str) -> tuple[int, int]:
    width, height = text.split("x")
    return int(width), int(height)


def measure(options: argparse.Namespace, tell: Callable[[str], None]) -> list[Run]:
    told = "estimate [low, high]      truth ± error          z  inside  noise ratio / truth"
    tell(f"{'scene':14s} {'accuracy':9s} seed   traced  {told}")
    runs: list[Run] = []
    for name in options.names:
        for run in measure_scene(name, options):
            runs.append(run)
            tell(line(run))
    for name in options.names:
        tell(summary(name, [run for run in runs if run.scene == name]))
    for accuracy in options.accuracy:
        tell(summary(accuracy, [run for run in runs if run.accuracy == accuracy]))
    tell(summary("all", runs))
    return runs


def stored(run: Run) -> dict[str, Any]:
    """The run for a JSON file, which knows no NaN."""
    fields = asdict(run) | {"covered": run.covered, "nearly_covered": run.nearly_covered, "z": run.z}
    return {name: None if value != value else value for name, value in fields.items()}


def own_output() -> Callable[[str], None]:
    """Prints to standard output; what Blender prints from now on goes to standard error."""
    stream = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    return lambda text: print(text, file=stream, flush=True)


def main() -> None:
    options = parse()
    tell = own_output()
    try:
        runs = measure(options, tell)
        status = 0
    except StereoReprojectError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        runs, status = [], error.exit_status
    if options.json is not None and status == 0:
        options.json.write_text(json.dumps([stored(run) for run in runs], indent=1))
    told = [run.covered for run in runs if run.estimate is not None]
    if status == 0 and (not told or np.mean(told) < MARK):
        status = 1
    # Blender's own clean-up at exit may not come to an end in 4.5.
    os._exit(status)


if __name__ == "__main__":
    main()
