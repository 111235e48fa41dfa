"""A report's verdict for artists: in plain words, how good the picture is and how much time was saved.

Everything here reads the dict that report.json or animation.json has. Nothing here knows Blender.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..estimate.missing import NOTHING_DIFFERS
from ..pipeline.stages import OUTSIDE_TOTAL, Stage
from ..settings.accuracy import SETTINGS
from ..settings.animation import KEY_FRAME, spelled
from ..words import Words

UNCERTAIN_AREAS = "Uncertain Areas"
"""Name, for artists, of the picture estimate.png, which shows where the second eye is off by more than noise."""

RENDERED = "rendering both eyes"
"""Words for that against which a pair's quality and time are held."""

OF_PREVIEW = f"{RENDERED} of this preview"
"""Words for that against which a preview's quality is held."""

AS_GOOD = "As good as rendering both eyes"
NEARLY_AS_GOOD = "Nearly as good as rendering both eyes"
NOT_AS_GOOD = f"Not as good as rendering both eyes: see {UNCERTAIN_AREAS}"
TOO_CLOSE = "Too close to tell if it is as good as rendering both eyes"
UNPROMISED = "Not checked: reflections and glass stay as the first eye sees them"

MAY_BE_WRONG = "the pair may be wrong there"
"""Words by which a warning says that a part of the picture may be wrong though the spot checks have found nothing."""

WARNED_OF = "{verdict}, but for what a warning names"

MAX_EQUAL_RATIO = SETTINGS["balanced"].promise or 1.0
"""Greatest honest ratio of a picture that is called as good as a rendered one: what the default accuracy promises."""

LEAST_NAMED_SHARE = 0.01
"""Least share of wrong tiles that the verdict of a good picture mentions."""

LEAST_SAVED_SECONDS = 0.05
"""Least seconds that are called saved or lost: a figure with one decimal shows no less."""

LEAST_SAVED_SHARE = 0.05
"""Least predicted share of the time that is called a gain."""

MAX_DECIMAL_SECONDS = 9.95
"""Seconds from which a duration is shown without a decimal."""

NEEDED = {"noise_ratio", "honest_ratio", "promise", "kept", "wrong_tiles", "from"}
"""Keys that an estimate must have for a verdict."""

WAITED_FOR = tuple(stage for stage in OUTSIDE_TOTAL if stage != Stage.COMPARE)
"""Stages outside a pair's total that an artist waits for all the same, and that a plain render does not have."""

ACCURACY_NAMES = {"draft": "Fast"}
"""Names of accuracy settings for artists, where they are not the setting's own with a capital letter."""


@dataclass(frozen=True)
class Verdict:
    """A sentence about quality without its full stop. good: True for a picture that is as good as promised, False for
    one that is not, and None where that is not known."""

    words: str
    """Can be made anew in another language, see `words.in_language`."""
    good: bool | None


def accuracy_name(accuracy: str) -> str:
    """Return the name of an accuracy setting as artists read it: "Fast" for draft, "High" for high."""
    return ACCURACY_NAMES.get(accuracy, accuracy.capitalize())


def quality_of(report: Mapping[str, Any], *, preview: bool = False) -> Verdict:
    """Return the verdict on a pair's quality. A comparison with multiview decides where it has measured something;
    else the estimate does. A preview is held against both eyes rendered as small and noisy, since it tells nothing of
    more samples. A warning that something may be wrong takes from a good verdict that it is sure."""
    found = _quality_of(report)
    if found.good and any(MAY_BE_WRONG in warning for warning in report["warnings"]):
        found = Verdict(Words(WARNED_OF, verdict=found.words), good=None)
    return Verdict(_of_preview(found.words), found.good) if preview else found


def _of_preview(words: str) -> str:
    """Return words about a pair as words about a preview."""
    if not isinstance(words, Words):
        return words.replace(RENDERED, OF_PREVIEW)
    fields = {name: _of_preview(field) if isinstance(field, str) else field for name, field in words.fields.items()}
    return Words(words.message.replace(RENDERED, OF_PREVIEW), **fields)


def _quality_of(report: Mapping[str, Any]) -> Verdict:
    """Return the verdict on a pair's quality, held against both eyes rendered whole; see `quality_of`."""
    estimate, compare = report["estimate"], report.get("compare") or {}
    measured = compare.get("honest_ratio")
    if measured is not None:
        limit = estimate["promise"] or MAX_EQUAL_RATIO
        found = _quality(measured, measured <= limit, compare.get("wrong_tiles") or 0.0)
        return Verdict(Words("{verdict} (measured)", verdict=found.words), found.good)
    if report["fractions"]["rerendered"] >= 1.0:
        return Verdict(Words("{verdict}: all of it was rendered", verdict=Words(AS_GOOD)), good=True)
    if estimate["noise_ratio"] is None:
        return _unchecked(estimate)
    if estimate["kept"] is None:
        return Verdict(TOO_CLOSE, good=None)
    return _quality(estimate["honest_ratio"], estimate["kept"], estimate["wrong_tiles"])


