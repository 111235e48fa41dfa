"""Tracing for a source of another engine: holes and a ring around them, matched to the light of the picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..estimate.noise_ratio import AS_RENDERED
from ..estimate.target import Provenance, Target
from ..estimate.tracing import Refinement, WarpedTarget
from ..images.passes import COLOUR_PASS, DEPTH_PASS, Passes, filtered
from ..images.reasons import Reason
from ..matching.matching import Correction, TracedPixels, correction_of, match, ring_of
from ..trace.fill import FillChoice, SourceCost
from ..trace.requests import TraceRequest
from ..trace.tuning import TUNING as TRACE_TUNING
from .tuning import TUNING

SECOND_RENDER = "a second EEVEE render"

NO_PROBES = "Cycles' light is not EEVEE's, and probes cannot tell that from a wrong warp"


class LightMatcher(Protocol):
    """A tracer that is another engine than the one that rendered the source."""

    def trace(self, method: str, requests: Sequence[TraceRequest]) -> list[Passes]:
        """Trace pixels, as `trace.requests.Tracer` says."""
        ...

    def traced_features(self, passes: Passes) -> TracedPixels:
        """Return what the tracer tells of the pixels of passes (N, C), which are those of a trace."""
        ...

    def clean(self, colour: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return a picture (H, W, 3) without its noise."""
        ...

    def trace_cost(self) -> SourceCost:
        """Return the cost of the last trace."""
        ...

    def unmatchable(self) -> str | None:
        """Return why traced pixels cannot be matched, in words, or None."""
        ...


def foreseen_fill(asked: str, blockers: Mapping[str, str | None], unmatchable: str | None) -> tuple[str, str]:
    """Return the fill method and why, as far as the scene tells before anything is rendered.

    blockers are as for `choose_fill`; unmatchable is as `LightMatcher` has it.
    """
    if asked != "auto":
        return asked, "asked for"
    if unmatchable is not None:
        return "full", f"{SECOND_RENDER}: {unmatchable}"
    if blockers.get("packed"):
        # A card has Cycles go over the whole frame, for which EEVEE is the faster one.
        return "full", f"{SECOND_RENDER}: no packed: {blockers['packed']}"
    return "packed", f"packed, unless {SECOND_RENDER} is the cheaper way"


@dataclass(frozen=True)
class _Piece:
    """Traced pixels: a mask (H, W), and their passes (N, C) in its order."""

    pixels: NDArray[np.bool_]
    passes: Passes


