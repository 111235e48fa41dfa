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
from ..images.seen_light import scaled_light
from ..matching.matching import Correction, TracedPixels, correction_of, match, ring_of
from ..trace.fill import FillChoice, SourceCost
from ..trace.requests import TraceRequest
from ..trace.tuning import TUNING as TRACE_TUNING
from .tuning import TUNING

SECOND_RENDER = "a second EEVEE render"

NO_PROBES = "Cycles' light is not EEVEE's, and spot checks cannot tell that from an error"


class LightMatcher(Protocol):
    """A tracer of another engine than the one that rendered the source, with all that matching its light needs."""

    def trace(self, method: str, requests: Sequence[TraceRequest]) -> list[Passes]:
        """Trace pixels by one fill method and return their passes, as `trace.requests.Tracer` says."""
        ...

    def traced_features(self, passes: Passes) -> TracedPixels:
        """Return light and surfaces of traced pixels, for `matching.match`, from the passes (N, C) that `trace`
        returned for them."""
        ...

    def clean(self, colour: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return a scene-linear picture (H, W, 3) without its noise."""
        ...

    def trace_cost(self) -> SourceCost:
        """Return the cost of the last call of `trace`, in seconds."""
        ...

    def unmatchable(self) -> str | None:
        """Return the reason, in words, why traced pixels of this scene cannot be matched to the source's light; None if
        they can."""
        ...


def foreseen_fill(asked: str, blockers: Mapping[str, str | None], unmatchable: str | None) -> tuple[str, str]:
    """Return the fill method and the reason for it in words, as far as the scene tells before anything is rendered.

    asked is a method or 'auto'; blockers are as for `choose_fill`; unmatchable is as `LightMatcher` has it.
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
    """Traced pixels: a mask (H, W) of them, and their passes (N, C), row by row."""

    pixels: NDArray[np.bool_]
    passes: Passes


class MatchedTracing:
    """Completes a warped target with another engine than the source's; the `TargetTracing` without probes.

    Traced pixels are matched to the source's light. Nothing is probed: the engines differ everywhere, and no estimate
    could tell that from a wrong warp.
    """

    pilot_share: float | None = None
    wants_pilot = False
    can_promise = False

    def __init__(self, matcher: LightMatcher, warped: WarpedTarget) -> None:
        reprojection = warped.reprojection
        self.target = Target.of_warp(warped.view, reprojection.passes, reprojection.reasons)
        self.correction: Correction | None = None
        self._matcher, self._planner, self._reprojection = matcher, warped.planner, reprojection
        self._accuracy, self._seed, self._light_scale = warped.accuracy, warped.seed, warped.light_scale
        self._unmatchable: str | None = None

    @property
    def _holes(self) -> NDArray[np.bool_]:
        """Holes (H, W) of the target, traced by now or not."""
        return self.target.any_of(Provenance.HOLE)

    def send_pilot(self) -> None:
        """Do nothing: the cost of matched pixels is found out while the holes are traced, and no pilot is ever
        wanted."""

    def fill(self) -> FillChoice:
        """Trace the holes and the ring around them, and match them; or render the whole target where that is cheaper or
        the only way.

        Returns the fill method that was chosen, and why.
        """
        holes = self._holes
        if not holes.any():
            return FillChoice("packed" if not self._planner.blockers.get("packed") else "full", "no hole to fill", 0.0)
        choice = self._before_tracing()
        if choice.method != "full":
            choice = self._trace_matched(choice, ring_of(holes, self._reprojection.warp.covered))
        if choice.method == "full":
            everything = np.ones_like(holes)
            whole = scaled_light(self._traced("full", everything), self._light_scale)
            self.target.put(everything, whole)
            self.target = self.target.flagged(everything, Provenance.HOLE)
        return choice

    def refine(self) -> Refinement:
        """Trace nothing, and return the outcome as far as it is known without probes.

        A target that was rendered whole is as good as rendered; of any other there is no estimate.
        """
        whole = self._accuracy.promise is not None and bool(self.target.traced.all())
        nothing = np.zeros_like(self._holes)
        told = AS_RENDERED if whole else None
        return Refinement(nothing, estimate=told, whole=whole, no_estimate=NO_PROBES)

    def _traced(self, method: str, pixels: NDArray[np.bool_]) -> Passes:
        """Return the passes (N, C) of pixels (H, W) of the target, traced by this fill method and neither matched nor
        scaled."""
        [passes] = self._matcher.trace(method, [TraceRequest(self.target.view, pixels)])
        return passes

    def _before_tracing(self) -> FillChoice:
        """Return the choice of a fill method as far as it can be made before anything is traced.

        It also notes in `_unmatchable` why traced pixels cannot be matched, if so.
        """
        planner, again = self._planner, self._planner.cost.seconds
        self._unmatchable = self._matcher.unmatchable() or _unmatched_pass(self.target.passes)
        method, reason = foreseen_fill(planner.asked, planner.blockers, self._unmatchable)
        if planner.asked == "auto" and method != "full" and again < TUNING.min_seconds_to_hand_over:
            method = "full"
            reason = f"{SECOND_RENDER}, predicted {again:.1f} s: handing the scene to Cycles would take as long"
        return FillChoice(method, reason, again if method == "full" else 0.0)

    def _trace_matched(self, choice: FillChoice, ring: NDArray[np.bool_]) -> FillChoice:
        """Trace the holes and the ring (H, W), and put them into the target, matched; return the choice with its
        reason.

        Where there is a choice, a pilot of a few pixels goes ahead. If it says that a full render is cheaper, nothing
        more is done, and the choice of that is returned.
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
        """Return the seconds that the wanted pixels (H, W) after the pilot's, `ahead` (H, W), are predicted to take."""
        cost = self._matcher.trace_cost()
        count = int(ahead.sum())
        rest = int(wanted.sum()) - count
        return cost.fixed(self._planner.costs) + cost.per_frame * rest / count if rest else 0.0

    def _put(self, traced: Passes, wanted: NDArray[np.bool_], ring: NDArray[np.bool_]) -> None:
        """Put the traced pixels into the target's holes, their colours matched to the picture and without noise; set
        `correction`.

        traced has the passes (N, C) of the wanted pixels (H, W), not scaled: holes and ring (H, W). The ring's pixels
        keep their warped colour and are flagged as reference.
        """
        holes, warped = self._holes, self.target.colour.copy()
        features = self._matcher.traced_features(traced).scaled(self._light_scale)
        traced = scaled_light(traced, self._light_scale)
        doubted = (self._reprojection.reasons == Reason.SILHOUETTE.bit) & self._reprojection.warp.covered
        nearness = _nearness(self.target.passes[DEPTH_PASS][..., 0])
        matched = match(warped[..., :3], features, wanted, known=ring, doubted=doubted, nearness=nearness)
        within = holes[wanted]
        kept = {name: image[within] for name, image in traced.items()}
        alpha = kept[COLOUR_PASS][:, 3:]
        kept[COLOUR_PASS] = np.concatenate([matched[within], alpha], axis=1)
        self.target = self.target.flagged(ring, Provenance.REFERENCE)
        self.target.put(holes, kept)
        clean = self._matcher.clean(self.target.colour[..., :3])[holes]
        self.correction = correction_of(clean, features.colour[within], warped)
        self.target.put(holes, {COLOUR_PASS: np.concatenate([clean, alpha], axis=1)})


def _unmatched_pass(passes: Passes) -> str | None:
    """Return the reason, in words, why the source's passes cannot be matched: one is a light pass that only its engine
    has.

    None where there is no such pass.
    """
    own = [name for name in passes if filtered(name) and name not in (COLOUR_PASS, "Mist")]
    return f"pass {own[0]!r} is EEVEE's own, and could not be matched" if own else None


def _gathered(pieces: Sequence[_Piece], wanted: NDArray[np.bool_]) -> Passes:
    """Return the passes (N, C) of the wanted pixels (H, W), row by row, put together from pieces that were traced
    apart."""
    result: Passes = {}
    for name, image in pieces[0].passes.items():
        whole = np.zeros((*wanted.shape, image.shape[1]), np.float32)
        for piece in pieces:
            whole[piece.pixels] = piece.passes[name]
        result[name] = whole[wanted]
    return result


def _pilot_pixels(wanted: NDArray[np.bool_], seed: int) -> NDArray[np.bool_]:
    """Return a few of the wanted pixels (H, W), drawn by chance from all over the picture."""
    rows, columns = np.nonzero(wanted)
    numbers = TUNING
    count = min(max(int(numbers.matched_pilot_share * rows.size), numbers.min_matched_pilot_pixels), rows.size)
    chosen = np.random.default_rng(seed).choice(rows.size, count, replace=False)
    result = np.zeros_like(wanted)
    result[rows[chosen], columns[chosen]] = True
    return result


def _nearness(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return 1 / depth (H, W), and 0 for the sky and where no depth is known."""
    known = np.isfinite(depth) & (depth > 0.0)
    return np.divide(1.0, depth, out=np.zeros_like(depth), where=known)
