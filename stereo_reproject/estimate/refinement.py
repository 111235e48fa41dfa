"""What is said of the finished frame, and which tiles are traced so that it keeps what was promised.

A plain render of the whole eye differs from another by 2 var(a). So, with W the pixels that stay warped,

    noise ratio^2 = 1 + sum over W of excess / sum over all of 2 noise.

A tile is judged by the probes around it, and by those of its materials wherever they are, but not by its own. So the
probes of the tiles that stay are as good as drawn after the choice was made, and their sum is what is left, on average:
nothing was picked because it looked good. Only tiles whose own probe stands out far beyond noise are traced for that
alone, and of them no more is taken off than was found (`with_refined`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..holes.tuning import TUNING as HOLE_TUNING
from ..images.metrics import TILE
from .probes import TileEvidence

NEIGHBOURS = 2
"""Tiles each way that tell how wrong a tile is likely to be, for the frame as a whole."""

NEAREST = 1
"""The same for the tile itself: what is wrong in a small place is not to be averaged away."""

CONFIDENT = 1.96
"""Standard errors on either side that hold 95 %."""

BEYOND_DOUBT = 10.0
"""How many times the noise around it a probe's excess must be to be no chance."""

UNMOVED = 0.25
"""Share of a tile's likely excess that does not follow its risk: what has changed its brightness, and not its place."""

MOSTLY = 0.5
"""Share of what a material shows in a denoised frame from which all of it is traced: what is wrong nearly everywhere,
as a mirror is, is so where its picture is too faint or too fine for the probes, and to trace only parts of it shows."""

ROUGHLY = 0.5
"""Standard error, as a share of it, of what denoised probes say of a tile."""

NEXT_TO_NONE = 0.01
"""Share of the frame's mean noise that a tile has at least when its error is held against it."""

SURE = 0.5
"""Standard errors by which the estimate must be within the promise before refinement stops."""


@dataclass(frozen=True)
class Estimate:
    """Noise ratio of the frame with its 95 % confidence interval."""

    noise_ratio: float
    low: float
    high: float

    @property
    def excess(self) -> float:
        """What is left of the mean squared error without noise, over that of noise: noise ratio^2 - 1."""
        return self.noise_ratio**2 - 1.0


AS_RENDERED = Estimate(1.0, float("nan"), float("nan"))
"""Of an eye that was rendered whole and of whose noise nothing is known, or that has none."""


def estimate(measured: TileEvidence) -> Estimate:
    """The frame's noise ratio, with the tiles that are refined traced."""
    if not measured.frame_noise:
        return AS_RENDERED
    if measured.left_by_second is not None:
        # Tiles were chosen by what their own first trace told.
        measured = replace(measured, left=np.where(measured.refined, measured.left, measured.left_by_second))
    excess, error = _remaining(measured, np.zeros(0, np.intp))
    return _interval(float(excess[-1]), float(error[-1]) ** 2 + _own_noise(measured, measured.refined))


def as_rendered(measured: TileEvidence | None) -> Estimate:
    """Of a frame that is traced throughout: 1, give or take what chance does to any one render."""
    if measured is None or not measured.frame_noise:
        return AS_RENDERED
    return _interval(0.0, _own_noise(measured, np.ones_like(measured.refined)))


def _own_noise(measured: TileEvidence, traced: NDArray[np.bool_]) -> float:
    """Variance of the excess from the noise that the traced pixels happen to have, with these tiles (N,) among them."""
    pixels = measured.frame_pixels - measured.pixels[~traced].sum()
    return float(pixels * np.average(measured.noise**2, weights=measured.probes.weight) / measured.frame_noise**2)


def _interval(excess: float, variance: float) -> Estimate:
    reach = CONFIDENT * np.sqrt(variance)
    return Estimate(*(float(np.sqrt(max(1.0 + value, 0.0))) for value in (excess, excess - reach, excess + reach)))


def choose_tiles(
    measured: TileEvidence, promise: float, *, worst: float = np.inf, unseen: float = 0.0, sure: float = SURE
) -> NDArray[np.bool_]:
    """(N,): the tiles to be traced beyond those that are.

    As few, worst first, as bring the frame's noise ratio down to `promise` with some certainty; and every tile whose
    own is likely to be above `worst`, noise that is less than `unseen` taken for that.
    """
    free = ~measured.refined
    if not measured.frame_noise:
        # Without noise there is no ratio to it: whatever is off so that it can be seen is traced.
        return free & (measured.excess > HOLE_TUNING.unseen_difference**2 * measured.pixels)
    likely = _likely(measured, NEIGHBOURS)[0]
    # Where nothing is likely to be gained, nothing is: what a lone probe says of its own tile is for the estimate.
    candidates = np.nonzero(free & (likely > 0.0))[0]
    order = candidates[np.argsort(-likely[candidates], kind="stable")]
    bound = _bound(measured, order, likely, sure)
    reached = np.nonzero(bound <= promise**2 - 1.0)[0]
    count = int(reached[0]) if reached.size else int(np.argmin(bound))
    chosen = np.zeros(free.size, bool)
    chosen[order[:count]] = True
    if np.isfinite(worst):
        chosen |= free & _beyond(measured, worst, unseen)
    return chosen | (free & _mostly_traced(measured, chosen, unseen))


