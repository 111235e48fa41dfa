"""The charts: where the time goes (the paper's figure 9), and times and traced shares along the path (its figure 8)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from stereo_reproject.pipeline.stages import OUTSIDE_TOTAL
from stereo_reproject.sequence.chart import draw_animation_chart
from stereo_reproject.tradeoff.charts import draw_stages_chart
from tests.bench.performance.paper import REPORTED
from tests.bench.performance.plan import MULTIVIEW

SEEN = 0.002
"""Share of the total from which a stage is drawn."""

EACH_ITS_OWN = "Each run rendered its own source eye in a process of its own; loading and writing are left out."


def draw_all(results: Mapping[str, Any], folder: Path) -> list[str]:
    """Write the charts of all that was measured, as SVG and PNG; the names of those files, without their endings."""
    names = []
    for scene, size in dict.fromkeys((row["scene"], tuple(row["size"])) for row in results["scenes"]):
        rows = [row for row in results["scenes"] if (row["scene"], tuple(row["size"])) == (scene, size)]
        prices = prices_of(rows, results["facts"]["blender"])
        if prices is not None:
            names.append(f"stages-{scene}-{size[0]}x{size[1]}")
            draw_stages_chart(prices, folder / names[-1])
    for size, method in dict.fromkeys((tuple(row["size"]), row["method"]) for row in results["path"]):
        rows = [row for row in results["path"] if (tuple(row["size"]), row["method"]) == (size, method)]
        report = animation_of(rows)
        if report["frames"]:
            names.append(f"path-{method}-{size[0]}x{size[1]}")
            draw_animation_chart(report, folder / names[-1])
    return names


def prices_of(rows: Sequence[Mapping[str, Any]], blender: str | None) -> dict[str, Any] | None:
    """The rows of one scene at one size as a price list has them; None where multiview or all others are missing."""
    done = [row for row in rows if row["message"] is None]
    peer = next((row for row in done if row["method"] == MULTIVIEW), None)
    ours = [{**row, "name": row["method"], "kind": row["method"], "seconds": _stages(row)} for row in done]
    ours = [row for row in ours if row["method"] != MULTIVIEW]
    if peer is None or not ours:
        return None
    return {
        "scene": peer["scene"],
        "size": peer["size"],
        "samples": peer["samples"],
        "blender": blender,
        "rows": ours,
        "peer": {"seconds": peer["seconds"]["total"]},
        "note": EACH_ITS_OWN,
        "reported": REPORTED,
    }


def _stages(row: Mapping[str, Any]) -> dict[str, float]:
    """Without those that are no part of the pair, or too short to be seen; and the total."""
    stages = {name: value for name, value in row["seconds"].items() if name not in (*OUTSIDE_TOTAL, "total")}
    return {name: value for name, value in stages.items() if value >= SEEN * sum(stages.values())} | {
        "total": row["seconds"]["total"]
    }


def animation_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The rows of the path of one size and method as animation.json has frames, with what the paper says."""
    done = [row for row in rows if row["message"] is None]
    frames = [_frame(row) for row in done]
    known = [row["multiview_seconds"] is not None for row in done]
    peer = sum(row["multiview_seconds"] or 0.0 for row in done)
    ours = sum(row["seconds"]["total"] for row, told in zip(done, known, strict=True) if told)
    totals = {"speedup": peer / ours, "speedup_from": "measured", "compared": sum(known)} if any(known) else {}
    failed = [row["frame"] for row in rows if row["message"] is not None]
    asked_for = [row["frame"] for row in rows]
    return {"frames": frames, "totals": totals, "failed": failed, "asked_for": asked_for, "reported": REPORTED}


def _frame(row: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "frame": row["frame"],
        "size": row["size"],
        "samples": row["samples"],
        "accuracy": f"{row['scene']}, {row['method']}",
        "seconds": row["seconds"],
        "wall_seconds": row["seconds"]["total"],
        "fractions": {"rerendered": row["traced"]},
        "compare": {"multiview_seconds": row["multiview_seconds"]},
    }
