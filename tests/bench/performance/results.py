"""What the runs come to: a row for each scene, size and method, one for each frame of the path, and the exponents."""

from __future__ import annotations

import csv
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from stereo_reproject.pipeline.stages import OUTSIDE_TOTAL, in_order
from tests.bench.performance.fits import fitted
from tests.bench.performance.keeping import DONE, Record
from tests.bench.performance.plan import (
    HOLES,
    METHODS,
    MULTIVIEW,
    PATH,
    PIXELS,
    SAMPLES,
    SCENES,
    SERIES,
    STAGE,
    TRIANGLES,
    Case,
    Picture,
    Run,
)

RESULTS_SCHEMA = 3

Row = dict[str, Any]

TOTAL = "total"

STAGE_FIGURES = (
    "device",
    "seconds",
    "map_seconds",
    "profile",
    "lookup_ratio",
    "peak_bytes_per_pixel",
    "agreement",
    "holes",
    "subdivided",
)


def analysed(cases: Sequence[Case], records: Mapping[Run, Record]) -> dict[str, Any]:
    """All that the runs tell, as results.json has it beside the facts of the machine."""
    stage, path = stage_rows(cases, records), path_rows(cases, records)
    return {
        "schema": RESULTS_SCHEMA,
        "stage": stage,
        "grid": grid_rows(stage),
        "scenes": scene_rows(cases, records),
        "path": path,
        "path_totals": path_totals(path),
        "scaling": scaling_rows(cases, records),
        "runs": [run_row(case, records[case.run]) for case in cases],
    }


def run_row(case: Case, record: Record) -> Row:
    """One run as it was; what it does not have is None."""
    run, report = case.run, record.get("report") or {}
    return {
        "part": case.part,
        "scene": run.scene.name,
        "method": run.method,
        "size": list(run.size),
        "samples": run.samples,
        "frame": run.frame,
        "interocular": run.scene.interocular,
        "scene_triangles": run.scene.triangles,
        "turn": run.turn,
        "status": record["status"],
        "message": record.get("message"),
        "blender": report.get("blender"),
        "seconds": _seconds(report),
        "fractions": report.get("fractions"),
        "grid": report.get("grid"),
        "pair_peak_mb": (report.get("memory") or {}).get("peak_mb"),
        "process_peak_mb": record.get("process_peak_mb"),
        "wall_seconds": record.get("wall_seconds"),
    }


def _seconds(report: Mapping[str, Any]) -> dict[str, float] | None:
    """By stage, with the total; None without any."""
    return dict(report["seconds"]) if report.get("seconds") else None


def stage_rows(cases: Sequence[Case], records: Mapping[Run, Record]) -> list[Row]:
    """A row for each picture, size and carrier of the warp stage alone, with its time per pixel over that of the
    picture's first size that could be measured."""
    rows = []
    first: dict[tuple[Picture, str], float] = {}
    for run in (case.run for case in cases if case.part == STAGE):
        record, row = records[run], {**asdict(run.picture), "size": list(run.size), "method": run.method}
        if record["status"] != DONE:
            rows.append({**row, "message": _why_none([record])})
            continue
        found = record["report"]["stage"]
        per_pixel = found["seconds"] / (run.size[0] * run.size[1])
        figures = {name: found[name] for name in STAGE_FIGURES}
        growth = per_pixel / first.setdefault((run.picture, run.method), per_pixel)
        rows.append({**row, "message": None, **figures, "growth": growth})
    return rows


def grid_rows(stage: Sequence[Row]) -> list[Row]:
    """What the adaptive grid gains over a native one of the same picture, by numpy: of the map, which is grid, forward
    warp and depth test, and of the whole stage."""
    done = [row for row in stage if row["message"] is None and row["map_seconds"] is not None]
    natives = {_picture(row): row for row in done if row["grid_threshold"] == 0.0}
    rows = []
    for row in (row for row in done if row["grid_threshold"] > 0.0 and _picture(row) in natives):
        native = natives[_picture(row)]
        rows.append(
            {
                **{name: row[name] for name in ("scene", "mode", "size", "grid_threshold", "subdivided")},
                **{name: row[name] for name in ("map_seconds", "seconds")},
                "native_map_seconds": native["map_seconds"],
                "native_seconds": native["seconds"],
                "native_subdivided": native["subdivided"],
                "map_speedup": native["map_seconds"] / row["map_seconds"],
                "stage_speedup": native["seconds"] / row["seconds"],
            }
        )
    return rows


