"""The output of `inspect`: the effects plan and the predicted cost, as a table for people and as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..images.effects import EffectsPlan

INSPECTION_SCHEMA = 1

MAX_SHOWN_CAUSES = 2
"""Number of objects or materials that the table names for each effect, at most."""


REFINE_NOTE = "how much, only probes tell"


def effects_rows(plan: EffectsPlan) -> list[dict[str, Any]]:
    """Return the plan's findings, one for each effect, as a list of dicts for JSON."""
    return [finding.fields() for finding in plan.findings]


def format_inspection(inspection: Mapping[str, Any]) -> str:
    """Return the output of `inspect` as a table for people, from its JSON. It is plain ASCII but for names from the
    scene."""
    size = "x".join(map(str, inspection["size"]))
    how = f"{inspection['samples']} samples, {inspection['accuracy']}, {inspection['engine']} on {inspection['device']}"
    lines = [
        f"{inspection['scene']}, frame {inspection['frame']}, {size}, {how}",
        *_effects_lines(inspection["effects"]),
        f"passes        {', '.join(inspection['passes'])}",
        *_prediction_lines(inspection["predicted"]),
    ]
    return "\n".join(lines)


def _effects_lines(rows: list[dict[str, Any]]) -> list[str]:
    """Return the lines of the table about effects, from rows as `effects_rows` returns them."""
    called = [row for row in rows if row["called_for"]]
    others = [row["effect"] for row in rows if not row["called_for"]]
    lines = ["called for    by" if called else "called for    nothing: colour and depth are all that is needed"]
    for row in called:
        lines += [f"  {row['effect']:<22}{_abridged(row['by'])}", *_cost_lines(row), f"    {row['handling']}"]
    if others:
        lines.append(f"not called for  {', '.join(others)}")
    return lines


def _cost_lines(row: Mapping[str, Any]) -> list[str]:
    """Return the line about the greatest cost that an effect may have; an empty list where it was not predicted. row is
    one of `effects_rows`, with its "share" of the picture."""
    if row.get("share") is None:
        return []
    share, seconds = 100 * row["share"], row["seconds_at_most"]
    return [f"    seen in {share:.1f} % of the picture at most: at most {seconds:.1f} s, if all of it is traced"]


def _abridged(by: list[str]) -> str:
    """Return the names in `by` in one text: the first MAX_SHOWN_CAUSES, and the number of the others."""
    more = f" and {len(by) - MAX_SHOWN_CAUSES} more" if len(by) > MAX_SHOWN_CAUSES else ""
    return ", ".join(by[:MAX_SHOWN_CAUSES]) + more


def _prediction_lines(predicted: Mapping[str, Any] | None) -> list[str]:
    """Return the lines of the table about the predicted cost; `predicted` is None where no sketch was asked for."""
    if predicted is None:
        return ["predicted     nothing: no sketch was asked for"]
    fill, gain = predicted["fill"], predicted["gain"]
    lines = [f"predicted     not measured; from {predicted['rests_on']}"]
    if predicted["total_seconds"] is not None:
        shares = {name: 100 * value for name, value in predicted["fractions"].items()}
        traced = f"holes {shares['holes']:.1f} %, probes {shares['probes']:.1f} %"
        lines += [
            f"  source      {predicted['source_seconds']:8.1f} s",
            *([f"  denoise     {predicted['denoise_seconds']:8.1f} s"] if predicted["denoise_seconds"] else []),
            f"  warp        {predicted['warp_seconds']:8.1f} s",
            f"  fill        {fill['seconds']:8.1f} s   {traced}",
            f"  refine      {_range(predicted['refine_seconds'], '8.1f')} s   {REFINE_NOTE}",
            f"  total       {_range(predicted['total_seconds'], '8.1f')} s",
            f"  multiview   {predicted['multiview_seconds']:8.1f} s",
        ]
    lines.append(f"  fill by     {fill['method']}: {fill['reason']}")
    lines.append(f"  gain        {_range(gain, '8.2f')} x over Blender's multiview")
    return lines


def _range(values: Mapping[str, float], pattern: str) -> str:
    """Return "low to high" of a dict with these two numbers, formatted by `pattern`; one number where both look
    alike."""
    low, high = format(values["low"], pattern), format(values["high"], pattern).strip()
    return low if low.strip() == high else f"{low} to {high}"
