"""The results as a person reads them: tables in Markdown, in the form of the paper's table 2, and what was fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stereo_reproject.report import OUTSIDE_TOTAL
from stereo_reproject.tradeoff import stage_order
from tests.bench.performance import paper
from tests.bench.performance.plan import HOLES, MULTIVIEW, PIXELS, SAMPLES, TRIANGLES

NONE = "–"

VARIED = {
    PIXELS: "pixels",
    SAMPLES: "samples a pixel",
    TRIANGLES: "triangles (subdivided meshes)",
    HOLES: "traced share (eyes further apart)",
}

NEGLIGIBLE = 0.05
"""A constant below this share of the least time is not told."""


def as_markdown(results: Mapping[str, Any]) -> str:
    """The whole of results.md."""
    facts = results["facts"]
    parts = [
        "# Performance analysis",
        _facts_text(facts),
        f"## The warp stage alone\n\n{STAGE_READ_AS}\n\n{stage_table(results['stage'])}" if results["stage"] else "",
        f"## Scenes\n\n{READ_AS}\n\n{scenes_table(results['scenes'])}" if results["scenes"] else "",
        _paper_text(results["scenes"]) if results["scenes"] else "",
        f"## Camera path\n\n{path_table(results['path'])}" if results["path"] else "",
        f"## Growth\n\n{GROWTH}\n\n{scaling_table(results['scaling'])}" if results["scaling"] else "",
        _charts_text(results.get("charts") or ()),
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


READ_AS = (
    "*multiview* is what Blender's own way took, in a process of its own like all others; the speed-up is over the one "
    "of the same repeat. *holes*: disoccluded or outside the source's frame; *traced*: with silhouettes and all else "
    "that was not warped. Loading and writing are in no total."
)

STAGE_READ_AS = (
    "*lookup ratio*: over SciPy's bare bilinear lookup of three channels, on one core; *growth*: time per pixel over "
    "that of the first size; *memory*: over the input, of what Python and numpy hold; *agreement*: of numpy and GPU, "
    "the share of pixels that are holes in one alone, and the largest difference of a colour. docs/performance.md has "
    "what is measured."
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
    lines = [
        f"* Made by: `{facts['command']}`",
        f"* Machine: {machine['cpu']}, {machine['cores']} cores, {machine['system']}",
        f"* Versions: {versions}",
        f"* Runs: {runs['done']} done{failed}{left_out}; ended {facts['ended']}",
    ]
    if facts["quick"]:
        lines.append("* Quick: small pictures and few samples. It shows that all parts work; do not quote its seconds.")
    return "\n".join(lines)


def stage_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """A row for each size and carrier, and the paper's own."""
    head = ["size", "by", "time", "lookup ratio", "growth", "memory", "agreement"]
    lines = [_line(head), _line(["---"] * len(head))]
    for row in rows:
        size = "x".join(map(str, row["size"]))
        if row["message"] is not None:
            lines.append(_line([size, row["method"], _cell(row["message"]), *[NONE] * 4]))
            continue
        agreement = row["agreement"]
        agrees = NONE if agreement["holes"] is None else f"{agreement['holes']:.4%}, {agreement['colour']:.2g}"
        by = f"{row['method']} ({_cell(row['device'])})"
        cells = [by, _milliseconds(row["seconds"]), f"{row['lookup_ratio']:.2f}"]
        lines.append(_line([size, *cells, f"{row['growth']:.2f}", f"{row['peak_bytes_per_pixel']:.1f} B/px", agrees]))
    for size, seconds in paper.WARP_SECONDS.items():
        lines.append(_line([size, f"{paper.TITLE} ({paper.GPU})", _milliseconds(seconds), *[NONE] * 4]))
    return "\n".join(lines)


def scenes_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """A row for each scene, size and method. A run that failed says so in its cell."""
    stages = _stages(rows)
    head = ["scene", "size", "method", "total", "multiview", "speed-up", *stages, "holes", "traced", "memory peak"]
    lines = [_line(head), _line(["---"] * len(head))]
    for row in rows:
        start = [row["scene"], "x".join(map(str, row["size"])), _method(row["method"])]
        lines.append(_line([*start, *_figures(row, stages)]))
    return "\n".join(lines)


def path_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """A row for each frame and method of the camera path."""
    stages = _stages(rows)
    first = rows[0]
    size = "x".join(map(str, first["size"]))
    head = ["frame", "method", "total", "multiview", "speed-up", *stages, "holes", "traced", "memory peak"]
    lines = [f"{first['scene']}, {size}, {first['samples']} samples", "", _line(head), _line(["---"] * len(head))]
    for row in rows:
        lines.append(_line([str(row["frame"]), _method(row["method"]), *_figures(row, stages)]))
    return "\n".join(lines)


