"""Panels in the Image Editor's sidebar: the last pair's time, its quality, and the pictures that explain it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy

from ..stereo_reproject.pipeline.next_accuracy import WHOLE
from ..stereo_reproject.pipeline.stages import OUTSIDE_TOTAL, Stage, label_of
from ..stereo_reproject.report.table import more_seconds_text
from .panels import paragraph
from .pictures import STEREO_REPROJECT_OT_show_picture
from .results import PICTURES, Result, result_of

REASONS = {
    "disoccluded": "Hidden from the first eye",
    "outside": "Outside its frame",
    "silhouette": "Edges",
    "transparent": "Seen through glass",
    "volume": "Volumes before the sky",
    "defocus": "Blurred edges",
    "refined": "Off, as probes found",
    "probe": "Probes",
    "rerendered": "All that was rendered",
}
"""Names, for artists, of the reasons why pixels of the second eye were rendered."""

MEASURED = (
    ("Honest ratio", "honest_ratio"),
    ("Noise ratio", "noise_ratio"),
    ("Worst tiles", "worst_tiles"),
    ("Error", "rmse"),
)
"""Figures of a comparison that are shown: names for artists, and keys of the report."""


class IMAGE_PT_stereo_reproject(bpy.types.Panel):
    bl_label = "Stereo Pair"
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Stereo"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the panel: frame and settings of the last pair, and buttons that show its pictures."""
        result = result_of(context.scene)
        if result.report is None:
            paragraph(self.layout, context, "No pair yet: use Render > Render Stereo Image (Reprojected).")
            return
        report = result.report
        size = " x ".join(map(str, report["size"]))
        how = f"Frame {report['frame']}, {size}, {report['samples']} samples, {report['accuracy']}"
        paragraph(self.layout, context, how)
        self._draw_pictures(result)

    def _draw_pictures(self, result: Result) -> None:
        """Draw a button for the pair and one for each picture that explains it; those of missing pictures are grey."""
        column = self.layout.column(align=True)
        name = STEREO_REPROJECT_OT_show_picture.bl_idname
        column.operator(name, text="Stereo Pair", icon="CAMERA_STEREO").which = "PAIR"
        grid = column.grid_flow(columns=2, even_columns=True, align=True)
        for which, (_, text, _) in PICTURES.items():
            row = grid.row(align=True)
            row.enabled = result.picture(which) is not None
            row.operator(name, text=text).which = which


class _Part(bpy.types.Panel):
    """Base class of the panel's sub-panels, which are shown only when the scene has the report of a pair."""

    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Stereo"
    bl_parent_id = "IMAGE_PT_stereo_reproject"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has the report of a pair."""
        return result_of(context.scene).report is not None


def _row(layout: bpy.types.UILayout, name: str, value: str) -> None:
    """Draw one line with a name on the left and its value on the right."""
    split = layout.split(factor=0.6)
    split.label(text=name)
    right = split.row()
    right.alignment = "RIGHT"
    right.label(text=value)


class IMAGE_PT_stereo_reproject_quality(_Part):
    bl_label = "Quality"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the estimated and measured quality of the last pair, and the price of a better one."""
        report = result_of(context.scene).report
        assert report is not None
        column = self.layout.column(align=True)
        _draw_estimate(column, context, report)
        if report.get("correction"):
            _row(column, "Moved to match EEVEE", f"{100.0 * report['correction']['mean']:.0f} % of the brightness")
        compare = report.get("compare")
        if compare:
            if compare.get("no_noise"):
                paragraph(column, context, f"No noise ratio: {compare['no_noise']}")
            for words, name in MEASURED:
                if compare.get(name) is not None:
                    _row(column, f"{words}, measured", f"{compare[name]:.3f}")
        price = report["price"]
        paragraph(self.layout, context, _price(price))


def _draw_estimate(column: bpy.types.UILayout, context: bpy.types.Context, report: Mapping[str, Any]) -> None:
    """Draw the report's estimated honest ratio, its interval and whether the promise is kept, and the noise ratio; or
    why there is no estimate.
    """
    estimate = report["estimate"]
    if estimate["noise_ratio"] is None:
        paragraph(column, context, f"No estimate: {estimate['from']}")
        return
    _row(column, "Honest ratio, estimated", f"{estimate['honest_ratio']:.3f}")
    paragraph(column, context, "1 is as good as rendering it whole.")
    if estimate["honest_low"] is not None:
        _row(column, "95 % interval", f"{estimate['honest_low']:.2f} to {estimate['honest_high']:.2f}")
    if estimate["promise"] is not None:
        kept = {True: "kept", False: "NOT kept", None: "too close to tell"}[estimate["kept"]]
        _row(column, f"Promise: at most {estimate['promise']:g}", kept)
    _row(column, "Noise ratio, estimated", f"{estimate['noise_ratio']:.3f}")


def _price(price: Mapping[str, Any]) -> str:
    """Return a sentence that says what the next better accuracy would cost. `price` is the part of that name of a
    pair's report.
    """
    better = "Rendering it whole" if price["accuracy"] == WHOLE else price["accuracy"].capitalize()
    if price["more_seconds"] is None:
        return "It cannot be better: all of it was rendered"
    return f"{better} would take {more_seconds_text(price)}"


class IMAGE_PT_stereo_reproject_times(_Part):
    bl_label = "Time"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the seconds of each stage of the last pair, and the gain over multiview."""
        report = result_of(context.scene).report
        assert report is not None
        seconds = report["seconds"]
        column = self.layout.column(align=True)
        for name in (*(stage for stage in Stage if stage not in OUTSIDE_TOTAL), "total"):
            if seconds.get(name, 0.0) >= 0.005:
                _row(column, label_of(name).capitalize(), f"{seconds[name]:.2f} s")
        compare = report.get("compare")
        if compare:
            _row(column, "Multiview, measured", f"{compare['multiview_seconds']:.2f} s")
            _row(column, "Gain, measured", f"{compare['speedup']:.2f} x")
        else:
            _row(column, "Gain, predicted", f"{report['predicted_speedup']:.2f} x")
        paragraph(self.layout, context, f"Fill: {report['fill']['method']}, {report['fill']['reason']}")


class IMAGE_PT_stereo_reproject_traced(_Part):
    bl_label = "Rendered in the Second Eye"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the share of the second eye's pixels that were rendered, for each reason."""
        report = result_of(context.scene).report
        assert report is not None
        column = self.layout.column(align=True)
        for name, fraction in report["fractions"].items():
            if fraction > 0.0:
                _row(column, REASONS.get(name, name.capitalize()), f"{100.0 * fraction:.1f} %")


IMAGE_PANELS = (
    IMAGE_PT_stereo_reproject,
    IMAGE_PT_stereo_reproject_quality,
    IMAGE_PT_stereo_reproject_times,
    IMAGE_PT_stereo_reproject_traced,
)
