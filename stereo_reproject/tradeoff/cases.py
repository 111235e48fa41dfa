"""The price list of a scene: what each setting, and each other way to make a pair, costs and how good its target is.

Here are the cases, what is kept of each, which of them no other beats, and the files and the table that say so.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..pipeline.stages import Stage, in_order
from ..settings.accuracy import SETTINGS, Accuracy
from ..settings.frame import ACCURACIES, StereoSettings

TRADEOFF_SCHEMA = 1

# As for a rendered pair, the one that vouches for the others comes last.
TRADEOFF_FILES = ("tradeoff.csv", "tradeoff.svg", "tradeoff.png", "stages.svg", "stages.png", "tradeoff.json")

HEURISTIC = "heuristic"
"""Kind of the case whose mask is guessed from the light passes."""

MULTIVIEW = "multiview"
"""Name, and kind, of Blender's own way among the cases."""

NOISE_RATIO_STEP = 0.005
"""Least difference in noise ratio that counts: what is less is the noise of the measure itself."""

MEASURED = (
    "speedup",
    "noise_ratio",
    "bias",
    "honest_ratio",
    "worst_tiles",
    "wrong_tiles",
    "rmse",
    "excess",
    "traced",
)
"""Keys of a row that are columns of the CSV file by the same names."""

HONEST_INTERVAL = ("honest_ratio", "honest_low", "honest_high")
"""Keys of the estimate's honest ratio and of the ends of its interval."""

TRACES_PER_PROBE = 2
"""Traces of the pixel of a probe."""


@dataclass(frozen=True)
class TradeoffCase:
    """One way to make the pair, to be measured against others. `name` is what users know it by.

    kind is "setting" for the settings of --accuracy, else the name of the other way, which also chooses its mark in the
    chart. accuracy has its thresholds; accuracy_name is the user's setting with these, None if there is none. fill is
    its fill method.
    """

    name: str
    kind: str
    accuracy: Accuracy
    accuracy_name: str | None = None
    fill: str = "auto"

    def settings(self, asked: StereoSettings) -> StereoSettings:
        """Return the settings to render this case: `asked` with accuracy, tolerance, fill and comparison replaced by
        the case's own."""
        accuracy = self.accuracy_name or StereoSettings.accuracy
        return replace(asked, accuracy=accuracy, tolerance=None, fill=self.fill, compare=False)


def tradeoff_cases() -> tuple[TradeoffCase, ...]:
    """Return all cases of a price list, in the order of its rows."""
    balanced = SETTINGS["balanced"]
    unpromised = replace(balanced, promise=None)
    return (
        *(TradeoffCase(name, "setting", SETTINGS[name], name) for name in ACCURACIES),
        # As the paper has it: what the source has not seen, and nothing else.
        TradeoffCase("holes alone", "paper", replace(unpromised, silhouette_radius=0)),
        TradeoffCase("heuristic mask", HEURISTIC, unpromised),
        TradeoffCase("card", "card", balanced, "balanced", fill="card"),
        TradeoffCase("full", "full", unpromised, fill="full"),
    )


def chosen_cases(only: Sequence[str] = ()) -> tuple[TradeoffCase, ...]:
    """Return the cases with the names in `only`, in the order of `tradeoff_cases`; all cases where it is empty."""
    return tuple(case for case in tradeoff_cases() if not only or case.name in only)


@dataclass(frozen=True)
class Row:
    """The measurements of one case, as a row of the price list; name, kind and accuracy (its name) are the case's.

    seconds are by stage, speedup is over Blender's multiview. rmse, noise_ratio, bias, honest_ratio, worst_tiles and
    wrong_tiles are as in `metrics`; the ratios are infinite where there is no noise. traced is the share of the
    target's pixels that was traced, fractions are shares by reason. fill and refine_fill are the methods of the fill
    and of refinement (None without one). estimate has what the probes estimated: "noise_ratio", "low", "high", the same
    with "honest_", and "promise", which is of the honest ratio; None without probes.
    """

    name: str
    kind: str
    accuracy: str | None
    seconds: Mapping[str, float]
    speedup: float
    rmse: float
    noise_ratio: float
    bias: float
    honest_ratio: float
    worst_tiles: float
    wrong_tiles: float
    traced: float
    fill: str
    refine_fill: str | None = None
    fractions: Mapping[str, float] | None = None
    estimate: Mapping[str, float | None] | None = None

    @property
    def total(self) -> float:
        """The seconds of all stages together."""
        return sum(self.seconds.values())

    @property
    def excess(self) -> float:
        """The squared error beyond noise as a share of noise: the noise ratio squared less 1."""
        return self.noise_ratio**2 - 1.0


def split_probes(seconds: Mapping[str, float], holes: int, probes: int) -> dict[str, float]:
    """Return the seconds by stage with a stage for the probes: the seconds of the fill are divided in proportion to the
    traces of each. `holes` and `probes` are numbers of pixels; a probe is traced TRACES_PER_PROBE times."""
    result = dict(seconds)
    if probes > 0:
        traced = TRACES_PER_PROBE * probes
        result[Stage.PROBES] = result[Stage.FILL] * traced / (holes + traced)
        result[Stage.FILL] -= result[Stage.PROBES]
    return {name: result[name] for name in in_order(result)}


