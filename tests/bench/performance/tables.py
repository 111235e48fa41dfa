"""The results as a person reads them: tables in Markdown, in the form of the paper's table 2, and what was fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stereo_reproject.pipeline.stages import OUTSIDE_TOTAL, in_order
from tests.bench.performance import paper
from tests.bench.performance.cells import NONE, cell, megabytes, seconds, share, size_text, table, times, times_between
from tests.bench.performance.plan import HOLES, MULTIVIEW, PIXELS, SAMPLES, TRIANGLES
from tests.bench.performance.stage_tables import stage_text

Rows = Sequence[Mapping[str, Any]]

SHARES = ["holes", "traced", "memory peak"]
PAPER_SHARES = [NONE, f"{paper.TRACED:.0%} on average", NONE]

VARIED = {
    PIXELS: "pixels",
    SAMPLES: "samples a pixel",
    TRIANGLES: "triangles (subdivided meshes)",
    HOLES: "traced share (eyes further apart)",
}

MEDIANS = "; medians are told, of a speed-up those of the ratios of each turn"

NEGLIGIBLE = 0.05
"""A constant below this share of the least time is not told."""


def as_markdown(results: Mapping[str, Any]) -> str:
    """The whole of results.md."""
    parts = [
        "# Performance analysis",
        _facts_text(results["facts"]),
        stage_text(results),
        f"## Scenes\n\n{READ_AS}\n\n{scenes_table(results['scenes'])}" if results["scenes"] else "",
        _path_text(results) if results["path"] else "",
        _paper_text(results) if results["scenes"] or results["path"] else "",
        f"## Growth\n\n{GROWTH}\n\n{scaling_table(results['scaling'])}" if results["scaling"] else "",
        _charts_text(results.get("charts") or ()),
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


READ_AS = (
    "*multiview* is what Blender's own way took, in a process of its own like all others; the speed-up is over the one "
    "of the same repeat. *holes*: disoccluded or outside the source's frame; *traced*: with silhouettes and all else "
    "that was not warped. Times are of a pair; those of the stages come to the total, and loading and writing are in "
    "none. *memory peak* is the process's until the pair is made."
)

PATH_READ_AS = (
    "Means over the frames, of which a larger size has fewer; the speed-up is that of all frames together, and *of the "
    "frames* the least and the greatest of a single one. *memory peak*: the most of any."
)

GROWTH = (
    "Seconds grow with the power that is given, of what is varied, with its 95 % interval; all else stays as it is. "
    "Where there is a constant, it is the part that does not grow. *off by*: what a point is off by, typically. "
    "Fitted by least squares in the logarithms."
)


def _facts_text(facts: Mapping[str, Any]) -> str:
    machine = facts["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in facts["versions"].items() if version)
    runs = facts["runs"]
    failed = f", {runs['failed']} failed" if runs["failed"] else ""
    left_out = f", {runs['left out']} were left out" if runs["left out"] else ""
    turns, medians = facts["turns"], MEDIANS if facts["turns"] > 1 else ""
    lines = [
        f"* Made by: `{facts['command']}`",
        f"* Machine: {machine['cpu']}, {machine['cores']} cores, {machine['system']}",
        f"* Versions: {versions}",
        f"* Commit: {facts['commit'] or 'not known'}",
        f"* Turns: {turns} of each run but those of the warp stage alone{medians}",
        f"* Runs: {runs['done']} done{failed}{left_out}; ended {facts['ended']}",
    ]
    if facts["quick"]:
        lines.append("* Quick: small pictures and few samples. It shows that all parts work; do not quote its seconds.")
    return "\n".join(lines)


def scenes_table(rows: Rows) -> str:
    """A row for each scene, size and method, and the paper's. A run that failed says so in its cell."""
    stages = _stages(rows)
    head = ["scene", "size", "samples", "method", "total", "multiview", "speed-up", *stages, *SHARES]
    lines = []
    for row in rows:
        start = [row["scene"], size_text(row["size"]), str(row["samples"]), _method(row["method"])]
        lines.append([*start, *_figures(row, stages)])
    theirs = [NONE, NONE, times_between(paper.SPEEDUP), *[NONE] * len(stages), *PAPER_SHARES]
    return table(head, [*lines, [paper.TITLE, NONE, NONE, paper.METHOD, *theirs]])


def _path_text(results: Mapping[str, Any]) -> str:
    """What the path comes to, and each of its frames."""
    first = results["path"][0]
    sizes = dict.fromkeys(tuple(row["size"]) for row in results["path"])
    parts = [f"## Camera path: {first['scene']}, {first['samples']} samples", PATH_READ_AS]
    parts.append(path_totals_table(results["path_totals"]))
    for size in sizes:
        rows = [row for row in results["path"] if tuple(row["size"]) == size]
        parts.append(f"### {size_text(size)}\n\n{path_table(rows)}")
    return "\n\n".join(parts)