class MatchedTracing:
    """Completes a warped target with another engine, as `estimate.tracing.TargetTracing` says.

    Nothing is probed: the engines differ everywhere, and no estimate could tell that from a wrong warp.
    """

    pilot_share: float | None = None
    wants_pilot = False

    def __init__(self, matcher: LightMatcher, warped: WarpedTarget) -> None:
        reprojection = warped.reprojection
        self.target = Target.of_warp(warped.view, reprojection.passes, reprojection.reasons)
        self.correction: Correction | None = None
        self._matcher, self._planner, self._reprojection = matcher, warped.planner, reprojection
        self._accuracy, self._seed = warped.accuracy, warped.seed
        self._unmatchable: str | None = None

    @property
    def _holes(self) -> NDArray[np.bool_]:
        return self.target.any_of(Provenance.HOLE)

    def send_pilot(self) -> None:
        """Do nothing: what matched pixels cost is found out while the holes are traced."""

    def fill(self) -> FillChoice:
        """Trace the holes with their ring, or the whole target where that is the cheaper way or the only one."""
        holes = self._holes
        if not holes.any():
            return FillChoice("packed" if not self._planner.blockers.get("packed") else "full", "no hole to fill", 0.0)
        choice = self._before_tracing()
        if choice.method != "full":
            choice = self._trace_matched(choice, ring_of(holes, self._reprojection.warp.covered))
        if choice.method == "full":
            everything = np.ones_like(holes)
            target = self.target.with_pixels(everything, self._traced("full", everything))
            self.target = target.flagged(everything, Provenance.HOLE)
        return choice

    def refine(self) -> Refinement:
        """Return what is known without probes: a target that was rendered whole is as good as rendered."""
        whole = self._accuracy.promise is not None and bool(self.target.traced.all())
        nothing = np.zeros_like(self._holes)
        told = AS_RENDERED if whole else None
        return Refinement(nothing, estimate=told, whole=whole, no_estimate=NO_PROBES, can_promise=False)

    def _traced(self, method: str, pixels: NDArray[np.bool_]) -> Passes:
        [passes] = self._matcher.trace(method, [TraceRequest(self.target.view, pixels)])
        return passes

    def _before_tracing(self) -> FillChoice:
        """Return the choice as far as it can be made before anything is traced."""
        planner, again = self._planner, self._planner.cost.seconds
        self._unmatchable = self._matcher.unmatchable() or _unmatched_pass(self.target.passes)
        method, reason = foreseen_fill(planner.asked, planner.blockers, self._unmatchable)
        if planner.asked == "auto" and method != "full" and again < TUNING.min_seconds_to_hand_over:
            method = "full"
            reason = f"{SECOND_RENDER}, predicted {again:.1f} s: handing the scene to Cycles would take as long"
        return FillChoice(method, reason, again if method == "full" else 0.0)

    def _trace_matched(self, choice: FillChoice, ring: NDArray[np.bool_]) -> FillChoice:
        """Trace the holes and the ring (H, W), a pilot of them first where there is a choice.

        Returns the choice of a full render where the pilot says that that is cheaper.
        """
        wanted = self._holes | ring
        ahead = np.zeros_like(wanted)
        pieces: list[_Piece] = []
        predicted, told = choice.predicted_seconds, ""
        if self._planner.asked == "auto" and choice.method == "packed":
            ahead = _pilot_pixels(wanted, self._seed)
            pieces.append(_Piece(ahead, self._traced("packed", ahead)))
            rest, again = self._rest_of(ahead, wanted), self._planner.cost.seconds
            spent = self._matcher.trace_cost().seconds
            told = f"{int(ahead.sum())} pixels took {spent:.1f} s, the others are predicted to take {rest:.1f} s"
            if rest > TRACE_TUNING.max_share_of_full_cost * again:
                return FillChoice("full", f"{SECOND_RENDER}, predicted {again:.1f} s: {told} in Cycles", again)
            predicted, told = spent + rest, f"{told} against {again:.1f} s for {SECOND_RENDER}"
        others = wanted & ~ahead
        if others.any():
            pieces.append(_Piece(others, self._traced(choice.method, others)))
        self._put(_gathered(pieces, wanted), wanted, ring)
        words = f"Cycles traces the holes and a ring around them, matched to EEVEE's light; {told or choice.reason}"
        words += f", though {self._unmatchable}" if self._unmatchable else ""
        return replace(choice, reason=words, predicted_seconds=predicted)

    def _rest_of(self, ahead: NDArray[np.bool_], wanted: NDArray[np.bool_]) -> float:
        """Return the seconds that the pixels after the pilot are predicted to take."""
        cost = self._matcher.trace_cost()
        count = int(ahead.sum())
        rest = int(wanted.sum()) - count
        return cost.fixed + cost.per_frame * rest / count if rest else 0.0

    def _put(self, traced: Passes, wanted: NDArray[np.bool_], ring: NDArray[np.bool_]) -> None:
        """Put the traced passes (N, C) of the wanted pixels into the target, their colours matched."""
        holes, warped = self._holes, self.target.colour
        features = self._matcher.traced_features(traced)
        doubted = (self._reprojection.reasons == Reason.SILHOUETTE.bit) & self._reprojection.warp.covered
        nearness = _nearness(self.target.passes[DEPTH_PASS][..., 0])
        matched = match(warped[..., :3], features, wanted, known=ring, doubted=doubted, nearness=nearness)
        within = holes[wanted]
        kept = {name: image[within] for name, image in traced.items()}
        alpha = kept[COLOUR_PASS][:, 3:]
        kept[COLOUR_PASS] = np.concatenate([matched[within], alpha], axis=1)
        target = self.target.with_pixels(holes, kept).flagged(ring, Provenance.REFERENCE)
        clean = self._matcher.clean(target.colour[..., :3])[holes]
        self.correction = correction_of(clean, features.colour[within], warped)
        self.target = target.with_pixels(holes, {COLOUR_PASS: np.concatenate([clean, alpha], axis=1)})


def _unmatched_pass(passes: Passes) -> str | None:
    """Return which of the source's passes traced pixels cannot have, in words: its light is the engine's own."""
    own = [name for name in passes if filtered(name) and name not in (COLOUR_PASS, "Mist")]
    return f"pass {own[0]!r} is EEVEE's own, and could not be matched" if own else None


def _gathered(pieces: Sequence[_Piece], wanted: NDArray[np.bool_]) -> Passes:
    """Return the passes (N, C) of the wanted pixels (H, W), in the mask's order, of pieces that were traced apart."""
    result: Passes = {}
    for name, image in pieces[0].passes.items():
        whole = np.zeros((*wanted.shape, image.shape[1]), np.float32)
        for piece in pieces:
            whole[piece.pixels] = piece.passes[name]
        result[name] = whole[wanted]
    return result


def _pilot_pixels(wanted: NDArray[np.bool_], seed: int) -> NDArray[np.bool_]:
    """Return a few of the wanted pixels (H, W), from all over the picture."""
    rows, columns = np.nonzero(wanted)
    numbers = TUNING
    count = min(max(int(numbers.matched_pilot_share * rows.size), numbers.min_matched_pilot_pixels), rows.size)
    chosen = np.random.default_rng(seed).choice(rows.size, count, replace=False)
    result = np.zeros_like(wanted)
    result[rows[chosen], columns[chosen]] = True
    return result


def _nearness(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return 1 / depth, 0 for the sky and where nothing is known."""
    known = np.isfinite(depth) & (depth > 0.0)
    return np.divide(1.0, depth, out=np.zeros_like(depth), where=known)
