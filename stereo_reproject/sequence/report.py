"""animation.json: the result of each frame of an animation, their totals, and the chart of both."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import BadInputError
from ..files import write_json
from ..report.verdict import reuse_in_animation
from ..settings.animation import AnimationSettings
from .figures import figures_of
from .fingerprints import Fingerprints, FrameState
from .journal import Journal

ANIMATION_SCHEMA = 1

FIGURES = {"wall_seconds", "beside_seconds", "multiview_seconds", "fractions"}
"""Figures that a record must have to be in the report."""


def report_path(journal: Journal) -> Path:
    """Return the path of animation.json: in the frames' folder, with the frames' name before it where they have one."""
    name = journal.name.lstrip("_-. ")
    between = "_" if name[-1:].isalnum() else ""
    return journal.frames_folder / f"{name}{between}animation.json"


def write_animation_report(
    journal: Journal,
    wanted: Fingerprints,
    options: AnimationSettings,
    failed: Mapping[int, str],
    warnings: Sequence[str],
) -> dict[str, Any]:
    """Write animation.json and, where matplotlib is installed, the chart. Return the report. Raises OSError.

    It covers all frames in the journal that have the scene and settings in `wanted`, whichever run rendered them.
    failed has frames with the reason why they failed. Records and figures that cannot be read are left out, and named
    among the report's warnings.
    """
    rows, odd = _rows(journal, wanted)
    report = {
        "schema": ANIMATION_SCHEMA,
        "asked_for": list(options.frames or ()),
        "frames": rows,
        "failed": {str(frame): why for frame, why in failed.items()},
        "totals": totals(rows),
        "compare": comparison(rows),
        "warnings": list(dict.fromkeys([*warnings, *odd, *(line for row in rows for line in row["warnings"])])),
    }
    path = report_path(journal)
    write_json(path, report, until_whole=journal.folder)
    if rows:
        _draw(report, path, until_whole=journal.folder)
    return report


def _rows(journal: Journal, wanted: Fingerprints) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the report's row for each frame in the journal that fits the fingerprints, and warnings about records that
    cannot be used."""
    rows, odd = [], []
    for record in journal.records.read_all():
        if wanted.state_of(record) is not FrameState.WHOLE:
            continue
        figures, strange = figures_of(record)
        if strange:
            what = f"the record of frame {record.frame} in {journal.folder} has figures that cannot be"
            odd.append(f"{what} ({', '.join(strange)}): they are left out of the report")
        if figures.keys() >= FIGURES:
            rows.append({"frame": record.frame, "files": sorted(record.files), "warnings": [], **figures})
    return rows, [*journal.records.new_doubts(), *odd]


