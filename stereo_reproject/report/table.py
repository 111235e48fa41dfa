"""The short table of a report for people, made from the dict that report.json has."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

from ..pipeline.stages import OUTSIDE_TOTAL, in_order, label_of

COMPARED_KEYS = (
    "rmse",
    "noise_ratio",
    "bias",
    "honest_ratio",
    "worst_tiles",
    "wrong_tiles",
    "flip",
    "noise_flip",
    "flip_ratio",
)
"""Keys of the errors that a comparison measures. Reports of older versions lack some."""

HONEST_INTERVAL = ("honest_ratio", "honest_low", "honest_high")
"""Keys of the estimate's honest ratio and of the ends of its interval."""

LEAST_SHOWN_SECONDS = 0.05
"""Least seconds that a figure with one decimal shows."""


def is_number(value: Any) -> bool:
    """Return True for a number; True and False are none."""
    return isinstance(value, Real) and not isinstance(value, bool)


def number_text(value: Any, pattern: str) -> str:
    """Return a number formatted by `pattern`, or "n/a" for anything that is not a finite number."""
    return format(float(value), pattern) if is_number(value) and math.isfinite(value) else "n/a"


def _seconds_lines(report: Mapping[str, Any]) -> list[str]:
    """Return the lines about the seconds of each stage and in total."""
    seconds = report["seconds"]
    lines = ["took              seconds"]
    for name in in_order(name for name in seconds if name != "total"):
        note = "   not in the total" if name in OUTSIDE_TOTAL else ""
        lines.append(f"  {label_of(name):<16}{seconds[name]:8.2f}{note}")
    lines.append(f"  {'total':<16}{seconds['total']:8.2f}   from the look at the scene to the finished pair")
    return lines


def _traced_lines(report: Mapping[str, Any]) -> list[str]:
    """Return the lines about the share of the target's pixels that was traced, by reason."""
    fractions = report["fractions"]
    lines = ["traced        of the target eye's pixels (one pixel may have several reasons)"]
    for name, fraction in fractions.items():
        if name != "rerendered" and fraction > 0:
            lines.append(f"  {name:<16}{100 * fraction:6.2f} %")
    lines.append(f"  {'rerendered':<16}{100 * fractions['rerendered']:6.2f} %")
    return lines


def _estimate_lines(report: Mapping[str, Any]) -> list[str]:
    """Return the lines about the estimated quality and whether its promise is kept; an empty list for a report without
    that part."""
    estimate = report.get("estimate")
    if not estimate or estimate["noise_ratio"] is None:
        return [f"estimate      none: {estimate['from']}"] if estimate else []
    noise = f"noise ratio {_with_interval(estimate, 'noise_ratio', 'low', 'high')}"
    # A report of an older version has no honest ratio, and its promise was of the noise ratio.
    honest = estimate.get("honest_ratio")
    told = noise if honest is None else f"honest ratio {_with_interval(estimate, *HONEST_INTERVAL)}"
    promised = _promised(estimate["noise_ratio"] if honest is None else honest, estimate["promise"], estimate["kept"])
    lines = [f"estimate      {told}, from {estimate['from']}{promised}"]
    if honest is not None:
        lines.append(f"              bias {number_text(estimate['bias'], '.2f')} of a render's noise, {noise}")
    worst, limit = estimate["worst_tiles"], estimate["worst_tiles_promise"]
    if worst is not None and (worst > 1.0 or limit is not None):
        share = "" if honest is None else f", {number_text(100.0 * estimate['wrong_tiles'], '.1f')} % of all are wrong"
        figure = f"worst tiles {number_text(worst, '.2f')}{share}, see estimate.png"
        lines.append(f"              {figure}{_promised(worst, limit)}")
    return lines


def _with_interval(estimate: Mapping[str, Any], ratio: str, low: str, high: str) -> str:
    """Return a ratio of the estimate by its three keys, such as "1.020 (0.990 to 1.050)"; without an interval where
    that is not known."""
    if not is_number(estimate[low]) or not math.isfinite(estimate[low]):
        return number_text(estimate[ratio], ".3f")
    return "{} ({} to {})".format(*(number_text(estimate[name], ".3f") for name in (ratio, low, high)))


def _promised(value: float, promise: float | None, kept: bool | None = False) -> str:
    """Return the end of a line about `value`: the promise, and if it is kept; "" where nothing is promised. kept is
    None where the probes cannot tell; else the value decides."""
    if promise is None:
        return ""
    verdict = "too close to tell" if kept is None else "kept" if value <= promise else "not kept"
    return f"; at most {promise:g} promised: {verdict}"


def _correction_lines(report: Mapping[str, Any]) -> list[str]:
    """Return the line about the correction of traced pixels to EEVEE's light; an empty list where there was no
    correction."""
    correction = report.get("correction")
    if not correction:
        return []
    mean, p95 = (number_text(100.0 * correction[name], ".0f") for name in ("mean", "p95"))
    return [f"correction    traced pixels moved by {mean} % of the picture's brightness, 1 in 20 by {p95} % or more"]


def _effects_lines(report: Mapping[str, Any]) -> list[str]:
    """Return the lines about the effects for which pixels were traced; an empty list without any."""
    called_for = [row for row in report.get("effects") or () if row["called_for"] and row["fraction"] > 0.0]
    if not called_for:
        return []
    lines = ["effects       traced because of them"]
    return lines + [f"  {row['effect']:<20}{100 * row['fraction']:6.2f} %{row['seconds']:8.2f} s" for row in called_for]


