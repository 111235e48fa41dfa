"""report.json: what it must hold, and the short table that a person reads."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from numbers import Integral, Real
from typing import Any

from ..errors import StereoReprojectError
from ..pipeline.stages import OUTSIDE_TOTAL, in_order, label_of
from ..settings.frame import ACCURACIES, CUSTOM, FILL_METHODS, WARPS

REPORT_SCHEMA = 1

STAGES = ("load", "source", "warp", "fill", "composite", "write")
REASONS = ("disoccluded", "outside", "silhouette")
COMPARISONS = (
    "multiview_seconds",
    "speedup",
    "rmse",
    "noise_rmse",
    "noise_ratio",
    "worst_tiles",
    "flip",
    "noise_flip",
)

SHOWN_SECONDS = 0.05
"""Seconds that a figure with one decimal shows, at least."""

# A sum of a few float32 fractions may pass 1 by rounding.
FRACTION_SLACK = 1e-6


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)


def _is_count(value: Any) -> bool:
    return _is_whole(value) and value >= 0


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_amount(value: Any) -> bool:
    return _is_number(value) and math.isfinite(value) and value >= 0


def _is_fraction(value: Any) -> bool:
    return _is_amount(value) and value <= 1 + FRACTION_SLACK


def _is_size(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and len(value) == 2 and all(_is_count(side) and side for side in value)


_Rule = tuple[Callable[[Any], bool], str]
_TEXT: _Rule = (_is_text, "a text")
_COUNT: _Rule = (_is_count, "a whole number from 0")
_COUNT_OR_NULL: _Rule = (lambda value: value is None or _is_count(value), "a whole number from 0, or null")
_AMOUNT: _Rule = (_is_amount, "a finite number from 0")
_FRACTION: _Rule = (_is_fraction, "a fraction from 0 to 1")
# Without noise a ratio to it has no value: such a figure is kept as null, not left out.
_MEASURE: _Rule = (lambda value: value is None or _is_number(value), "a number or null")

_REQUIRED: dict[str, _Rule] = {
    "schema": (lambda value: _is_whole(value) and value == REPORT_SCHEMA, str(REPORT_SCHEMA)),
    "scene": _TEXT,
    "frame": (_is_whole, "a whole number"),
    "size": (_is_size, "[width, height] in pixels"),
    "samples": _COUNT,
    "blender": _TEXT,
    "accuracy": (lambda value: value in (*ACCURACIES, CUSTOM), f"one of {', '.join((*ACCURACIES, CUSTOM))}"),
    "fill.method": (lambda value: value in FILL_METHODS[1:], f"one of {', '.join(FILL_METHODS[1:])}"),
    "fill.reason": _TEXT,
    "grid.cells": _COUNT,
    "grid.subdivided": _COUNT,
    "grid.triangles": _COUNT,
    **{f"fractions.{name}": _FRACTION for name in (*REASONS, "rerendered")},
    **{f"seconds.{name}": _AMOUNT for name in (*STAGES, "total")},
    "memory.peak_mb": _MEASURE,
}
_FLAG: _Rule = (lambda value: isinstance(value, bool), "true or false")
_VERDICT: _Rule = (lambda value: value is None or isinstance(value, bool), "true, false or null")
_PARALLAX: _Rule = (
    lambda value: isinstance(value, Mapping) and set(value) == {"depth", "pixels", "percent"},
    "depth, pixels and percent",
)

_PARTS: dict[str, dict[str, _Rule]] = {
    "estimate": {
        **dict.fromkeys(("noise_ratio", "low", "high", "excess"), _MEASURE),
        **dict.fromkeys(("promise", "worst_tiles", "worst_tiles_promise"), _MEASURE),
        "kept": _VERDICT,
        "from": _TEXT,
    },
    "parallax": dict.fromkeys(("nearest", "farthest"), _PARALLAX),
    "correction": {"mean": _AMOUNT, "p95": _AMOUNT},
    "warp": {
        "asked": (lambda value: value in WARPS, f"one of {', '.join(WARPS)}"),
        "used": (lambda value: value in WARPS[1:], f"one of {', '.join(WARPS[1:])}"),
        "gpu": (lambda value: value is None or _is_text(value), "a text or null"),
    },
    "price": {"accuracy": _TEXT, "seconds": _AMOUNT, "more_seconds": _MEASURE, "traced": _FRACTION, "complete": _FLAG},
}
_EFFECT: dict[str, _Rule] = {
    "effect": _TEXT,
    "called_for": _FLAG,
    "handling": _TEXT,
    "fraction": _FRACTION,
    "seconds": _AMOUNT,
    "excess": _MEASURE,
}


_LAYER: dict[str, _Rule] = {
    "name": _TEXT,
    "rerendered": _FRACTION,
    "fill": _TEXT,
    "noise_ratio": _MEASURE,
    "seconds": _AMOUNT,
}


def _look_up(report: Mapping[str, Any], key: str) -> Any:
    value: Any = report
    for name in key.split("."):
        if not isinstance(value, Mapping) or name not in value:
            raise StereoReprojectError(f"the report has no {key}; this is a defect of stereo_reproject")
        value = value[name]
    return value


def _check(key: str, value: Any, rule: _Rule) -> None:
    accepts, wanted = rule
    if not accepts(value):
        raise StereoReprojectError(
            f"{key} in the report must be {wanted}, not {value!r}; this is a defect of stereo_reproject"
        )


def check_report(report: Mapping[str, Any]) -> None:
    """Raise StereoReprojectError naming the first key of `report` that is missing or has the wrong kind of value."""
    for key, rule in _REQUIRED.items():
        _check(key, _look_up(report, key), rule)
    for name, value in report["fractions"].items():
        _check(f"fractions.{name}", value, _FRACTION)
    for name, value in report["seconds"].items():
        _check(f"seconds.{name}", value, _AMOUNT)
    if report.get("compare") is not None:
        for name in COMPARISONS:
            _check(f"compare.{name}", _look_up(report, f"compare.{name}"), _MEASURE)
        _check("compare.no_noise", report["compare"].get("no_noise", ""), _TEXT)
    _check_parts(report)
    _check("predicted_speedup", report.get("predicted_speedup"), _MEASURE)
    if "time_limit" in report:
        _check("time_limit", report["time_limit"], _AMOUNT)
        _check("samples_rendered", report.get("samples_rendered"), _COUNT_OR_NULL)
    warnings = report.get("warnings", [])
    _check("warnings", warnings, (lambda value: isinstance(value, (list, tuple)), "a list of texts"))
    for warning in warnings:
        _check("warnings", warning, _TEXT)


def _check_parts(report: Mapping[str, Any]) -> None:
    """The same for what not every report has."""
    for part, keys in _PARTS.items():
        if report.get(part) is not None:
            for name, rule in keys.items():
                _check(f"{part}.{name}", _look_up(report, f"{part}.{name}"), rule)
    for row in report.get("effects", ()):
        for name, rule in _EFFECT.items():
            _check(f"effects.{name}", row.get(name), rule)
    for row in report.get("layers", ()):
        for name, rule in _LAYER.items():
            _check(f"layers.{name}", row.get(name), rule)


def _number(value: Any, pattern: str) -> str:
    return format(float(value), pattern) if _is_number(value) and math.isfinite(value) else "n/a"


def _seconds_lines(report: Mapping[str, Any]) -> list[str]:
    seconds = report["seconds"]
    lines = ["took              seconds"]
    for name in in_order(name for name in seconds if name != "total"):
        note = "   not in the total" if name in OUTSIDE_TOTAL else ""
        lines.append(f"  {label_of(name):<16}{seconds[name]:8.2f}{note}")
    lines.append(f"  {'total':<16}{seconds['total']:8.2f}   from the look at the scene to the finished pair")
    return lines


def _traced_lines(report: Mapping[str, Any]) -> list[str]:
    fractions = report["fractions"]
    lines = ["traced        of the target eye's pixels (one pixel may have several reasons)"]
    for name, fraction in fractions.items():
        if name != "rerendered" and fraction > 0:
            lines.append(f"  {name:<16}{100 * fraction:6.2f} %")
    lines.append(f"  {'rerendered':<16}{100 * fractions['rerendered']:6.2f} %")
    return lines


def _estimate_lines(report: Mapping[str, Any]) -> list[str]:
    estimate = report.get("estimate")
    if not estimate or estimate["noise_ratio"] is None:
        return [f"estimate      none: {estimate['from']}"] if estimate else []
    ratio, low, high = (_number(estimate[name], ".3f") for name in ("noise_ratio", "low", "high"))
    interval = f" ({low} to {high})" if _is_number(estimate["low"]) and math.isfinite(estimate["low"]) else ""
    told = f"estimate      noise ratio {ratio}{interval}, from {estimate['from']}"
    unsure = estimate["kept"] is None
    lines = [told + _promised(estimate["noise_ratio"], estimate["promise"], unsure=unsure)]
    worst, limit = estimate["worst_tiles"], estimate["worst_tiles_promise"]
    if worst is not None and (worst > 1.0 or limit is not None):
        lines.append(f"              worst tiles {_number(worst, '.2f')}, see estimate.png" + _promised(worst, limit))
    return lines


def _promised(value: float, promise: float | None, *, unsure: bool = False) -> str:
    if promise is None:
        return ""
    verdict = "too close to tell" if unsure else "kept" if value <= promise else "not kept"
    return f"; at most {promise:g} promised: {verdict}"


def _correction_lines(report: Mapping[str, Any]) -> list[str]:
    correction = report.get("correction")
    if not correction:
        return []
    mean, p95 = (_number(100.0 * correction[name], ".0f") for name in ("mean", "p95"))
    return [f"correction    traced pixels moved by {mean} % of the picture's brightness, 1 in 20 by {p95} % or more"]


def _effects_lines(report: Mapping[str, Any]) -> list[str]:
    called_for = [row for row in report.get("effects") or () if row["called_for"] and row["fraction"] > 0.0]
    if not called_for:
        return []
    lines = ["effects       traced because of them"]
    return lines + [f"  {row['effect']:<20}{100 * row['fraction']:6.2f} %{row['seconds']:8.2f} s" for row in called_for]


def _layers_lines(report: Mapping[str, Any]) -> list[str]:
    rows = report.get("layers") or ()
    if not rows:
        return []
    lines = [f"view layers   all times are of the {len(rows)} together, all else of the first"]
    for row in rows:
        ratio = "" if row["noise_ratio"] is None else f"   noise ratio {_number(row['noise_ratio'], '.3f')}"
        figures = f"{100 * row['rerendered']:6.2f} %{row['seconds']:8.2f} s"
        lines.append(f"  {row['name']:<20}{figures}   {row['fill']}{ratio}")
    return lines


def _price_lines(report: Mapping[str, Any]) -> list[str]:
    price = report.get("price")
    if not price:
        return []
    if price["more_seconds"] is None:
        return ["price         nothing better can be had: the target was rendered whole"]
    traced = f"{100 * price['traced']:.1f} % traced, predicted"
    return [f"price         {price['accuracy']}: {more_seconds_text(price)}, {traced}"]


def more_seconds_text(price: Mapping[str, Any]) -> str:
    """What the next better accuracy costs above this one, as a person reads it; `price.Price` as JSON has it."""
    more = price["more_seconds"]
    if more < SHOWN_SECONDS:
        return "less than 0.1 s more" + ("" if price["complete"] else ", but for what its probes ask for")
    return f"{'' if price['complete'] else 'at least '}{_number(more, '.1f')} s more"


def _gain_lines(report: Mapping[str, Any]) -> list[str]:
    peer = "x over Blender's multiview"
    compare = report.get("compare")
    if compare:
        figures = {name: _number(compare[name], ".4f" if "flip" in name else ".3f") for name in COMPARISONS}
        speedup, multiview_seconds = _number(compare["speedup"], ".2f"), _number(compare["multiview_seconds"], ".2f")
        why_none, error = compare.get("no_noise"), f"  error       {figures['rmse']}   root mean square, tone-mapped"
        return [
            f"gained        {speedup} {peer} ({multiview_seconds} s), measured",
            f"  noise ratio {figures['noise_ratio']}   {why_none or '1 = as good as rendering it again'}",
            error if why_none else f"  worst tiles {figures['worst_tiles']}",
            f"  FLIP        {figures['flip']}   of noise alone {figures['noise_flip']}",
        ]
    if report.get("predicted_speedup") is not None:
        speedup = _number(report["predicted_speedup"], ".2f")
        return [f"gained        about {speedup} {peer}, predicted (--compare measures it)"]
    return []


def samples_text(report: Mapping[str, Any]) -> str:
    """The samples of a pixel, as a person reads it: with a time limit, how many of them the source came to."""
    samples = report["samples"]
    if report.get("time_limit") is None:
        return f"{samples} samples"
    rendered = report["samples_rendered"]
    count = "an unknown number" if rendered is None else rendered
    return f"{count} of {samples} samples in {report['time_limit']:g} s"


def format_report_table(report: Mapping[str, Any]) -> str:
    """The short summary of a checked report, in lines of plain ASCII save for what the report itself quotes."""
    size = "x".join(map(str, report["size"]))
    peak = report["memory"]["peak_mb"]
    lines = [
        f"{report['scene']}, frame {report['frame']}, {size}, {samples_text(report)}, {report['accuracy']}",
        *_seconds_lines(report),
        *_layers_lines(report),
        *_traced_lines(report),
        f"fill          {report['fill']['method']}: {report['fill']['reason']}",
        *_correction_lines(report),
        *_effects_lines(report),
        *_estimate_lines(report),
        *_price_lines(report),
        *_gain_lines(report),
    ]
    if peak is not None:
        lines.append(f"memory        {_number(peak, '.0f')} MB at its peak")
    return "\n".join(lines)
