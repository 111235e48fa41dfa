"""How honest frames and their estimates are, over many places of the probes on the same renders.

    python -m tests.bench.stored_pairs --scenes DIR --size 960x540 --samples 64 [--places 12] [--accuracy balanced]
        [--denoise] [--swing DEGREES [--nearer 0.8]] [--cache DIR] [--json FILE] [SCENE ...]

DIR holds a folder with a .blend of the same name for each scene. Of each, the source eye is rendered once and the
target four times with other seeds. Then the pair is made --places times by the pipeline, with probes in places of their
own; traces come from two of the four renders, and the other two judge it (stored_renders.py). So a frame costs no
render of its own. With --denoise all of them are denoised. With --swing the camera stands elsewhere: turned by so many
degrees around the upright through the point that it looks at, at its convergence distance, and moved to --nearer of its
distance from there; such a view is one that nobody has tuned to. A row has, over the places, means and what is in
brackets:

* traced (greatest), honest ratio (greatest), and worst and wrong tiles;
* FLIP: that of the target over that of a second plain render, of the first place;
* interval: how many intervals of the estimate hold the honest ratio, and how many if they are widened by what the
  comparison itself is unsure of: its standard error over parts of the picture;
* estimate less comparison, and the interval's width;
* speed-up: 2 over 1 and the traced share, in which a probe counts twice, with pixels that cost as those of the source.

What Blender prints goes to standard error.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stereo_reproject.errors import StereoReprojectError
from stereo_reproject.images.metrics import honest_ratio, judged, worst_tiles, wrong_tiles
from stereo_reproject.images.reasons import Reason
from stereo_reproject.images.seen_light import scaled_colour
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.pipeline.stereo_frame import StereoFrame, colour
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.settings.frame import StereoSettings
from tests.bench.coverage import DEVIATIONS, overrides, own_output, parse_scenes, scenes_parser
from tests.bench.performance.plan import EYES
from tests.bench.stored_renders import RENDERS, StoredRenderers, StoredRenders

BLOCK_PX = 32
"""Side of the parts of the picture by whose differences the comparison's standard error is told: errors of
neighbouring pixels go together, those of parts this large hardly."""


@dataclass(frozen=True)
class Pair:
    """One completed target: shares of its pixels, honest ratios, and whether the interval holds the compared one."""

    traced: float
    cost: float
    honest: float
    honest_error: float
    worst: float
    wrong: float
    estimate: float | None
    low: float
    high: float

    def holds(self, widened: bool) -> bool:
        by = DEVIATIONS * self.honest_error if widened else 0.0
        return self.low - by <= self.honest <= self.high + by


@dataclass(frozen=True)
class Row:
    scene: str
    pairs: list[Pair]
    flip_ratio: float | None


def honest_error(ours: NDArray, reference: NDArray, again: NDArray, share: NDArray) -> float:
    """The standard error of the honest ratio of `ours` (H, W, 4), whose pixels have the share (H, W) of a render's
    variance, against two renders: by the parts of the picture, of which one at a time is left out.
    """
    a, b, w = (judged(picture).astype(np.float64) for picture in (reference, again, ours))
    noise = 0.5 * np.sum((a - b) ** 2, axis=2)
    excess, noise = (_by_part(values) for values in (np.sum((w - a) * (w - b), axis=2) - share * noise, noise))
    ratios = np.sqrt(np.maximum(1.0 + 0.5 * (excess.sum() - excess) / (noise.sum() - noise), 0.0))
    return math.sqrt((ratios.size - 1) * float(np.var(ratios)))


def _by_part(values: NDArray) -> NDArray:
    """The sums (N,) of values (H, W) over parts of BLOCK_PX pixels; those at the far edges are smaller."""
    starts = [np.arange(0, side, BLOCK_PX) for side in values.shape]
    return np.add.reduceat(np.add.reduceat(values, starts[0], axis=0), starts[1], axis=1).ravel()


def pair_of(frame: StereoFrame, reference: NDArray, again: NDArray) -> Pair:
    """A finished frame, judged by two renders (H, W, 4) of its target that it was not made of."""
    pictures = [scaled_colour(picture, frame.light_scale) for picture in (target_of(frame), reference, again)]
    traced, estimate = float(np.mean(frame.traced)), frame.refinement.estimate
    told = estimate if estimate is not None and math.isfinite(estimate.honest_low) else None
    return Pair(
        traced=traced,
        cost=traced + float(np.mean((frame.reasons & Reason.PROBE.bit) > 0)),
        honest=honest_ratio(*pictures, frame.variance_share),
        honest_error=honest_error(*pictures, frame.variance_share),
        worst=worst_tiles(*pictures),
        wrong=wrong_tiles(*pictures),
        estimate=None if told is None else told.honest_ratio,
        low=math.nan if told is None else told.honest_low,
        high=math.nan if told is None else told.honest_high,
    )


def target_of(frame: StereoFrame) -> NDArray[np.float32]:
    return colour(frame.eyes[StereoSettings().target])


def measure_scene(name: str, options: argparse.Namespace) -> Row:
    from stereo_reproject.blender.scene.working import open_blend, working_scene

    label = f"-swung{options.swing:g}-{options.nearer:g}" if options.swing else ""
    scene = open_blend(options.scenes / name / f"{name}.blend")
    own = replace(overrides(name, options), denoise=options.denoise)
    with working_scene(scene, own) as working, tempfile.TemporaryDirectory() as folder:
        if options.swing:
            swing(working, options.swing, options.nearer)
        renders = StoredRenders.of_scene(working, Path(folder), kept_file(name + label, options))
        renderers = StoredRenderers(working, Path(folder), renders)
        pairs: list[Pair] = []
        flip = None
        for place in range(1, options.places + 1):
            frame = render_stereo_frame(renderers.at(place), StereoSettings(accuracy=options.accuracy))
            judges = renderers.judges(place)
            pairs.append(pair_of(frame, *judges))
            if place == 1:
                flip = flip_ratio(scene, frame, *judges)
    return Row(name + label, pairs, flip)


def kept_file(name: str, options: argparse.Namespace) -> Path | None:
    """The file in which a scene's renders are kept for the next time, None if they are not."""
    import bpy

    if options.cache is None:
        return None
    (width, height), kind = options.size, "denoised" if options.denoise else "noisy"
    key = f"stored-{name}-{width}x{height}-{options.samples}-{kind}-{RENDERS}-{bpy.app.version_string}.npz"
    return options.cache / key.replace(" ", "-")