def _unchecked(estimate: Mapping[str, Any]) -> Verdict:
    """Return the verdict on a pair that has no estimate, from that part of its report."""
    if estimate["promise"] is None:
        return Verdict(UNPROMISED, good=None)
    if estimate["from"] == NOTHING_DIFFERS:
        return Verdict(AS_GOOD, good=True)
    return Verdict(Words("Not checked: {reason}", reason=estimate["from"]), good=None)


def _quality(honest_ratio: float, kept: bool, wrong_tiles: float) -> Verdict:
    """Return the verdict on a picture with this honest ratio. kept says whether its promise is kept, wrong_tiles which
    share of its tiles, 0 to 1, is wrong so that it can be seen."""
    if not kept:
        return Verdict(NOT_AS_GOOD, good=False)
    words = Words(AS_GOOD if honest_ratio <= MAX_EQUAL_RATIO else NEARLY_AS_GOOD)
    if wrong_tiles >= LEAST_NAMED_SHARE:
        share = f"{100.0 * wrong_tiles:.0f}"
        seen_in = Words(UNCERTAIN_AREAS)
        words = Words("{verdict}, but for {share} % of it: see {picture}", verdict=words, share=share, picture=seen_in)
    return Verdict(words, good=True)


def quality_of_animation(rows: Sequence[Mapping[str, Any]]) -> Verdict | None:
    """Return the verdict on the frames of an animation, from the rows of its report; None where no row has an
    estimate. A row whose estimate lacks something, as of another version's run, counts as one without. Where the first
    eye was made too, a frame is as good as the worse of its eyes."""
    told = {
        row["frame"]: _worse([quality_of(eye).good for eye in _made_eyes(row)])
        for row in rows
        if (row.get("estimate") or {}).keys() >= NEEDED
    }
    worse = [frame for frame, good in told.items() if good is False]
    if not told:
        return None
    if worse:
        counts = {"count": len(worse), "all": len(told), "frames": spelled(worse)}
        words = Words("Not as good as rendering both eyes: {count} of {all} frames ({frames})", **counts)
        return Verdict(words, good=False)
    if None in told.values():
        unknown = sum(good is None for good in told.values())
        counts = {"count": unknown, "all": len(told)}
        words = Words("Not known of {count} of {all} frames if they are as good as rendering both eyes", **counts)
        return Verdict(words, good=None)
    return Verdict(AS_GOOD, good=True)


