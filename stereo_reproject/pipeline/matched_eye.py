"""The target eye of a source whose light is not the tracer's: holes and a ring around them, matched to the picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..estimate.tracing import FillPlanner, TargetEye
from ..holes.reprojection import Reprojection
from ..images.passes import COLOUR_PASS, DEPTH_PASS, Passes, filtered
from ..images.reasons import Reason
from ..matching.matching import Correction, Traced, correction_of, match, ring_of
from ..settings.accuracy import Accuracy
from ..trace.fill import FillChoice, SourceCost
from ..trace.requests import TraceRequest
from ..trace.tuning import TRACE_TUNING
from ..warp.composite import composite

PILOT_SHARE = 0.1
"""Of the pixels that are to be traced, how many go ahead to tell what the others will cost."""

FEWEST = 1024
"""Pixels of a pilot, at least: with fewer, a render call costs what it costs to begin."""

AT_ONCE = 1.0
"""Seconds of a render of an eye below which another one is taken unasked: to copy a scene to the tracer, which is all
that can be gained, takes as long."""

WHOLE = "a second EEVEE render"


class LightMatcher(Protocol):
    """What is asked of a renderer whose source another engine traces."""

    def trace(self, method: str, requests: Sequence[TraceRequest]) -> list[Passes]: ...

    def traced_features(self, passes: Passes) -> Traced:
        """What the tracer tells of the pixels of passes (N, C), which are those of a trace."""
        ...

    def clean(self, colour: NDArray[np.float32]) -> NDArray[np.float32]:
        """A picture (H, W, 3) without its noise."""
        ...

    def trace_cost(self) -> SourceCost:
        """What the last trace has cost."""
        ...

    def unmatchable(self) -> str | None:
        """Why traced pixels cannot be matched, in words, or None."""
        ...


def foreseen_fill(asked: str, blockers: Mapping[str, str | None], unmatchable: str | None) -> tuple[str, str]:
    """The fill method and why, as far as the scene tells; `choose_fill` has the blockers, `LightMatcher` what cannot be
    matched."""
    if asked != "auto":
        return asked, "asked for"
    if unmatchable is not None:
        return "full", f"{WHOLE}: {unmatchable}"
    if blockers.get("packed"):
        # A card has Cycles go over the whole frame, for which EEVEE is the faster one.
        return "full", f"{WHOLE}: no packed: {blockers['packed']}"
    return "packed", f"packed, unless {WHOLE} is the cheaper way"


class MatchedEye(TargetEye):
    """A target eye whose traced pixels are matched to what was warped; `correction` is how far they were moved.

    Nothing is probed: the engines differ everywhere, and no estimate could tell that from a wrong warp.
    """

    def __init__(
        self,
        matcher: LightMatcher,
        view: str,
        means: FillPlanner,
        reprojection: Reprojection,
        accuracy: Accuracy,
        *,
        seed: int,
    ) -> None:
        super().__init__(matcher, view, means, reprojection, accuracy, watched=False, seed=seed)
        self.correction: Correction | None = None
        self._matcher = matcher
        self._unmatchable: str | None = None

    def fill(self) -> FillChoice:
        ring = ring_of(self._holes, self._reprojection.warp.covered)
        wanted = self._holes | ring
        if not self._holes.any():
            return FillChoice("packed" if not self._means.blockers.get("packed") else "full", "no hole to fill", 0.0)
        choice = self._before_tracing()
        if choice.method != "full":
            choice = self._trace_matched(choice, wanted, ring)
        if choice.method == "full":
            self._trace("full", np.ones_like(self._holes))
        return choice

    def _before_tracing(self) -> FillChoice:
        """What can be said before anything was traced."""
        means, again = self._means, self._means.cost.seconds
        self._unmatchable = self._matcher.unmatchable() or _own_passes(self.passes)
        method, reason = foreseen_fill(means.asked, means.blockers, self._unmatchable)
        if means.asked == "auto" and method != "full" and again < AT_ONCE:
            method = "full"
            reason = f"{WHOLE}, predicted {again:.1f} s: handing the scene to Cycles would take as long"
        return FillChoice(method, reason, again if method == "full" else 0.0)

    def _trace_matched(self, choice: FillChoice, wanted: NDArray, ring: NDArray) -> FillChoice:
        """Trace, the pilot first where there is a choice; the full render's choice if by the pilot that is cheaper."""
        ahead = np.zeros_like(wanted)
        pieces: list[tuple[NDArray, Passes]] = []
        predicted, told = choice.predicted_seconds, ""
        if self._means.asked == "auto" and choice.method == "packed":
            ahead = _some_of(wanted, self._seed)
            pieces.append((ahead, self._matcher.trace("packed", [TraceRequest(self._view, ahead)])[0]))
            rest, again = self._rest_of(ahead, wanted), self._means.cost.seconds
            spent = self._matcher.trace_cost().seconds
            told = f"{int(ahead.sum())} pixels took {spent:.1f} s, the others are predicted to take {rest:.1f} s"
            if rest > TRACE_TUNING.max_share_of_full_cost * again:
                return FillChoice("full", f"{WHOLE}, predicted {again:.1f} s: {told} in Cycles", again)
            predicted, told = spent + rest, f"{told} against {again:.1f} s for {WHOLE}"
        others = wanted & ~ahead
        if others.any():
            pieces.append((others, self._matcher.trace(choice.method, [TraceRequest(self._view, others)])[0]))
        self._put(_gathered(pieces, wanted), wanted, ring)
        words = f"Cycles traces the holes and a ring around them, matched to EEVEE's light; {told or choice.reason}"
        words += f", though {self._unmatchable}" if self._unmatchable else ""
        return replace(choice, reason=words, predicted_seconds=predicted)

    def _rest_of(self, ahead: NDArray, wanted: NDArray) -> float:
        """Seconds that the pixels after the pilot are predicted to take."""
        cost = self._matcher.trace_cost()
        count = int(ahead.sum())
        rest = int(wanted.sum()) - count
        return cost.fixed + cost.per_frame * rest / count if rest else 0.0

    def _put(self, traced: Passes, wanted: NDArray, ring: NDArray) -> None:
        """The traced passes (N, C) of the wanted pixels become part of the eye, their colours matched."""
        warped = self.passes[COLOUR_PASS]
        features = self._matcher.traced_features(traced)
        doubted = (self._reprojection.reasons == Reason.SILHOUETTE.bit) & self._reprojection.warp.covered
        nearness = _nearness(self.passes[DEPTH_PASS][..., 0])
        matched = match(warped[..., :3], features, wanted, known=ring, doubted=doubted, nearness=nearness)
        within = self._holes[wanted]
        kept = {name: image[within] for name, image in traced.items()}
        alpha = kept[COLOUR_PASS][:, 3:]
        kept[COLOUR_PASS] = np.concatenate([matched[within], alpha], axis=1)
        passes = composite(self.passes, kept, self._holes)
        clean = self._matcher.clean(passes[COLOUR_PASS][..., :3])
        passes[COLOUR_PASS][self._holes, :3] = clean[self._holes]
        self.correction = correction_of(clean[self._holes], features.colour[within], warped)
        self.passes, self.traced = passes, self.traced | wanted


