"""The short table of a report on many views for people, made from the dict that report.json has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..pipeline.stages import in_order, label_of
from .table import is_number, number_text, samples_text

RENDERED, MADE = "rendered", "made"
"""Words of a report for the two ways in which a view came to be: it was rendered whole, or made from others."""

View = Mapping[str, Any]
"""A view's entry in the report: name, how (RENDERED or MADE), from (names of views), traced (share of its pixels, 0 to
1), honest_ratio (None without an estimate) and interval (its ends, None without)."""


def _header(report: Mapping[str, Any]) -> str:
    """Return the first line: the scene, and what was rendered; what the report lacks is left out."""
    parts = [str(report["scene"])] if "scene" in report else []
    parts += [f"frame {report['frame']}"] if "frame" in report else []
    size = report.get("size")
    parts.append(f"{len(report['views'])} views" + (f" of {'x'.join(map(str, size))}" if size else ""))
    parts += [samples_text(report)] if "samples" in report else []
    parts += [str(report["accuracy"])] if "accuracy" in report else []
    return ", ".join(parts)


def _seconds_lines(seconds: Mapping[str, float]) -> list[str]:
    """Return the lines about the seconds of each stage and in total."""
    lines = ["took              seconds"]
    lines += [
        f"  {label_of(name):<16}{seconds[name]:8.2f}" for name in in_order(name for name in seconds if name != "total")
    ]
    if "total" in seconds:
        lines.append(f"  {'total':<16}{seconds['total']:8.2f}   from the look at the scene to the finished views")
    return lines


def _plan_lines(plan: Sequence[Any]) -> list[str]:
    """Return the lines about which views were rendered whole, and why."""
    return [f"{'plan' if k == 0 else '':<14}{line}" for k, line in enumerate(plan)]


def _views_lines(views: Sequence[View]) -> list[str]:
    """Return the lines about how the views came to be, and about those of them that stand out."""
    made = [view for view in views if view["how"] == MADE]
    rendered = [str(view["name"]) for view in views if view["how"] == RENDERED]
    lines = [f"views         {len(rendered)} rendered, {len(made)} made from others"]
    if rendered:
        lines.append(f"  rendered    {', '.join(rendered)}")
    traced = [view for view in made if is_number(view["traced"])]
    if traced:
        mean = sum(view["traced"] for view in traced) / len(traced)
        ends = (min(traced, key=lambda view: view["traced"]), max(traced, key=lambda view: view["traced"]))
        least, most = (f"{100.0 * view['traced']:.1f} % ({view['name']})" for view in ends)
        between = f" in the mean, from {least} to {most}" if len(traced) > 1 else f", {traced[0]['name']}"
        lines.append(f"  traced      {100.0 * mean:.1f} % of a made view's pixels{between}")
    return [*lines, *_estimate_lines(made)]


def _estimate_lines(made: Sequence[View]) -> list[str]:
    """Return the line about the worst estimate of the views that were made from others; an empty list without any."""
    known = [view for view in made if is_number(view["honest_ratio"])]
    if not known:
        return ["estimate      none"] if made else []
    worst = max(known, key=lambda view: view["honest_ratio"])
    interval = worst.get("interval")
    ends = " ({} to {})".format(*(number_text(end, ".3f") for end in interval)) if interval else ""
    ratio = f"honest ratio {number_text(worst['honest_ratio'], '.3f')}{ends} in the worst view, {worst['name']}"
    sources = f", made from {' and '.join(map(str, worst['from']))}" if worst["from"] else ""
    unknown = len(made) - len(known)
    return [f"estimate      {ratio}{sources}{f'; {unknown} without an estimate' if unknown else ''}"]


def _noise_lines(report: Mapping[str, Any]) -> list[str]:
    """Return the lines about the noise of the mean of neighbouring views, and about what was traced anew; an empty list
    where neither is known."""
    neighbours, fresh, lines = report.get("neighbours"), report.get("fresh"), []
    if neighbours:
        ratio, worst = (number_text(neighbours.get(name), ".2f") for name in ("noise_ratio", "worst_noise_ratio"))
        names = neighbours.get("worst_views") or ["?"]
        lines.append(
            f"neighbours    noise of the mean of {neighbours.get('count')} neighbouring views: {ratio} x that of plain"
            f" ones, {worst} x in the worst, {names[0]} to {names[-1]}"
        )
    if fresh:
        took, predicted = (number_text(fresh.get(name), ".1f") for name in ("seconds", "predicted_seconds"))
        without = fresh.get("noise_ratio_without")
        instead = f"; without it {number_text(without, '.2f')} x" if is_number(without) else ""
        share = number_text(100.0 * fresh["share"], ".0f")
        lines.append(f"  fresh       {share} % of a made view traced anew: {took} s, predicted {predicted} s{instead}")
    return lines


def _gain_lines(report: Mapping[str, Any]) -> list[str]:
    """Return the lines about the gain over rendering each view: measured in a comparison, or else predicted. An empty
    list for a report with neither."""
    over, compare = f"x over {len(report['views'])} plain renders", report.get("compare")
    if compare:
        lines = [f"gained        {number_text(compare.get('speedup'), '.2f')} {over}, measured"]
        lines.append(
            f"  honest ratio {number_text(compare.get('honest_ratio'), '.3f')}    1 = as good as rendering it again"
        )
        if is_number(compare.get("flicker_ratio")):
            flicker = number_text(compare["flicker_ratio"], ".2f")
            lines.append(f"  flicker      {flicker} x that of plain renders, between neighbouring views")
        compared = compare.get("views")
        return [*lines, f"  compared     {', '.join(map(str, compared))}"] if isinstance(compared, list) else lines
    if report.get("predicted_speedup") is not None:
        speedup = number_text(report["predicted_speedup"], ".2f")
        return [f"gained        about {speedup} {over}, predicted (--compare measures it)"]
    return []


def format_views_table(report: Mapping[str, Any]) -> str:
    """Return a report's JSON on many views as a short table for people. It is plain ASCII but for texts that the report
    quotes."""
    lines = [
        _header(report),
        *_seconds_lines(report["seconds"]),
        *_plan_lines(report.get("plan") or ()),
        *_views_lines(report["views"]),
        *_noise_lines(report),
        *_gain_lines(report),
    ]
    return "\n".join(lines)
