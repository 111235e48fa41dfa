"""The verdict on many views for artists, in plain words: how they came to be, how good they are, and the time saved.

Everything here reads the dict that report.json has of them, see `views_report`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..settings.accuracy import SETTINGS
from ..words import Words
from .verdict import MAX_EQUAL_RATIO, WAITED_FOR, Verdict, saved_words
from .views_report import MADE

AS_GOOD = "As good as rendering every view"
NEARLY_AS_GOOD = "Nearly as good as rendering every view"
TOO_CLOSE = "Too close to tell if all are as good as rendered: {view} least"
NOT_AS_GOOD = "Not as good as rendering every view: {view} least"
UNPROMISED = "Not checked: reflections and glass stay as the rendered views show them"


def verdicts_on_views(report: Mapping[str, Any]) -> list[Verdict]:
    """Return the sentences about many views: how many were rendered and how many made, their quality, and the time that
    was saved."""
    saved = saved_by_views(report)
    return [
        Verdict(_counts(report["views"]), good=None),
        _quality(report),
        Verdict(saved_words(saved, _plain_seconds(report)), good=True if saved > 0.0 else None),
    ]


def _counts(views: Sequence[Mapping[str, Any]]) -> Words:
    """Return in words how many of the views were rendered and how many were made."""
    made = sum(view["how"] == MADE for view in views)
    fields = {"rendered": len(views) - made, "made": made}
    if len(views) - made == 1:
        return Words("1 view rendered, {made} made from it", **fields)
    return Words("{rendered} views rendered, {made} made from them" if made else "{rendered} views rendered", **fields)


def _quality(report: Mapping[str, Any]) -> Verdict:
    """Return the verdict on the quality of the views: that of the worst of them. A view without an estimate, under a
    promise, shows nothing that looks different from each camera: it is as good as rendered."""
    accuracy = SETTINGS.get(report["accuracy"])
    promise = None if accuracy is None else accuracy.promise
    measured = (report.get("compare") or {}).get("honest_ratio")
    if measured is not None:
        good = measured <= (promise or MAX_EQUAL_RATIO)
        told = _good(measured) if good else "Not as good as rendering every view"
        return Verdict(Words("{verdict} (measured)", verdict=Words(told)), good=good)
    made = [view for view in report["views"] if view["how"] == MADE]
    known = [view for view in made if view["honest_ratio"] is not None]
    if promise is None:
        return Verdict(UNPROMISED, good=None) if made else Verdict(AS_GOOD, good=True)
    if not known:
        return Verdict(AS_GOOD, good=True)
    worst = max(known, key=lambda view: view["honest_ratio"])
    if worst["honest_ratio"] <= promise:
        return Verdict(_good(worst["honest_ratio"]), good=True)
    # The worst of many estimates is higher than it should be: only its whole range decides against it.
    low = (worst["interval"] or (0.0,))[0]
    if low <= promise:
        return Verdict(Words(TOO_CLOSE, view=worst["name"]), good=None)
    return Verdict(Words(NOT_AS_GOOD, view=worst["name"]), good=False)


def _good(honest_ratio: float) -> str:
    """Return the words for views that are as good as promised, the worst of which has this honest ratio."""
    return AS_GOOD if honest_ratio <= MAX_EQUAL_RATIO else NEARLY_AS_GOOD


def saved_by_views(report: Mapping[str, Any]) -> float:
    """Return the seconds that many views have saved over plain renders of each; negative where they took longer. What
    a plain render does not have, loading and writing, counts against them."""
    seconds = report["seconds"]
    return _plain_seconds(report) - seconds["total"] - sum(seconds.get(stage, 0.0) for stage in WAITED_FOR)


def _plain_seconds(report: Mapping[str, Any]) -> float:
    """Return the seconds that rendering each view takes: as measured by a comparison, or else as predicted."""
    compare = report.get("compare")
    return compare["plain_seconds"] if compare else report["predicted_speedup"] * report["seconds"]["total"]