def totals(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the totals of all frames, from the report's rows: among them the seconds, the seconds of Blender's
    multiview (of mono frames, of plain renders), and the speed-up over it.

    Multiview's seconds are predicted for each frame from the cost of its source eye. Where some frames were compared,
    all predictions are scaled by measured over predicted seconds of those frames. This is a ratio estimate: it does not
    matter if the compared frames happen to be cheap. "speedup_from" is "measured" then, else "predicted".
    "multiview_synced" is "anew" if multiview synced the whole scene again in a compared frame, else None. Without rows,
    means and the speed-up are None.
    """
    seconds = [row["wall_seconds"] for row in rows]
    compared = [row for row in rows if row.get("compare")]
    multiview = sum(row["multiview_seconds"] for row in rows)
    predicted = sum(row["multiview_seconds"] for row in compared)
    if predicted:
        multiview *= sum(row["compare"]["multiview_seconds"] for row in compared) / predicted
    return {
        "frames": len(rows),
        "seconds": sum(seconds),
        "seconds_per_frame": statistics.fmean(seconds) if rows else None,
        "beside_seconds_per_frame": statistics.median(row["beside_seconds"] for row in rows) if rows else None,
        "traced": statistics.fmean(row["fractions"]["rerendered"] for row in rows) if rows else None,
        "multiview_seconds": multiview,
        "speedup": multiview / sum(seconds) if rows else None,
        "speedup_from": "measured" if compared else "predicted",
        "compared": len(compared),
        "multiview_synced": "anew" if any(row["compare"].get("synced_anew") for row in compared) else None,
    }


def comparison(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    """Return how the compared frames among a report's rows compare with multiview, mono ones with plain renders; None
    where none was compared.

    speedup is that of the totals. honest_ratio and flip_ratio are those of the worst eye of all compared frames, None
    where nothing tells them. flicker is the mean square of the change of surfaces from frame to frame over that of
    plain renders, of the eye in which it is greater: None but between compared frames, one after the other, of which
    some may be made from others.
    """
    compared = [row["compare"] for row in rows if row.get("compare")]
    if not compared:
        return None
    eyes = [eye for each in compared for eye in (each, each.get("first_eye") or {})]

    def worst(name: str) -> float | None:
        return max((eye[name] for eye in eyes if eye.get(name) is not None), default=None)

    changes: dict[str, list[float]] = {}
    for each in compared:
        for eye, (ours, plain) in (each.get("flicker") or {}).items():
            total = changes.setdefault(eye, [0.0, 0.0])
            total[:] = total[0] + ours, total[1] + plain
    flicker = max((ours / plain for ours, plain in changes.values() if plain > 0.0), default=None)
    return {
        "frames": len(compared),
        "speedup": totals(rows)["speedup"],
        "honest_ratio": worst("honest_ratio"),
        "flip_ratio": worst("flip_ratio"),
        "flicker": flicker,
    }


def _draw(report: Mapping[str, Any], path: Path, *, until_whole: Path) -> None:
    """Draw the chart of an animation beside its report at `path`; do nothing where matplotlib is missing. Raises
    OSError."""
    from ..report.chart_canvas import check_charts
    from .chart import draw_animation_chart

    try:
        check_charts()
    except BadInputError:
        # Blender's own Python does not bring it: the figures are in the report all the same.
        return
    draw_animation_chart(report, path.with_suffix(""), until_whole=until_whole)


def views_in(rows: Sequence[Mapping[str, Any]]) -> int | None:
    """Return the number of views of each frame in a report's rows, 1 for mono ones; None where the frames are pairs."""
    views = rows[0].get("views") if rows else None
    return views if isinstance(views, int) else None


def plain_renders(views: int | None) -> str:
    """Return in words what frames of so many views, as `views_in` has it, are held against."""
    if views is None:
        return "Blender's multiview"
    return "plain renders" if views == 1 else f"{views} plain renders"


def _lines_of_views(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the lines of the summary that only frames of many views have."""
    lines = []
    rendered = [row["rendered_views"] for row in rows if isinstance(row.get("rendered_views"), int)]
    if rendered:
        least, most = min(rendered), max(rendered)
        count = f"{least}" if least == most else f"{least} to {most}"
        lines.append(f"rendered      {count} of {rows[0]['views']} views of a frame")
    known = [(row["honest_ratio"], row["frame"]) for row in rows if row.get("honest_ratio") is not None]
    if known:
        ratio, frame = max(known)
        lines.append(f"estimate      honest ratio {ratio:.3f} in the worst view of all, in frame {frame}")
    return lines


def format_animation(report: Mapping[str, Any]) -> str:
    """Return the summary of an animation for people, from the content of animation.json, in a few lines."""
    whole = report["totals"]
    if not whole["frames"]:
        return "no frames"
    ratios = [row["compare"]["noise_ratio"] for row in report["frames"] if row.get("compare")]
    known = [ratio for ratio in ratios if ratio is not None]
    each, beside = whole["seconds_per_frame"], whole["beside_seconds_per_frame"]
    how = whole["speedup_from"]
    if whole.get("multiview_synced") == "anew":
        how += "; it synced the scene anew for each compared frame"
    views = views_in(report["frames"])
    what = "the target eye, on average"
    if views is not None:
        whole_ones = "frames" if views == 1 else "views"
        of = "" if views == 1 else f" of {views} views"
        what = f"all pixels{of}, those of rendered {whole_ones} among them"
    lines = [
        f"frames        {whole['frames']}",
        f"per frame     {each:.2f} s, {beside:.2f} s not for rendering",
        f"traced        {100 * whole['traced']:.1f} % of {what}",
        f"speed-up      {whole['speedup']:.2f} x over {plain_renders(views)}, {how}",
    ]
    reused = reuse_in_animation(report["frames"])
    if reused is not None:
        lines.append(f"reuse         {reused.words}")
    if views is not None and views > 1:
        lines += _lines_of_views(report["frames"])
    compare, worst = report.get("compare") or {}, "eye" if views is None else "frame"
    for name, label in (("honest_ratio", "honest ratio "), ("flicker", "flicker      ")):
        if compare.get(name) is not None and views in (None, 1):
            over = ", of plain renders'" if name == "flicker" else f", of the worst {worst} compared"
            lines.append(f"{label} {compare[name]:.3f}{over}")
    if known:
        lines.append(f"noise ratio   {max(known):.3f} in the worst of {whole['compared']} compared frames")
    return "\n".join(lines)