def swing(working: Any, degrees: float, nearer: float) -> None:
    """Have the scene's camera look at the same point from elsewhere."""
    from mathutils import Matrix

    camera = working.camera
    world = camera.matrix_world.copy()
    seen = world @ Matrix.Translation((0.0, 0.0, -camera.data.stereo.convergence_distance))
    centre = Matrix.Translation(seen.translation)
    turned = (
        centre @ Matrix.Rotation(math.radians(degrees), 4, "Z") @ Matrix.Scale(nearer, 4) @ centre.inverted() @ world
    )
    place, turn, _ = turned.decompose()
    camera.constraints.clear()
    camera.parent = None
    camera.animation_data_clear()
    camera.matrix_world = Matrix.LocRotScale(place, turn, world.to_scale())
    camera.data.stereo.convergence_distance *= nearer
    working.view_layers[0].update()


def flip_ratio(scene: Any, frame: StereoFrame, reference: NDArray, again: NDArray) -> float | None:
    """FLIP of the target over that of a second render, both as the scene's view transform shows them; None where FLIP
    is not installed."""
    from stereo_reproject.blender.commands.compare import MultiviewReference, flips

    rendered = MultiviewReference("CYCLES", 0.0, reference, again, frame.light_scale)
    with tempfile.TemporaryDirectory() as folder:
        flip, noise_flip = flips(scene, StereoSettings(), target_of(frame), rendered, Path(folder))
    return flip / noise_flip if flip is not None and noise_flip else None


COLUMNS = (
    "traced (most)",
    "honest ratio (greatest)",
    "FLIP",
    "worst tiles",
    "wrong tiles",
    "interval holds it",
    "widened",
    "estimate less comparison",
    "width",
    "speed-up",
)


def line(row: Row) -> str:
    def of(name: str) -> NDArray:
        return np.array([getattr(pair, name) for pair in row.pairs], float)

    told = [pair for pair in row.pairs if pair.estimate is not None]
    cells = [
        f"{100.0 * of('traced').mean():.1f} % ({100.0 * of('traced').max():.1f})",
        f"{of('honest').mean():.3f} ({of('honest').max():.3f})",
        "–" if row.flip_ratio is None else f"{row.flip_ratio:.3f}",
        f"{of('worst').mean():.2f}",
        f"{100.0 * of('wrong').mean():.2f} %",
        *(f"{sum(pair.holds(widened) for pair in told)} of {len(told)}" for widened in (False, True)),
        f"{np.mean([pair.estimate - pair.honest for pair in told]):.3f}" if told else "no probes",
        f"{np.mean([pair.high - pair.low for pair in told]):.2f}" if told else "–",
        f"{np.mean(2.0 / (1.0 + of('cost'))):.2f}",
    ]
    return f"| {row.scene} | {' | '.join(cells)} |"


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    parser = scenes_parser(__doc__ or "")
    promising = [name for name, accuracy in SETTINGS.items() if accuracy.promise is not None]
    parser.add_argument("--accuracy", choices=promising, default="balanced")
    parser.add_argument("--places", type=int, default=12, help="frames that are completed per scene")
    parser.add_argument("--denoise", action="store_true", help="denoise all renders, as the scene's denoiser does")
    parser.add_argument("--swing", type=float, default=0.0, metavar="DEGREES")
    parser.add_argument("--nearer", type=float, default=0.8, metavar="SHARE")
    return parse_scenes(parser, arguments, EYES)


def measure(options: argparse.Namespace, tell: Callable[[str], None]) -> Iterator[Row]:
    tell(f"| scene | {' | '.join(COLUMNS)} |")
    tell("|---" * (1 + len(COLUMNS)) + "|")
    for name in options.names:
        row = measure_scene(name, options)
        tell(line(row))
        yield row


def main() -> None:
    options = parse()
    tell = own_output()
    rows: list[Row] = []
    status = 0
    try:
        rows += measure(options, tell)
    except StereoReprojectError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        status = error.exit_status
    if options.json is not None and status == 0:
        options.json.write_text(json.dumps([asdict(row) for row in rows], indent=1), encoding="utf-8")
    # Blender's own clean-up at exit may not come to an end in 4.5.
    os._exit(status)


if __name__ == "__main__":
    main()
