"""The warp stage alone, as a person reads it: beside the paper, with and without coarse cells, and by step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tests.bench.performance import paper
from tests.bench.performance.cells import NONE, cell, milliseconds, share, size_text, table, times
from tests.bench.warp.profile import STEPS

Rows = Sequence[Mapping[str, Any]]

STAGE_READ_AS = (
    "*lookup ratio*: over SciPy's bare bilinear lookup of three channels, on one core; *growth*: time per pixel over "
    "that of the first size; *memory*: over the input, of what Python and numpy hold; *agreement*: of numpy and GPU, "
    "the share of pixels that are holes in one alone, and the largest difference of a colour. docs/performance.md has "
    "what is measured."
)

GRID_READ_AS = (
    "On a smooth scene: *native* has every cell subdivided, *adaptive* those that ask for it. *map*: grid, forward "
    "warp and depth test, by numpy; *stage*: all, with the lookup of the passes and the reasons to trace."
)

PROFILE_READ_AS = (
    "By numpy: what each step takes, and its share of all of them, by Python's profiler, whose own time is in it. "
    "*map*: forward warp and depth test; *steps*: in depth; *lookup*: of the passes; *holes*: where nothing has "
    "landed; *reasons*: silhouettes, and all else that is to be traced."
)


def stage_text(results: Mapping[str, Any]) -> str:
    """All that results.md says of the stage; nothing if it was not measured."""
    rows = results["stage"]
    if not rows:
        return ""
    parts = [f"## The warp stage alone\n\n{STAGE_READ_AS}\n\n{stage_table(rows)}"]
    if results["grid"]:
        parts.append(f"### The adaptive grid against a native one\n\n{GRID_READ_AS}\n\n{grid_table(results['grid'])}")
    if any(_profile(row) for row in rows):
        parts.append(f"### By step\n\n{PROFILE_READ_AS}\n\n{profile_table(rows)}")
    return "\n\n".join(parts)


def stage_table(rows: Rows) -> str:
    """A row for each picture, size and carrier, and the paper's own."""
    head = ["scene", "size", "by", "time", "lookup ratio", "growth", "memory", "agreement"]
    lines = []
    for row in rows:
        start = [_picture(row), size_text(row["size"])]
        if row["message"] is not None:
            lines.append([*start, row["method"], cell(row["message"]), *[NONE] * 4])
            continue
        agreement = row["agreement"]
        agrees = NONE if agreement["holes"] is None else f"{agreement['holes']:.4%}, {agreement['colour']:.2g}"
        by, ratio = f"{row['method']} ({cell(row['device'])})", f"{row['lookup_ratio']:.2f}"
        memory = f"{row['peak_bytes_per_pixel']:.1f} B/px"
        lines.append([*start, by, milliseconds(row["seconds"]), ratio, f"{row['growth']:.2f}", memory, agrees])
    for size, took in paper.WARP_SECONDS.items():
        lines.append([NONE, size, f"{paper.TITLE} ({paper.GPU})", milliseconds(took), *[NONE] * 4])
    return table(head, lines)


def grid_table(rows: Rows) -> str:
    """A row for each pair of a native grid and an adaptive one."""
    head = ["scene", "size", "threshold", "cells subdivided", "map, native", "map, adaptive", "map faster by"]
    head += ["stage, native", "stage, adaptive", "stage faster by"]
    return table(
        head,
        [
            [
                f"{row['scene']}, {row['mode']}",
                size_text(row["size"]),
                f"{row['grid_threshold']:g} arc minutes",
                f"{share(row['subdivided'])}, native {share(row['native_subdivided'])}",
                milliseconds(row["native_map_seconds"]),
                milliseconds(row["map_seconds"]),
                times(row["map_speedup"]),
                milliseconds(row["native_seconds"]),
                milliseconds(row["seconds"]),
                times(row["stage_speedup"]),
            ]
            for row in rows
        ],
    )


def profile_table(rows: Rows) -> str:
    """A row for each run by numpy, a column for each step."""
    lines = []
    for row in rows:
        profile = _profile(row)
        if profile:
            whole = sum(profile.values())
            told = [f"{milliseconds(profile[step])} ({profile[step] / whole:.0%})" for step in STEPS]
            lines.append([_picture(row), size_text(row["size"]), *told])
    return table(["scene", "size", *STEPS], lines)


def _profile(row: Mapping[str, Any]) -> Mapping[str, float] | None:
    return None if row["message"] is not None else row["profile"]


def _picture(row: Mapping[str, Any]) -> str:
    threshold = ", native" if row["grid_threshold"] == 0.0 else ""
    return f"{row['scene']}, {row['mode']}{threshold}"