def path_totals_table(rows: Rows) -> str:
    """A row for each size and method, and the paper's."""
    head = ["size", "method", "frames", "total", "multiview", "speed-up", "of the frames", *SHARES]
    lines = [
        [
            size_text(row["size"]),
            _method(row["method"]),
            f"{row['frames']}{', ' + str(row['failed']) + ' not measured' if row['failed'] else ''}",
            seconds(row["seconds"]),
            seconds(row["multiview_seconds"]),
            times(row["speedup"]),
            times_between(row["speedups"]),
            share(row["holes"]),
            share(row["traced"]),
            megabytes(row["peak_mb"]),
        ]
        for row in rows
    ]
    theirs = [paper.TITLE, paper.METHOD, NONE, NONE, NONE, times_between(paper.SPEEDUP), NONE, *PAPER_SHARES]
    return table(head, [*lines, theirs])


def path_table(rows: Rows) -> str:
    """A row for each frame and method of the camera path at one size."""
    stages = _stages(rows)
    head = ["frame", "method", "total", "multiview", "speed-up", *stages, *SHARES]
    return table(head, [[str(row["frame"]), _method(row["method"]), *_figures(row, stages)] for row in rows])


def _stages(rows: Rows) -> list[str]:
    """Those that take part in the total, of all rows."""
    names = in_order(name for row in rows for name in row.get("seconds") or () if name != "total")
    return [name for name in names if name not in OUTSIDE_TOTAL and _any_seconds(rows, name)]


def _any_seconds(rows: Rows, stage: str) -> bool:
    return any(((row.get("seconds") or {}).get(stage) or 0.0) >= 0.0005 for row in rows)


def _figures(row: Mapping[str, Any], stages: Sequence[str]) -> list[str]:
    """The cells after the method: the total, multiview's, the speed-up, the stages', the shares and the memory."""
    if row["message"] is not None:
        return [cell(row["message"]), *[NONE] * (len(stages) + 5)]
    took = row["seconds"]
    return [
        seconds(took["total"]),
        seconds(row["multiview_seconds"]),
        times(row["speedup"]),
        *(seconds(took.get(name)) for name in stages),
        share(row["holes"]),
        share(row["traced"]),
        megabytes(row["peak_mb"]),
    ]


def scaling_table(rows: Rows) -> str:
    """A row for each series, method and stage."""
    head = ["varied", "from", "to", "method", "stage", "exponent (95 %)", "constant", "off by", "points"]
    lines = []
    notes: list[str] = []
    for row in rows:
        notes += [f"Not measured: {cell(line)}" for line in row["missing"]]
        if row["not_in_all"]:
            where = f"{VARIED[row['series']]}, {row['method']}"
            notes.append(f"Not in every run, and not fitted: {', '.join(row['not_in_all'])} ({where})")
        for stage in row["stages"]:
            xs = [x for x, _ in stage["points"]]
            ends = [_varied(row["series"], x) for x in (min(xs), max(xs))] if xs else [NONE, NONE]
            start = [VARIED[row["series"]], *ends, row["method"], stage["stage"]]
            lines.append([*start, *_fit_cells(stage)])
    told = [f"* {note}" for note in dict.fromkeys(notes)]
    return "\n".join([table(head, lines), *(["", *told] if told else [])])


def _varied(series: str, x: float) -> str:
    if series == HOLES:
        return f"{x:.1%}"
    return f"{x:.3g}" if x < 1000 else f"{x:.0f}"


def _fit_cells(stage: Mapping[str, Any]) -> list[str]:
    fit, points = stage["fit"], stage["points"]
    if fit is None:
        return [NONE, NONE, NONE, str(len(points))]
    interval = "" if fit["low"] is None else f" ({fit['low']:.2f} to {fit['high']:.2f})"
    least = min(y for _, y in points)
    constant = seconds(fit["constant"]) if fit["constant"] > NEGLIGIBLE * least else NONE
    return [f"{fit['exponent']:.2f}{interval}", constant, f"{fit['spread'] - 1.0:.0%}", str(fit["points"])]


def _paper_text(results: Mapping[str, Any]) -> str:
    """The paper's own figures beside what was measured here."""
    rows = [*results["scenes"], *results["path"]]
    lines = [[f"{paper.TITLE}, over two full renders", times_between(paper.SPEEDUP), f"{paper.TRACED:.0%}"]]
    for method in dict.fromkeys(row["method"] for row in rows if row["method"] != MULTIVIEW):
        own = [row for row in rows if row["method"] == method and row["message"] is None]
        speedups = [row["speedup"] for row in own if row["speedup"] is not None]
        if speedups:
            traced = share(sum(row["traced"] for row in own) / len(own))
            lines.append([f"{_method(method)}, over multiview", times_between(speedups), traced])
    return f"## Beside the paper\n\n{paper.KNOWN}\n\n{table(['', 'speed-up', 'traced, on average'], lines)}"


def _charts_text(charts: Sequence[str]) -> str:
    return "## Charts\n\n" + "\n".join(f"![{name}](<{name}.png>)" for name in charts) if charts else ""


def _method(method: str) -> str:
    return f"{method} ({paper.COUNTERPARTS[method]})"