def pareto_front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Return for each point (seconds, error) True if its error is finite and no other point beats it.

    A faster point beats it if that one's error is not greater by more than NOISE_RATIO_STEP; a point with equal seconds
    beats it if its error is less.
    """

    def beaten(seconds: float, error: float) -> bool:
        return any((s < seconds and e <= error + NOISE_RATIO_STEP) or (s == seconds and e < error) for s, e in points)

    return [math.isfinite(error) and not beaten(seconds, error) for seconds, error in points]


def price_list(
    facts: Mapping[str, Any], multiview: Mapping[str, float], rows: Sequence[Row], left_out: Sequence[tuple[str, str]]
) -> dict[str, Any]:
    """Return the content of tradeoff.json: `facts` about the scene, multiview, a row for each case with its place on
    the Pareto front, and the cases that were left out.

    multiview has the "seconds" and the "noise_rmse" of Blender's multiview. It is compared with the cases too, with a
    noise ratio and an honest ratio of 1 by definition. left_out are pairs of a case's name and the reason.
    """
    front = pareto_front([*((row.total, row.noise_ratio) for row in rows), (multiview["seconds"], 1.0)])
    return {
        **facts,
        "schema": TRADEOFF_SCHEMA,
        "peer": {**multiview, "noise_ratio": 1.0, "honest_ratio": 1.0, "speedup": 1.0, "pareto": front[-1]},
        "rows": [_entry(row, on_front) for row, on_front in zip(rows, front[:-1], strict=True)],
        "left_out": [{"name": name, "reason": reason} for name, reason in left_out],
    }


def _entry(row: Row, on_front: bool) -> dict[str, Any]:
    """Return one row of the price list as a dict for JSON. on_front is True if no other case is better, see
    `pareto_front`."""
    return {
        "name": row.name,
        "kind": row.kind,
        "accuracy": row.accuracy,
        "fill": row.fill,
        "refine_fill": row.refine_fill,
        "seconds": {**row.seconds, "total": row.total},
        "speedup": row.speedup,
        "noise_ratio": _known(row.noise_ratio),
        "bias": _known(row.bias),
        "honest_ratio": _known(row.honest_ratio),
        "worst_tiles": _known(row.worst_tiles),
        "wrong_tiles": row.wrong_tiles,
        "rmse": row.rmse,
        "excess": _known(row.excess),
        "traced": row.traced,
        "fractions": row.fractions,
        "estimate": row.estimate,
        "pareto": on_front,
    }


def _known(value: float | None) -> float | None:
    """Return a value if it is a finite number, else None."""
    return value if value is not None and math.isfinite(value) else None


def write_csv(path: Path, prices: Mapping[str, Any]) -> None:
    """Write a price list as a CSV file: a line for each row, and a last one for multiview. Cells of what a case does
    not have are empty. Raises OSError."""
    stages = in_order(name for row in prices["rows"] for name in row["seconds"] if name != "total")
    multiview = {"name": MULTIVIEW, "kind": MULTIVIEW, "traced": 1.0, **prices["peer"]}
    lines = [_flat(row, stages) for row in (*prices["rows"], {**multiview, "seconds": {"total": multiview["seconds"]}})]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(lines[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)


def _flat(row: Mapping[str, Any], stages: Sequence[str]) -> dict[str, Any]:
    """Return the cells of one line of the CSV file, by column; `stages` are the stages that have a column."""
    estimate = row.get("estimate") or {}
    return {
        **{name: row.get(name) for name in ("name", "kind", "accuracy", "fill", "refine_fill")},
        "seconds": row["seconds"]["total"],
        **{f"{name}_seconds": row["seconds"].get(name) for name in stages},
        **{name: row.get(name) for name in MEASURED},
        "estimate": estimate.get("noise_ratio"),
        **{f"estimate_{end}": _known(estimate.get(end)) for end in ("low", "high", *HONEST_INTERVAL)},
        "promise": estimate.get("promise"),
        "pareto": str(row["pareto"]).lower(),
    }


def headline(prices: Mapping[str, Any]) -> str:
    """Return one line that says what was rendered: scene, frame, size and samples."""
    size = "x".join(map(str, prices["size"]))
    return f"{prices['scene']}, frame {prices['frame']}, {size}, {prices['samples']} samples"


def format_price_table(prices: Mapping[str, Any]) -> str:
    """Return a price list as a table for people. It is plain ASCII but for the scene's name."""
    lines = [
        f"{headline(prices)}: error against time",
        (
            f"  {'run':<16}{'seconds':>9}{'speed-up':>10}{'honest ratio':>14}{'noise ratio':>13}{'worst tiles':>13}"
            f"{'traced':>9}   fill"
        ),
    ]
    for row in prices["rows"]:
        ratios = f"{_text(row['honest_ratio'], '14.3f')}{_text(row['noise_ratio'], '13.3f')}"
        figures = f"{ratios}{_text(row['worst_tiles'], '13.2f')}{row['traced']:>9.1%}"
        fill = row["fill"] if row["refine_fill"] in (None, row["fill"]) else f"{row['fill']}, then {row['refine_fill']}"
        lines.append(_line(row["name"], row["seconds"]["total"], row["speedup"], f"{figures}   {fill}", row["pareto"]))
    peer = prices["peer"]
    lines.append(
        _line(
            MULTIVIEW, peer["seconds"], 1.0, f"{1.0:14.3f}{1.0:13.3f}{'':13}{1.0:>9.1%}   Blender's own", peer["pareto"]
        )
    )
    lines.append(
        f"* no other is as fast and, to within {NOISE_RATIO_STEP:g}, as good; 1 = as good as rendering it again"
    )
    return "\n".join(lines)


def _line(name: str, seconds: float, speedup: float, rest: str, on_front: bool) -> str:
    """Return one line of the table: a star if the case is on the Pareto front, its name, seconds and speed-up, and
    `rest`."""
    return f"{'* ' if on_front else '  '}{name:<16}{seconds:9.2f}{speedup:10.2f}{rest}"


def _text(value: float | None, pattern: str) -> str:
    """Return a value formatted by `pattern`, such as "13.3f"; for None, "n/a" in the same width."""
    return format(value, pattern) if value is not None else f"{'n/a':>{pattern.partition('.')[0]}}"
