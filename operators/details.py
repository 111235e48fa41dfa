"""The sub-panel Details: ratios, intervals, seconds and shares of the last pair."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy

from ..stereo_reproject.images.reasons import Reason
from ..stereo_reproject.pipeline.next_accuracy import WHOLE
from ..stereo_reproject.pipeline.stages import OUTSIDE_TOTAL, Stage, label_of
from ..stereo_reproject.report.table import more_seconds_text
from ..stereo_reproject.report.verdict import accuracy_name, saved_seconds
from ..stereo_reproject.words import Words
from .drawing import draw_row, paragraph
from .explained import ESTIMATED, MEASURED, TIME, TRACED, draw_heading
from .results import has_preview, result_of

REASONS = {reason.label: reason.words for reason in Reason} | {"rerendered": "In all"}
"""Names, for artists, of the reasons why pixels of the second eye were rendered."""

STAGES: dict[str, str] = {
    Stage.PLAN: "Scene examined",
    Stage.SOURCE: "Rendered eye",
    Stage.DENOISE_SOURCE: "Denoising that eye",
    Stage.WARP: "Reprojecting",
    Stage.PILOT: "First spot checks",
    Stage.FILL: "Rendered again",
    Stage.REFINE: "Uncertain areas",
    Stage.DENOISE_TARGET: "Denoising the other eye",
}
"""Names, for artists, of the stages of a pair."""

ERROR, ERROR_AND_NOISE = "Error (1 = only noise)", "Error and noise"
"""Names, for artists, of the honest ratio and of the noise ratio."""

MEASURED_FIGURES = (
    (ERROR, "honest_ratio"),
    (ERROR_AND_NOISE, "noise_ratio"),
    ("Worst spots", "worst_tiles"),
    ("Mean difference", "rmse"),
)
"""Figures of a comparison that are shown: names for artists, and keys of the report."""

KEPT = {True: "kept", False: "not kept", None: "too close to tell"}


class Details:
    """Contents of the sub-panel, wherever it is; it is shown only when the scene has the report of a pair."""

    bl_label = "Details"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has the report of a pair."""
        return result_of(context.scene).report is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the figures of the last pair's quality, of its time, and of what was rendered again."""
        report = result_of(context.scene).report
        assert report is not None
        size = " x ".join(map(str, report["size"]))
        paragraph(self.layout, context, made_by(report, size))
        _draw_quality(self.layout, context, report)
        _draw_times(self.layout, context, report)
        _draw_traced(self.layout, report)


def made_by(report: Mapping[str, Any], size: str) -> Words:
    """Return words about how a pair was rendered, or checked; `report` is its report, size is as shown."""
    accuracy = Words(accuracy_name(report["accuracy"]))
    fields = {"frame": report["frame"], "size": size, "samples": report["samples"], "accuracy": accuracy}
    return Words("Frame {frame}, {size}, {samples} samples, {accuracy}", **fields)


def _draw_quality(layout: bpy.types.UILayout, context: bpy.types.Context, report: Mapping[str, Any]) -> None:
    """Draw the estimated and measured quality, and the price of a better one."""
    column = layout.column(align=True)
    draw_heading(column, ESTIMATED)
    estimate = report["estimate"]
    if estimate["noise_ratio"] is None:
        paragraph(column, context, Words("Not checked: {reason}", reason=estimate["from"]))
    else:
        draw_row(column, ERROR, f"{estimate['honest_ratio']:.3f}")
        if estimate["honest_low"] is not None:
            draw_row(column, "Likely range", f"{estimate['honest_low']:.2f} - {estimate['honest_high']:.2f}")
        if estimate["promise"] is not None:
            promise = Words("Promise: at most {ratio}", ratio=f"{estimate['promise']:g}")
            draw_row(column, promise, KEPT[estimate["kept"]])
        draw_row(column, ERROR_AND_NOISE, f"{estimate['noise_ratio']:.3f}")
    if report.get("correction"):
        draw_row(column, "Matched to EEVEE", f"{100.0 * report['correction']['mean']:.0f} %")
    compare = report.get("compare")
    if compare:
        column = layout.column(align=True)
        draw_heading(column, MEASURED)
        if compare.get("no_noise"):
            paragraph(column, context, Words("Not held against noise: {reason}", reason=compare["no_noise"]))
        for words, name in MEASURED_FIGURES:
            if compare.get(name) is not None:
                draw_row(column, words, f"{compare[name]:.3f}")
    paragraph(layout, context, price_words(report["price"]))


def price_words(price: Mapping[str, Any]) -> str:
    """Return a sentence that says what the next better accuracy would cost. `price` is the part of that name of a
    pair's report.
    """
    if price["more_seconds"] is None:
        return Words("It cannot be better: all of it was rendered")
    time = more_seconds_text(price)
    if price["accuracy"] == WHOLE:
        return Words("Rendering both eyes would take {time}", time=time)
    return Words("Accuracy {better} would take {time}", better=Words(accuracy_name(price["accuracy"])), time=time)


def fill_words(fill: Mapping[str, Any]) -> Words:
    """Return words about how missing pixels are rendered, and why so; `fill` is that part of a report."""
    return Words("Hole rendering: {method}, {reason}", method=fill["method"].capitalize(), reason=fill["reason"])


def _draw_times(layout: bpy.types.UILayout, context: bpy.types.Context, report: Mapping[str, Any]) -> None:
    """Draw the seconds of each stage, and the gain over multiview."""
    seconds = report["seconds"]
    column = layout.column(align=True)
    draw_heading(column, TIME)
    for name in (*(stage for stage in Stage if stage not in OUTSIDE_TOTAL), "total"):
        if seconds.get(name, 0.0) >= 0.005:
            draw_row(column, STAGES.get(name, label_of(name).capitalize()), f"{seconds[name]:.2f} s")
    compare = report.get("compare")
    if compare:
        draw_row(column, "Both eyes rendered", f"{compare['multiview_seconds']:.2f} s")
        draw_row(column, "Speed (measured)", f"{compare['speedup']:.2f} x")
    else:
        of_what = "Preview's speed" if has_preview(context.scene) else "Speed (estimated)"
        draw_row(column, of_what, f"{report['predicted_speedup']:.2f} x")
    draw_row(column, "Saved in all", f"{saved_seconds(report):.2f} s")
    paragraph(layout, context, fill_words(report["fill"]))


def _draw_traced(layout: bpy.types.UILayout, report: Mapping[str, Any]) -> None:
    """Draw the share of the second eye's pixels that were rendered again, for each reason."""
    column = layout.column(align=True)
    draw_heading(column, TRACED)
    for name, fraction in report["fractions"].items():
        if fraction > 0.0:
            draw_row(column, REASONS.get(name, name.capitalize()), f"{100.0 * fraction:.1f} %")