def _layers_lines(report: Mapping[str, Any]) -> list[str]:
    """Return the lines about the view layers; an empty list where there is only one."""
    rows = report.get("layers") or ()
    if not rows:
        return []
    lines = [f"view layers   all times are of the {len(rows)} together, all else of the first"]
    for row in rows:
        ratio = "" if row["noise_ratio"] is None else f"   noise ratio {number_text(row['noise_ratio'], '.3f')}"
        figures = f"{100 * row['rerendered']:6.2f} %{row['seconds']:8.2f} s"
        lines.append(f"  {row['name']:<20}{figures}   {row['fill']}{ratio}")
    return lines


def _price_lines(report: Mapping[str, Any]) -> list[str]:
    """Return the line about the predicted cost of the next better accuracy; an empty list for a report without that
    part."""
    price = report.get("price")
    if not price:
        return []
    if price["more_seconds"] is None:
        return ["price         nothing better can be had: the target was rendered whole"]
    traced = f"{100 * price['traced']:.1f} % traced, predicted"
    return [f"price         {price['accuracy']}: {more_seconds_text(price)}, {traced}"]


def more_seconds_text(price: Mapping[str, Any]) -> str:
    """Return in words how many seconds more the next better accuracy would cost, such as "at least 1.5 s more". price
    is the "price" of a report's JSON."""
    more = price["more_seconds"]
    if more < LEAST_SHOWN_SECONDS:
        return "less than 0.1 s more" + ("" if price["complete"] else ", but for what its probes ask for")
    return f"{'' if price['complete'] else 'at least '}{number_text(more, '.1f')} s more"


def _error_lines(compare: Mapping[str, Any], why_none: str | None) -> list[str]:
    """Return the lines about the errors that a comparison measured. compare has the `COMPARED_KEYS`; why_none says why
    there is no noise to hold them against, None where there is."""
    figures = {
        name: number_text(value, ".4f" if name in ("flip", "noise_flip") else ".3f") for name, value in compare.items()
    }
    flip = f"  FLIP         {figures['flip']}   of noise alone {figures['noise_flip']}"
    if why_none:
        none, error = f"  honest ratio n/a      {why_none}", f"  error        {figures['rmse']}    root mean square"
        return [none, f"{error}, tone-mapped", flip]
    wrong = number_text(100.0 * compare["wrong_tiles"], ".1f") if is_number(compare["wrong_tiles"]) else "n/a"
    return [
        f"  honest ratio {figures['honest_ratio']}    1 = as good as rendering it again",
        f"  noise ratio  {figures['noise_ratio']}    bias {figures['bias']} of a render's noise",
        f"  worst tiles  {figures['worst_tiles']}    {wrong} % of all tiles are wrong",
        f"{flip}: {figures['flip_ratio']} times that",
    ]


def _cutout_lines(cutouts: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the lines about the errors in the cut-outs of a panorama; an empty list without any."""
    if not cutouts:
        return []
    lines = ["  as a headset shows it, 90 degrees wide:", "               honest   noise    FLIP over that of noise"]
    for row in cutouts:
        degrees = abs(row["left_degrees"] or row["up_degrees"])
        title = f"{row['name']} {degrees:g}" if degrees else row["name"]
        figures = "".join(f"{number_text(row[key], '.3f'):<9}" for key in ("honest_ratio", "noise_ratio", "flip_ratio"))
        lines.append(f"    {title:<11}{figures.rstrip()}")
    return lines


def _gain_lines(report: Mapping[str, Any]) -> list[str]:
    """Return the lines about the gain over Blender's multiview: speed-up and errors as they were measured in a
    comparison, or else only the predicted speed-up. An empty list for a report with neither."""
    multiview = "x over Blender's multiview"
    compare = report.get("compare")
    if compare:
        speedup, multiview_seconds = (
            number_text(compare["speedup"], ".2f"),
            number_text(compare["multiview_seconds"], ".2f"),
        )
        return [
            f"gained        {speedup} {multiview} ({multiview_seconds} s), measured",
            *_error_lines({name: compare.get(name) for name in COMPARED_KEYS}, compare.get("no_noise")),
            *_cutout_lines(compare.get("cutouts") or ()),
        ]
    if report.get("predicted_speedup") is not None:
        speedup = number_text(report["predicted_speedup"], ".2f")
        return [f"gained        about {speedup} {multiview}, predicted (--compare measures it)"]
    return []


def samples_text(report: Mapping[str, Any]) -> str:
    """Return the number of samples per pixel in words. With a time limit in the scene, it also says how many of them
    were rendered."""
    samples = report["samples"]
    if report.get("time_limit") is None:
        return f"{samples} samples"
    rendered = report["samples_rendered"]
    count = "an unknown number" if rendered is None else rendered
    return f"{count} of {samples} samples in {report['time_limit']:g} s"


def format_report_table(report: Mapping[str, Any]) -> str:
    """Return a report's JSON as a short table for people. It is plain ASCII but for texts that the report quotes."""
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
        lines.append(f"memory        {number_text(peak, '.0f')} MB at its peak")
    return "\n".join(lines)
