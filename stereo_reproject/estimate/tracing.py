"""The traced part of a frame: holes and probes in one render, then what the probes ask for in another or two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..holes.reprojection import Reprojection
from ..images.contrast import contrast_of
from ..images.denoising import Denoising
from ..images.effects_pass import materials_of
from ..images.passes import COLOUR_PASS, NOISY_PASS, Passes, filtered, is_light
from ..settings.accuracy import Accuracy
from ..trace.fill import FillChoice, SourceCost, choose_fill
from ..trace.requests import TraceRequest
from ..trace.tuning import TRACE_TUNING
from ..warp.composite import composite
from .bias import SourceNoise, bias_of, multiplied
from .denoised_probes import look
from .probes import Probes, TileEvidence, measure, place_probes, place_regular_probes, with_refined
from .refinement import Estimate, as_rendered, choose_tiles, estimate, expected_gain, local_noise, outlier_tiles

PILOT_SPACING = 4
"""How many times further apart the probes of a pilot are."""

PILOT_FROM = 0.12
"""Share of the frame that is to be traced anyway from which a pilot is worth its render call: with fewer holes, a frame
that turns out to need everything has lost little."""

ROUNDS = 2
"""Refining renders at most."""

WORTH_A_RENDER = 0.02
"""Excess that another refining render must be expected to take away where the promise is kept without it."""

WORTH_OF_DENOISED = 0.3
"""The same for a denoised picture."""


class Tracer(Protocol):
    """The part of `pipeline.frame.Renderer` that traces."""

    def trace(self, method: str, requests: Sequence[TraceRequest]) -> list[Passes]: ...


@dataclass(frozen=True)
class FillPlanner:
    """How pixels may be traced: the fill that was asked for, what the source has cost, and why methods cannot be used
    (by method, as for `choose_fill`)."""

    asked: str
    cost: SourceCost
    blockers: Mapping[str, str | None]

    def choose(self, fraction: float, *, spacing: int | None = None, expected: float = 0.0) -> FillChoice:
        """`choose_fill` by these means."""
        return choose_fill(self.asked, fraction, self.cost, self.blockers, spacing=spacing, expected=expected)

    @staticmethod
    def spacing(method: str, spacing: int) -> int:
        """The side of the tiles that have a probe each, in pixels, when the holes are traced by this method."""
        return spacing * (TRACE_TUNING.card_probe_spacing_factor if method == "card" else 1)


@dataclass(frozen=True)
class Refinement:
    """What was traced because the probes asked for it: (H, W) pixels, by which fills, and what is left of the error.

    Without probes there is no estimate, and nothing is asked for. whole: all of the target was traced in the end, and
    so it is as good as rendered.
    """

    pixels: NDArray[np.bool_]
    fills: tuple[FillChoice, ...] = ()
    estimate: Estimate | None = None
    measured: TileEvidence | None = field(default=None, repr=False)
    whole: bool = False


class TargetEye:
    """The target eye while it is made: its passes, and (H, W) which pixels were traced, and which of them as probes.

    Starts as what was warped, of which the pixels with a reason are to be traced. Probes are traced where it is
    `watched`, because the scene may break what the accuracy promises.
    """

    def __init__(
        self,
        tracer: Tracer,
        view: str,
        means: FillPlanner,
        reprojection: Reprojection,
        accuracy: Accuracy,
        *,
        watched: bool,
        seed: int,
        denoising: Denoising | None = None,
    ) -> None:
        holes = reprojection.reasons > 0
        self.passes = warped = reprojection.passes
        self.traced = np.zeros_like(holes)
        self.probed = np.zeros_like(holes)
        self.pilot_share: float | None = None
        self._tracer, self._view, self._means = tracer, view, means
        self._holes, self._reprojection = holes, reprojection
        self._accuracy = accuracy
        self._promise = accuracy.promise if watched and not holes.all() else None
        self._contrast = None if self._promise is None else contrast_of(warped[COLOUR_PASS], ~holes)
        self._measured: TileEvidence | None = None
        self._pilot: TileEvidence | None = None
        self._seed = seed
        self._denoising = denoising
        self._wanted = np.zeros_like(holes)
        self._noisy = warped[COLOUR_PASS if denoising is None else NOISY_PASS]

    @property
    def kept(self) -> NDArray[np.bool_]:
        """(H, W): the pixels whose colour is the warped one in a denoised picture. Probes that nothing around them was
        traced with are among them: alone, they would stand out."""
        return ~self._wanted

    @property
    def refined(self) -> NDArray[np.bool_]:
        """(H, W): what was traced because the probes asked for it, the probes among it too."""
        return self._wanted & ~self._holes

    @property
    def wants_pilot(self) -> bool:
        """Whether a few probes should go ahead: the frame may turn out to be cheaper to render whole."""
        share = float(np.mean(self._holes))
        if self._promise is None or share < PILOT_FROM or self._means.asked != "auto":
            return False
        # A pilot is packed, and where a full render is the answer already there is nothing to find out.
        return not self._means.blockers.get("packed") and self._means.choose(share).method != "full"

    def send_pilot(self) -> None:
        """Trace a few probes; `pilot_share` is then the share of the frame that they expect to be refined."""
        assert self._promise is not None
        nothing = np.zeros_like(self._holes)
        measured = self._trace_probed("packed", nothing, self._accuracy.probe_spacing * PILOT_SPACING, self._seed)
        # A few probes are sure of little, and one outlier among them must not decide for a full render.
        chosen = choose_tiles(measured, self._promise, unseen=self._accuracy.unseen, sure=-1.0)
        self._pilot = measured
        self.pilot_share = float(measured.pixels[chosen].sum() / self._holes.size)

    def fill(self) -> FillChoice:
        """Trace the holes, and in the same render the probes, if there are to be any."""
        spacing = None if self._promise is None else self._accuracy.probe_spacing
        share = float(np.mean(self._holes))
        choice = self._means.choose(share, spacing=spacing, expected=self.pilot_share or 0.0)
        if choice.method == "full" and choice.predicted_seconds > 0.0:
            self._holes = np.ones_like(self._holes)
        if self._promise is None or choice.method == "full" or self._holes.all():
            self._trace(choice.method, self._holes)
            return choice
        spacing = self._means.spacing(choice.method, self._accuracy.probe_spacing)
        self._measured = self._trace_probed(choice.method, self._holes, spacing, self._seed + 1)
        return choice

    def refine(self) -> Refinement:
        """Trace as few tiles as bring the frame to what is promised, in at most ROUNDS renders, by the cheapest way.

        Tiles that were traced tell more of their neighbours than a probe does: the second render is for what they
        uncover. Where a full render is not clearly dearer, it is taken and all that is still warped is traced.
        """
        before, fills = self.traced, list[FillChoice]()
        measured = self._measured
        if measured is None or self._promise is None:
            whole = self._accuracy.promise is not None and bool(self.traced.all())
            return Refinement(np.zeros_like(before), estimate=as_rendered(self._pilot) if whole else None, whole=whole)
        while len(fills) < ROUNDS:
            worst, unseen = self._accuracy.tile_limit, self._accuracy.unseen
            chosen = choose_tiles(measured, self._promise, worst=worst, unseen=unseen)
            by_own = outlier_tiles(measured, worst, unseen=unseen) & ~chosen
            chosen |= by_own
            pixels = measured.probes.pixels_of(chosen) & ~self.traced
            if not pixels.any() or (fills and not self._worth_a_render(measured, chosen)):
                break
            fills.append(self._means.choose(float(np.mean(pixels))))
            warped = self.passes[COLOUR_PASS]
            if fills[-1].method == "full":
                self._trace("full", ~self.traced)
                return Refinement(self.traced & ~before, tuple(fills), as_rendered(measured), measured, whole=True)
            self._trace(fills[-1].method, pixels)
            self._wanted |= measured.probes.pixels_of(chosen)
            traced = self.passes[COLOUR_PASS]
            noise = local_noise(measured)
            measured = with_refined(measured, chosen, pixels, noise, warped=warped, traced=traced, by_own=by_own)
        return Refinement(self.traced & ~before, tuple(fills), estimate(measured), measured)

    def _worth_a_render(self, measured: TileEvidence, chosen: NDArray[np.bool_]) -> bool:
        assert self._promise is not None
        gain = expected_gain(measured, chosen)
        if self._denoising is not None:
            # Of which the estimate is too unsure to decide.
            return gain > WORTH_OF_DENOISED or self._accuracy.promises_worst_tiles
        kept = estimate(measured).noise_ratio <= self._promise and not self._accuracy.promises_worst_tiles
        return not kept or gain > WORTH_A_RENDER

    def _trace(self, method: str, pixels: NDArray[np.bool_]) -> None:
        if pixels.any():
            traced = self._tracer.trace(method, [TraceRequest(self._view, pixels)])[0]
            self.passes = composite(self.passes, traced, pixels)
            self.traced = self.traced | pixels
            self._wanted |= pixels | (method == "full")

    def _trace_probed(self, method: str, holes: NDArray[np.bool_], spacing: int, seed: int) -> TileEvidence:
        """Trace the holes (H, W) once and probes among the rest twice, in one render; what the probes say of the rest.

        Probes are pixels of the result too: each becomes the mean of its two traces.
        """
        assert self._contrast is not None
        warped = ~(self.traced | self._holes)
        if self._denoising is None:
            probes = place_probes(warped, self._contrast, spacing=spacing, seed=seed)
        else:
            probes = place_regular_probes(warped, spacing=spacing, seed=seed)
        twins = probes.mask
        wanted = holes | twins
        traced = self._tracer.trace(method, [TraceRequest(self._view, wanted, twins)])[0]
        count = int(wanted.sum())
        before = self.passes[COLOUR_PASS][twins]
        passes = composite(self.passes, {name: image[:count] for name, image in traced.items()}, wanted)
        once, again = passes[COLOUR_PASS][twins], traced[COLOUR_PASS][count:]
        both = {name: (passes[name][twins], traced[name][count:]) for name in passes if name in traced}
        self.passes = composite(passes, {name: _mean(*two) for name, two in both.items() if filtered(name)}, twins)
        self.traced, self.probed = self.traced | wanted, self.probed | twins
        self._wanted |= holes
        return self._measure(probes, warped, before, once, again)

    def _measure(
        self, probes: Probes, warped: NDArray[np.bool_], before: NDArray, once: NDArray, again: NDArray
    ) -> TileEvidence:
        """What the probes say of the pixels that stay warped (H, W), which are corrected by it.

        before (N, C) is what the warp has at the probes, once and again (N, C) are their traces.
        """
        assert self._contrast is not None
        shown = materials_of(self.passes)
        if self._denoising is None:
            before = self._corrected(probes, warped & ~probes.mask, before, once, again)
            return measure(probes, warped, self._contrast, before, once, again, shown=shown)
        colour = self.passes[COLOUR_PASS].copy()
        colour[probes.mask] = before
        seen = look(
            probes,
            {**self.passes, COLOUR_PASS: colour},
            # A pilot's probes keep the warped colour too.
            warped | (self.probed & ~self._wanted),
            (once, again),
            before,
            noisy=self._noisy,
            risk=self._contrast.signal,
            shown=shown,
            denoising=self._denoising,
        )
        # The traced pixels are to be denoised among neighbours that are as bright as theirs.
        noisy = self.passes[NOISY_PASS] + np.where(
            warped[..., None] & ~probes.mask[..., None], seen.colour - colour, 0.0
        )
        self.passes = {**self.passes, COLOUR_PASS: seen.colour, NOISY_PASS: np.maximum(noisy, 0.0).astype(np.float32)}
        left = self._denoising.noise_left
        at_probes, first = seen.at_probes, seen.first
        return measure(probes, warped, self._contrast, at_probes, once, again, shown=shown, denoised=left, first=first)

    def _corrected(
        self, probes: Probes, warped: NDArray[np.bool_], before: NDArray, once: NDArray, again: NDArray
    ) -> NDArray[np.float32]:
        """Take away what a noisy picture is off by in the warped pixels (H, W), all parts of its light alike.

        Returns what would be at the probes (N, 3) if their own had not been heard.
        """
        assert self._contrast is not None
        shown = materials_of(self.passes)
        kinds = np.zeros(warped.shape, np.intp) if shown is None else shown
        noise = SourceNoise.of_noisy(probes.around_and_own(probes.mean_in_tiles(self._contrast.noise, warped)))
        place = probes.rows, probes.columns
        # What a pilot has told is in the warped colours already.
        was = self._noisy[place]
        once_more = np.divide(before, was, out=np.ones_like(before), where=was > 0.0)
        sampled = self._reprojection.sampled(place) * once_more
        # The one is half a pixel aside, the other brighter because it is less noisy.
        by_sample, by_mean = (
            bias_of(probes, w, once, again, self._contrast.signal, kinds, noise=noise) for w in (sampled, before)
        )
        bias = by_sample.agreed(by_mean)
        if bias.added.any():
            factor = bias.factor(self.passes[COLOUR_PASS], warped, kinds)
            light = {name: multiplied(image, warped, factor) for name, image in self.passes.items() if is_light(name)}
            self.passes = {**self.passes, **light}
        return bias.at_probes(before, without_own=True)


def _mean(once: NDArray[np.float32], again: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N, C) of two traces; where one is no number, the other."""
    once, again = np.where(np.isfinite(once), once, again), np.where(np.isfinite(again), again, once)
    return (0.5 * once + 0.5 * again).astype(np.float32)