def _own_passes(passes: Passes) -> str | None:
    """What of the source's passes traced pixels cannot have, in words: its light is the engine's own."""
    own = [name for name in passes if filtered(name) and name not in (COLOUR_PASS, "Mist")]
    return f"pass {own[0]!r} is EEVEE's own, and could not be matched" if own else None


def _gathered(pieces: list[tuple[NDArray, Passes]], wanted: NDArray[np.bool_]) -> Passes:
    """Passes (N, C) of the wanted pixels (H, W), in the mask's order, of pieces that were traced apart."""
    result: Passes = {}
    for name, image in pieces[0][1].items():
        whole = np.zeros((*wanted.shape, image.shape[1]), np.float32)
        for pixels, passes in pieces:
            whole[pixels] = passes[name]
        result[name] = whole[wanted]
    return result


def _some_of(wanted: NDArray[np.bool_], seed: int) -> NDArray[np.bool_]:
    """(H, W): a few of the wanted pixels, from all over the picture."""
    rows, columns = np.nonzero(wanted)
    count = min(max(int(PILOT_SHARE * rows.size), FEWEST), rows.size)
    chosen = np.random.default_rng(seed).choice(rows.size, count, replace=False)
    result = np.zeros_like(wanted)
    result[rows[chosen], columns[chosen]] = True
    return result


def _nearness(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """1 / depth, 0 for the sky and where nothing is known."""
    known = np.isfinite(depth) & (depth > 0.0)
    return np.divide(1.0, depth, out=np.zeros_like(depth), where=known)