def _picture(row: Row) -> tuple[object, ...]:
    return row["scene"], row["mode"], *row["size"]


def scene_rows(cases: Sequence[Case], records: Mapping[Run, Record]) -> list[Row]:
    """A row for each scene, size and method, in the order of the paper's table 2: medians over the repeats."""
    rows = []
    runs = [case.run for case in cases if case.part == SCENES]
    for scene, size in dict.fromkeys((run.scene.name, run.size) for run in runs):
        own = [run for run in runs if (run.scene.name, run.size) == (scene, size)]
        ours = [_median_row(method, [run for run in own if run.method == method], records) for method in METHODS]
        peer = _peer_row([records[run] for run in own if run.method == MULTIVIEW])
        samples = own[0].samples
        rows += [{"scene": scene, "size": list(size), "samples": samples, **row} for row in (peer, *ours)]
    return rows


def _median_row(method: str, runs: Sequence[Run], records: Mapping[Run, Record]) -> Row:
    """Speed-ups are those of each repeat, over multiview's run in the same repeat."""
    done = [run for run in runs if records[run]["status"] == DONE]
    if not done:
        return {"method": method, "message": _why_none(records[run] for run in runs)}
    reports = [records[run]["report"] for run in done]
    names = in_order(name for report in reports for name in report["seconds"])
    fractions = [report["fractions"] for report in reports]
    compared = [(_total(records[run]), _total(records[run.peer])) for run in done]
    return {
        "method": method,
        "message": None,
        "turns": len(reports),
        "seconds": {name: _median(report["seconds"].get(name) for report in reports) for name in names},
        "multiview_seconds": _median(peer for _, peer in compared),
        "speedup": _median(None if ours is None or peer is None else peer / ours for ours, peer in compared),
        "holes": _median(part["disoccluded"] + part["outside"] for part in fractions),
        "traced": _median(part["rerendered"] for part in fractions),
        "peak_mb": _median(report["memory"]["peak_mb"] for report in reports),
    }


def _peer_row(records: Sequence[Record]) -> Row:
    """Of the runs of multiview of one scene at one size."""
    reports = [record["report"] for record in records if record["status"] == DONE]
    if not reports:
        return {"method": MULTIVIEW, "message": _why_none(records)}
    total = _median(report["seconds"]["total"] for report in reports)
    return {
        "method": MULTIVIEW,
        "message": None,
        "turns": len(reports),
        "seconds": {"total": total},
        "multiview_seconds": total,
        "speedup": 1.0,
        "holes": None,
        "traced": 1.0,
        "peak_mb": _median(report["memory"]["peak_mb"] for report in reports),
    }


def _total(record: Record) -> float | None:
    return record["report"]["seconds"]["total"] if record["status"] == DONE else None


def _why_none(records: Iterable[Record]) -> str:
    told = [f"{record['status']}: {record['message']}" for record in records if record["status"] != DONE]
    return told[0] if told else "not measured"


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.median(known) if known else None


def path_rows(cases: Sequence[Case], records: Mapping[Run, Record]) -> list[Row]:
    """A row for each size, frame and method of the camera path: medians over the repeats, and the samples."""
    runs = [case.run for case in cases if case.part == PATH]
    rows = []
    for size, frame, method in dict.fromkeys((run.size, run.frame, run.method) for run in runs):
        if method == MULTIVIEW:
            continue
        own = [run for run in runs if (run.size, run.frame, run.method) == (size, frame, method)]
        row = {"scene": own[0].scene.name, "size": list(size), "samples": own[0].samples, "frame": frame}
        rows.append({**row, **_median_row(method, own, records)})
    return rows