def _made_eyes(row: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yield, for each made eye of a frame, the row of an animation's report as one of a pair of which it is the
    target."""
    yield row
    reuse, compare = row.get("reuse") or {}, row.get("compare") or {}
    if (reuse.get("first_eye") or {}).keys() >= NEEDED:
        fractions = {"rerendered": reuse["first_eye_traced"]}
        yield {**row, "estimate": reuse["first_eye"], "fractions": fractions, "compare": compare.get("first_eye")}


def _worse(good: Sequence[bool | None]) -> bool | None:
    """Return the worst of several verdicts: False before None, None before True."""
    return False if False in good else None if None in good else True


def reuse_in_animation(rows: Sequence[Mapping[str, Any]]) -> Verdict | None:
    """Return a sentence about how many frames of an animation were made from earlier ones, from the rows of its report,
    with the first reason why others were not; None where none was to be."""
    told = [row["reuse"] for row in rows if row.get("reuse")]
    made = sum(reuse["key_frame"] is not None for reuse in told)
    reasons = [reuse["whole"] for reuse in told if reuse["whole"] not in (None, KEY_FRAME)]
    if not made and not reasons:
        return None
    words = Words("{made} of {all} frames were made from earlier ones", made=made, all=len(told))
    if reasons:
        words = Words("{made}; {count} could not be: {reason}", made=words, count=len(reasons), reason=reasons[0])
    return Verdict(words, good=None if reasons else True)


def duration(seconds: float) -> str:
    """Return seconds, at least 0, as words: "0.4 s", "12 s", "3 min 10 s", "2 h 5 min"."""
    if seconds < MAX_DECIMAL_SECONDS:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    minutes, rest = divmod(whole, 60)
    parts = [(minutes, "min"), (rest, "s")]
    if minutes >= 60:
        hours, minutes = divmod(round(seconds / 60.0), 60)
        parts = [(hours, "h"), (minutes, "min")]
    return " ".join(f"{number} {unit}" for number, unit in parts if number)


def saved_words(seconds: float, plain: float | None = None) -> str:
    """Return in words how much time was saved, such as "3 min 10 s saved", or "17 s saved of 43 s (40 %)" where
    `plain` has the seconds of rendering both eyes; negative seconds are those that were lost."""
    if seconds >= LEAST_SAVED_SECONDS:
        if plain is None:
            return Words("{time} saved", time=duration(seconds))
        share = f"{100.0 * seconds / max(plain, seconds):.0f}"
        return Words("{time} saved of {plain} ({share} %)", time=duration(seconds), plain=duration(plain), share=share)
    if seconds > -LEAST_SAVED_SECONDS:
        return Words("No time saved")
    return Words("No time saved: {time} longer", time=duration(-seconds))


def saved_seconds(report: Mapping[str, Any]) -> float:
    """Return the seconds that a pair has saved over two plain renders; negative where it took longer.

    A plain second eye takes as long as the source without its sync, or as long as multiview's did where that was
    measured. From it goes all that the target took, and the loading, measuring and writing that a plain render lacks.
    """
    seconds = report["seconds"]
    return plain_seconds(report) - seconds["total"] - sum(seconds.get(stage, 0.0) for stage in WAITED_FOR)


def plain_seconds(report: Mapping[str, Any]) -> float:
    """Return the seconds that rendering both eyes of a pair takes: as measured by a comparison, or else as reckoned
    from the rendered eye."""
    compare = report.get("compare")
    return compare["multiview_seconds"] if compare else report["predicted_speedup"] * report["seconds"]["total"]


def saved_by_animation(totals: Mapping[str, Any]) -> float:
    """Return the seconds that an animation's frames have saved over plain renders, from its report's "totals"; negative
    where they took longer."""
    return totals["multiview_seconds"] - totals["seconds"]


def full_render_gain(preview: Mapping[str, Any], size: tuple[int, int], samples: int) -> float:
    """Return how many times as fast as multiview the full render is predicted to be: the one of this size in pixels,
    with these samples per pixel, whose preview has the report `preview`.

    The sync takes the same time in both; rendering grows with pixels and samples, denoising and warping with pixels.
    The share of traced pixels is taken to be the preview's. It is smaller in a larger picture, so that the prediction
    is a cautious one.
    """
    seconds, costs = preview["seconds"], preview["fill"]["costs"]
    pixels = size[0] * size[1] / (preview["size"][0] * preview["size"][1])
    work = pixels * samples / preview["samples"]
    denoised = seconds.get(Stage.DENOISE_SOURCE, 0.0)
    source = seconds[Stage.SOURCE] + denoised
    plain = preview["predicted_speedup"] * seconds["total"] - source
    sync, rendering = max(source - plain, 0.0), max(plain - denoised, 0.0)
    calls = [name for name in (Stage.PILOT, Stage.FILL, Stage.REFINE) if seconds.get(name, 0.0) > 0.0]
    tracing = sum(seconds[name] for name in calls)
    fixed = min(len(calls) * (costs["render_call_seconds"] + costs["resync_share"] * sync), tracing)
    planning = seconds.get(Stage.PLAN, 0.0)
    other = max(seconds["total"] - source - tracing - planning, 0.0)
    eye = rendering * work + denoised * pixels
    ours = planning + sync + eye + fixed + (tracing - fixed) * work + other * pixels
    return (sync + 2.0 * eye) / ours if ours > 0.0 else 1.0


def predicted_words(gain: float) -> str:
    """Return in words what a full render is predicted to gain, in whole percents, rounded down. gain is how many
    times as fast as multiview it will be."""
    share = 1.0 - 1.0 / gain
    if share < LEAST_SAVED_SHARE:
        return Words("A full render is predicted to save little or no time over rendering both eyes")
    message = "A full render is predicted to take {share} % less time than rendering both eyes"
    return Words(message, share=math.floor(100.0 * share))


def time_words(report: Mapping[str, Any], *, full_gain: float | None = None) -> str:
    """Return in words what a pair has saved. Of a preview, whose full render is predicted to have the gain full_gain,
    return that prediction alone: a preview itself saves nothing that counts."""
    if full_gain is not None:
        return predicted_words(full_gain)
    return saved_words(saved_seconds(report), plain_seconds(report))


def picture_words(slot: str | None, frame: int | None, clock: str, *, preview: bool = False) -> str:
    """Return the name of a picture: "Slot 1, frame 7, 14:32". slot is its render slot's name (None where that is not
    known), frame its number (None for no single frame), clock the time of day at which it was finished."""
    message = ", ".join(["{slot}"] * bool(slot) + ["frame {frame}"] * (frame is not None) + ["{clock}"])
    fields = {"slot": slot, "frame": frame, "clock": clock}
    return Words(f"Preview: {message}" if preview else message, **fields)


def animation_words(slot: str | None, frame: int | None, clock: str) -> str:
    """Return the name of an animation: "Animation, 14:32; Slot 1 has its last frame, 48". The parameters are those of
    `picture_words`, of the frame that was handed over."""
    if frame is None:
        return Words("Animation, {clock}", clock=clock)
    message = (
        "Animation, {clock}; {slot} has its last frame, {frame}" if slot else "Animation, {clock}, to frame {frame}"
    )
    return Words(message, clock=clock, slot=slot, frame=frame)