def _mostly_traced(measured: TileEvidence, chosen: NDArray[np.bool_], unseen: float) -> NDArray[np.bool_]:
    """(N,): tiles of a denoised picture on whose material most tiles are chosen (N,), or were before.

    But none where nothing is to be seen that may have moved: around there too, contrast is less than `unseen`.
    """
    if measured.likely is None or measured.materials is None:
        return np.zeros_like(chosen)
    material, pixels, probes = measured.materials.of_probe, measured.pixels, measured.probes
    traced = chosen | measured.refined
    shown = np.bincount(material, weights=pixels)
    mostly = np.bincount(material, weights=pixels * traced) >= MOSTLY * np.maximum(shown, 1.0)
    return mostly[material] & (probes.around_and_own(measured.risk) >= unseen**2 * probes.around_and_own(pixels))


def _bound(measured: TileEvidence, order: NDArray[np.intp], likely: NDArray, sure: float) -> NDArray[np.float64]:
    """(K + 1,): what is to come down to the promise's excess when the first k tiles of `order` (K,) are traced.

    The excess of the frame with some certainty. What single traces say of a denoised picture is nearly all noise: there
    it is what tiles are likely (N,) to have.
    """
    if measured.likely is None:
        excess, error = _remaining(measured, order)
        return excess + sure * error
    left = np.where(measured.refined, 0.0, likely * measured.pixels)
    gone = np.concatenate([[0.0], np.cumsum(left[order])])
    return (left.sum() - gone) / measured.frame_noise