def path_totals(path: Sequence[Row]) -> list[Row]:
    """A row for each size and method: means over the frames that are known, and the speed-up of all that have one."""
    rows = []
    for size, method in dict.fromkeys((tuple(row["size"]), row["method"]) for row in path):
        own = [row for row in path if (tuple(row["size"]), row["method"]) == (size, method)]
        done = [row for row in own if row["message"] is None]
        compared = [row for row in done if row["speedup"] is not None]
        # Beside multiview's, of the same frames.
        seconds = [row["seconds"]["total"] for row in compared or done]
        ours, peers = (
            sum(row["seconds"]["total"] for row in compared),
            sum(row["multiview_seconds"] for row in compared),
        )
        speedups = [row["speedup"] for row in compared]
        rows.append(
            {
                "size": list(size),
                "method": method,
                "frames": len(done),
                "failed": len(own) - len(done),
                "seconds": _mean(seconds),
                "multiview_seconds": _mean([row["multiview_seconds"] for row in compared]),
                "speedup": peers / ours if compared else None,
                "speedups": [min(speedups), max(speedups)] if compared else None,
                "holes": _mean([row["holes"] for row in done]),
                "traced": _mean([row["traced"] for row in done]),
                "peak_mb": max((row["peak_mb"] for row in done if row["peak_mb"] is not None), default=None),
            }
        )
    return rows


def _mean(values: Sequence[float]) -> float | None:
    return statistics.fmean(values) if values else None


def scaling_rows(cases: Sequence[Case], records: Mapping[Run, Record]) -> list[Row]:
    """How the seconds of each stage that is in all runs of a series grow with what is varied: the points, and what is
    fitted to them."""
    rows = []
    for series in SERIES:
        for method in METHODS:
            runs = [case.run for case in cases if case.part == series and case.run.method == method]
            done = [(run, records[run]["report"]) for run in runs if records[run]["status"] == DONE]
            if not runs:
                continue
            missing = [f"{run.title}: {records[run]['message']}" for run in runs if records[run]["status"] != DONE]
            fitted_stages, others = _stages_of([report["seconds"] for _, report in done])
            stages = [_stage_row(stage, [(_varied(series, *one), one[1]) for one in done]) for stage in fitted_stages]
            row = {"series": series, "method": method, "stages": stages, "missing": missing}
            rows.append({**row, "not_in_all": others})
    return rows


def _stages_of(reports: Sequence[Mapping[str, float]]) -> tuple[list[str], list[str]]:
    """Those that are in every report, and those that are in some; the total is the last."""
    names = in_order(name for report in reports for name in report if name not in (*OUTSIDE_TOTAL, TOTAL))
    in_all = [name for name in names if all(name in report for report in reports)]
    return [*in_all, TOTAL], [name for name in names if name not in in_all]


def _varied(series: str, run: Run, report: Mapping[str, Any]) -> float:
    """What is varied in a series: its value in this run."""
    return {
        PIXELS: float(run.size[0] * run.size[1]),
        SAMPLES: float(run.samples),
        TRIANGLES: float(run.scene.triangles or 0),
        HOLES: float(report["fractions"]["rerendered"]),
    }[series]


def _stage_row(stage: str, measured: Sequence[tuple[float, Mapping[str, Any]]]) -> Row:
    points = [[x, report["seconds"][stage]] for x, report in measured]
    fit = fitted(*zip(*points, strict=True)) if points else None
    return {"stage": stage, "points": points, "fit": None if fit is None else asdict(fit)}


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """The runs, a line each; what a run does not have is left empty."""
    stages = in_order(name for row in rows for name in row["seconds"] or () if name not in OUTSIDE_TOTAL)
    lines = [_flat(row, stages) for row in rows]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(lines[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)


def _flat(row: Row, stages: Sequence[str]) -> Row:
    fractions, seconds, grid = row["fractions"] or {}, row["seconds"] or {}, row["grid"] or {}
    plain = {name: value for name, value in row.items() if name not in ("fractions", "seconds", "grid")}
    return {
        **plain,
        "size": "x".join(map(str, row["size"])),
        **{f"{name}_seconds": seconds.get(name) for name in stages},
        **{name: fractions.get(name) for name in ("disoccluded", "outside", "silhouette", "rerendered")},
        "grid_triangles": grid.get("triangles"),
    }