def _stages(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Those that take part in the total, of all rows."""
    names = stage_order(name for row in rows for name in row.get("seconds") or () if name != "total")
    return [name for name in names if name not in OUTSIDE_TOTAL and _any_seconds(rows, name)]


def _any_seconds(rows: Sequence[Mapping[str, Any]], stage: str) -> bool:
    return any(((row.get("seconds") or {}).get(stage) or 0.0) >= 0.0005 for row in rows)


def _figures(row: Mapping[str, Any], stages: Sequence[str]) -> list[str]:
    """The cells after the method: the total, multiview's, the speed-up, the stages', the shares and the memory."""
    if row["message"] is not None:
        return [_cell(row["message"]), *[NONE] * (len(stages) + 5)]
    seconds = row["seconds"]
    return [
        _seconds(seconds["total"]),
        _seconds(row["multiview_seconds"]),
        _times(row),
        *(_seconds(seconds.get(name)) for name in stages),
        _share(row["holes"]),
        _share(row["traced"]),
        NONE if row["peak_mb"] is None else f"{row['peak_mb']:.0f} MB",
    ]


def scaling_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """A row for each series, method and stage."""
    head = ["varied", "from", "to", "method", "stage", "exponent (95 %)", "constant", "off by", "points"]
    lines = [_line(head), _line(["---"] * len(head))]
    missing: list[str] = []
    for row in rows:
        missing += row["missing"]
        for stage in row["stages"]:
            xs = [x for x, _ in stage["points"]]
            ends = [f"{x:.3g}" if x < 1000 else f"{x:.0f}" for x in (min(xs), max(xs))] if xs else [NONE, NONE]
            start = [VARIED[row["series"]], *ends, row["method"], stage["stage"]]
            lines.append(_line([*start, *_fit_cells(stage)]))
    notes = [f"Not measured: {_cell(line)}" for line in dict.fromkeys(missing)]
    return "\n".join([*lines, *(["", *notes] if notes else [])])


def _fit_cells(stage: Mapping[str, Any]) -> list[str]:
    fit, points = stage["fit"], stage["points"]
    if fit is None:
        return [NONE, NONE, NONE, str(len(points))]
    interval = "" if fit["low"] is None else f" ({fit['low']:.2f} to {fit['high']:.2f})"
    least = min(y for _, y in points)
    constant = _seconds(fit["constant"]) if fit["constant"] > NEGLIGIBLE * least else NONE
    return [f"{fit['exponent']:.2f}{interval}", constant, f"{fit['spread'] - 1.0:.0%}", str(fit["points"])]


def _paper_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """The paper's own figures beside what was measured here."""
    lines = [
        "## Beside the paper",
        "",
        "| | speed-up | traced |",
        "|---|---|---|",
        f"| {paper.TITLE}, over two full renders | {paper.SPEEDUP[0]} to {paper.SPEEDUP[1]} | {paper.TRACED:.0%} |",
    ]
    for method in dict.fromkeys(row["method"] for row in rows if row["method"] != MULTIVIEW):
        own = [row for row in rows if row["method"] == method and row["message"] is None]
        speedups = [row["speedup"] for row in own if row["speedup"] is not None]
        if speedups:
            traced = _share(sum(row["traced"] for row in own) / len(own))
            ends = f"{min(speedups):.2f} to {max(speedups):.2f}"
            lines.append(f"| {_method(method)}, over multiview | {ends} | {traced} |")
    return "\n".join(lines)


def _charts_text(charts: Sequence[str]) -> str:
    return "## Charts\n\n" + "\n".join(f"![{name}]({name}.png)" for name in charts) if charts else ""


def _method(method: str) -> str:
    return f"{method} ({paper.COUNTERPARTS[method]})"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _cell(text: str) -> str:
    """A text that does not end the cell that it is in."""
    return " ".join(text.split()).replace("|", "\\|")


def _seconds(value: float | None) -> str:
    return NONE if value is None else f"{value:.3f} s" if value < 1.0 else f"{value:.2f} s"


def _milliseconds(seconds: float) -> str:
    return f"{1000.0 * seconds:.{2 if seconds < 0.1 else 0}f} ms"


def _times(row: Mapping[str, Any]) -> str:
    value = row["speedup"]
    return NONE if value is None else f"{value:.2f} ×"


def _share(value: float | None) -> str:
    return NONE if value is None else f"{value:.1%}"