def _believed(measured: TileEvidence) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N,) excess of a pixel of each tile of a denoised picture, and its standard error.

    What the denoised probes tell of each, or the others' traces where those tell of more beyond chance; in all no more
    than all traces together allow.
    """
    assert measured.likely is not None
    all_told, doubt = _remaining(measured, np.zeros(0, np.intp))
    allowed = max(float(all_told[-1] + doubt[-1]), 0.0) * measured.frame_noise
    scale = min(1.0, allowed / max(float(measured.likely.sum()), 1e-30))
    likely = scale * measured.likely / measured.pixels
    for reach in (NEIGHBOURS, NEAREST):
        told, error = _with_materials(measured, *_nearby(measured, reach))
        likely = np.maximum(likely, np.where(told > CONFIDENT * error, told, 0.0))
    return likely, ROUGHLY * likely


def outlier_tiles(measured: TileEvidence, worst: float, *, unseen: float = 0.0) -> NDArray[np.bool_]:
    """(N,): tiles whose own probe alone says, beyond all doubt, that their noise ratio is above `worst`."""
    if measured.likely is not None:
        return np.zeros_like(measured.refined)
    noise = np.maximum(local_noise(measured), max(float(np.median(measured.noise)), unseen**2))
    limit = 2.0 * (worst**2 - 1.0) * noise * measured.pixels
    doubt = BEYOND_DOUBT * measured.traced_noise * noise * measured.probes.weight
    return ~measured.refined & (measured.excess > np.maximum(limit, doubt))


def expected_gain(measured: TileEvidence, chosen: NDArray[np.bool_]) -> float:
    """Excess of the frame over its noise that tracing the chosen tiles (N,) is likely to take away."""
    if not measured.frame_noise:
        return 0.0
    likely = _likely(measured, NEAREST)[0] * measured.pixels
    return float(likely[chosen].sum()) / measured.frame_noise


def worst_tiles(measured: TileEvidence) -> float:
    """What `metrics.worst_tiles` is likely to be, but for chance: a second plain render too is above 1 by that.

    Each tile is judged by those around it and by its materials: what is wrong in one alone is told too low.
    """
    if not measured.frame_noise:
        return 1.0
    probes = measured.probes
    ratio = np.zeros(probes.tile_grid)
    # Tiles without a probe are traced throughout: nothing is off there.
    ratio[probes.tiles] = np.maximum(_over_noise(measured)[0], 0.0)
    block = max(1, TILE // probes.spacing)
    rows, columns = (np.arange(0, size, block) for size in ratio.shape)
    sums, counts = (np.add.reduceat(np.add.reduceat(a, rows), columns, axis=1) for a in (ratio, np.ones_like(ratio)))
    return float(np.percentile(np.sqrt(1.0 + sums / counts), 99.0))


def tile_estimates(measured: TileEvidence) -> NDArray[np.float64]:
    """(N, 3): noise ratio of each tile, and the ends of its 95 % interval.

    Told as in `worst_tiles`. 1 for what was refined; not a number where there is no noise at all.
    """
    if not measured.frame_noise:
        return np.full((measured.refined.size, 3), np.nan)
    excess, error = _over_noise(measured)
    ends = excess[:, None] + CONFIDENT * error[:, None] * np.array([0.0, -1.0, 1.0])
    return np.sqrt(np.maximum(1.0 + ends, 0.0))


def _over_noise(measured: TileEvidence) -> tuple[NDArray, NDArray]:
    """(N,) likely excess of each tile over the noise of two plain renders, and its standard error; 0 where refined.

    As in `metrics.worst_tiles`, what is quieter than most is as noisy as those; where most is sky, as a hundredth
    of the mean.
    """
    noise = local_noise(measured)
    floor = float(np.median(noise))
    if not floor:
        # Most of the frame is noiseless: black, or nothing but light.
        floor = float(np.median(noise[noise > 0.0])) if noise.any() else measured.mean_noise
    floor = max(floor, NEXT_TO_NONE * measured.mean_noise)
    per_noise = np.where(measured.refined, 0.0, 0.5 / np.maximum(noise, floor))
    likely, error = _likely(measured, NEAREST)
    return per_noise * likely, per_noise * error


def _remaining(measured: TileEvidence, order: NDArray[np.intp]) -> tuple[NDArray, NDArray]:
    """(K + 1,) excess of the frame over its noise when the first k tiles of `order` (K,) are traced too, and its
    standard error: that of a ratio of two sums over the same probes (linearized), each tile a stratum."""
    noise, weight = measured.frame_noise, measured.probes.weight
    gone = np.concatenate([[0.0], np.cumsum(measured.left[order])])
    excess = (measured.left.sum() - gone) / noise
    share = 2.0 * measured.frame_pixels * weight * (measured.noise - measured.mean_noise) / weight.sum() / noise
    own = measured.left / noise
    # sum over all of (own - excess share)^2, without `own` for the tiles that are traced
    taken = own[order]
    squares = np.sum(own**2) - np.concatenate([[0.0], np.cumsum(taken**2)])
    products = np.sum(own * share) - np.concatenate([[0.0], np.cumsum(taken * share[order])])
    variance = squares - 2.0 * excess * products + excess**2 * np.sum(share**2)
    return excess, np.sqrt(np.maximum(variance, 0.0))


def _likely(measured: TileEvidence, reach: int) -> tuple[NDArray, NDArray]:
    """(N,) excess of a pixel of each tile, judged by those around it and by its materials, its own probe left out; and
    the standard error of that."""
    if measured.likely is not None:
        return _believed(measured)
    return _with_materials(measured, *_nearby(measured, reach))


def _with_materials(measured: TileEvidence, nearby: NDArray, error: NDArray) -> tuple[NDArray, NDArray]:
    """`_likely`, from what those around each tell and the standard error of that."""
    if measured.materials is None:
        return nearby, error
    likely, more = measured.materials.likely(nearby * measured.pixels)
    return likely / measured.pixels, np.hypot(error, more / measured.pixels)


def _nearby(measured: TileEvidence, reach: int) -> tuple[NDArray, NDArray]:
    """The same judged by the risk of the tile and the excess over the risk of those around it."""
    around = measured.probes.around(measured.excess, reach)
    risk = np.maximum(np.maximum(measured.probes.around(measured.risk, reach), measured.risk), 1e-30)
    pixels = np.maximum(measured.probes.around(measured.pixels, reach), 1.0)
    # What a refined tile has is known; of the others each is known by one probe.
    chance = measured.probes.around(np.where(measured.refined, 0.0, measured.excess) ** 2, reach)
    per_pixel = (1.0 - UNMOVED) * measured.risk / risk / measured.pixels + UNMOVED / pixels
    return around * per_pixel, np.sqrt(np.maximum(chance, 0.0)) * per_pixel


def local_noise(measured: TileEvidence) -> NDArray[np.float64]:
    """(N,): variance of one traced pixel in each tile.

    Probes around tell it, but beside something noisy they tell too much; so does the picture's own noise where it has a
    fine texture. What is noise to both is taken, the latter at the scale that the former give it over the frame.
    """
    told, seen = measured.noise_around, measured.seen_noise
    known = seen > 0.0
    own = measured.probes.weight * measured.noise
    if not own[known].any():
        return told
    # Each probe has a say by its own noise: beside noise there may be more texture than quiet, which tells no scale.
    scale = _weighted_median(told[known] / seen[known], own[known])
    return np.where(known, np.minimum(told, scale * seen), told)


def _weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    order = np.argsort(values)
    upto = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(upto, 0.5 * upto[-1])])


def _beyond(measured: TileEvidence, worst: float, unseen: float) -> NDArray[np.bool_]:
    """(N,): tiles that are likely to have a noise ratio above `worst`, as `metrics.worst_tiles` measures it.

    Or of which those around it alone are sure of that: a material may be wrong in one small place.
    """
    noise = local_noise(measured)
    allowed = (worst**2 - 1.0) * 2.0 * np.maximum(noise, max(float(np.median(noise)), unseen**2))
    if measured.likely is not None:
        return _believed(measured)[0] > allowed
    nearby, doubt = _nearby(measured, NEAREST)
    likely, error = _with_materials(measured, nearby, doubt)
    return ((likely > allowed) & (likely > error)) | ((nearby > allowed) & (nearby > CONFIDENT * doubt))
