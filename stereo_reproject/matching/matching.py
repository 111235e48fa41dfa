"""Pixels that one engine has traced, matched to a picture that another has rendered.

The light of two engines differs, and not by a constant: what one puts in shadow is bright in the other. A ring of
pixels around the holes is known to both. On it a law is learned by which the picture follows from the traced pixels:
from their light, and from how their surfaces reflect and in which direction. The law holds for the holes too. The rest
of the difference on the ring is spread over each hole by a membrane that hardly reaches over edges. Traced features
are filtered over the pixel as colours are, and the law is linear: so edges stay as smooth as they were traced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..images.masks import dilate
from ..images.metrics import tone, untone
from .membrane import Bonds, spread
from .tuning import TUNING

COLOUR_FEATURE = 0
"""Index of the traced light among the features, whose weight is 1 as long as the ring says nothing else."""

FEATURE_SIZE_MARGIN = 1e-9
"""Size that is added to a feature's root mean square, so that one that is 0 everywhere divides nothing by 0."""

MIN_NEARNESS = 1e-6
"""Nearness, in 1 / scene units, below which all is taken to be equally far: the sky's 0 has no logarithm."""


@dataclass(frozen=True)
class TracedPixels:
    """Light and surfaces of N traced pixels; colours are scene-linear.

    colour (N, 3) is all of the light, and emitted (N, 3) the part of it that comes straight from lamps, sky and glowing
    surfaces, which every engine shows alike. albedo and specular (N, 3), 0 to 1, are how the surface reflects. normal
    (N, 3) is in any frame of axes, and 0 where there is none. nearness (N,) is 1 / depth at the pixel's centre, 0 for
    the sky; mean_depth (N,) is the mean over the pixel of all that is not sky, in scene units. refracts (N,) is set
    where the albedo holds light that was refracted, so that it tells nothing of the surface.
    """

    colour: NDArray[np.float32]
    emitted: NDArray[np.float32]
    albedo: NDArray[np.float32]
    specular: NDArray[np.float32]
    normal: NDArray[np.float32]
    nearness: NDArray[np.float32]
    mean_depth: NDArray[np.float32]
    refracts: NDArray[np.bool_]

    def scaled(self, scale: float) -> TracedPixels:
        """Return the same pixels with their light multiplied by `scale`; their surfaces stay as they are."""
        return replace(self, colour=self.colour * np.float32(scale), emitted=self.emitted * np.float32(scale))

    def features(self) -> NDArray[np.float32]:
        """Return K features of each pixel and channel, (N, 3, K), of which a picture's light is fitted as a linear
        function.

        They are the traced light that is not emitted, the albedo, the albedo times each axis of the normal, specular,
        and 1 where there is a surface. With the albedo times the normal, light from all around that a matte surface
        reflects is nearly linear.
        """
        by_normal = (self.albedo * self.normal[:, axis, None] for axis in range(3))
        surface = np.broadcast_to(np.linalg.norm(self.normal, axis=1, keepdims=True), self.albedo.shape)
        return np.stack([self.colour - self.emitted, self.albedo, *by_normal, self.specular, surface], axis=-1)


@dataclass(frozen=True)
class Correction:
    """Size of the change that matching made to traced pixels.

    mean and p95 are the mean and the 95th percentile of the difference after `metrics.tone`, both as a share of the
    picture's mean after it.
    """

    mean: float
    p95: float


def ring_of(holes: NDArray[np.bool_], covered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the ring (H, W) of pixels around the holes (H, W) that both engines know: beside a hole, and covered (H,
    W) by the warp."""
    return dilate(holes, TUNING.ring_px) & covered & ~holes


def match(
    picture: NDArray[np.float32],
    traced: TracedPixels,
    domain: NDArray[np.bool_],
    *,
    known: NDArray[np.bool_],
    doubted: NDArray[np.bool_],
    nearness: NDArray,
) -> NDArray[np.float32]:
    """Return the colours (N, 3) of the N pixels of `domain` (H, W), as the engine of the picture would render them.

    traced holds these pixels as the other engine traced them, in the mask's order. picture (H, W, 3, scene-linear) and
    nearness (H, W, 1 / depth) count where `known` (H, W) is set. Where `doubted` (H, W) is set, at silhouettes, the
    picture shows the right surface but mixes it with the wrong background: it counts there as far as the tracer cannot
    tell.
    """
    same = _same_surface(nearness[domain], traced.nearness)
    compared = known[domain] & same
    base = _learned(traced, picture[domain] - traced.emitted, compared) + traced.emitted
    gap = np.zeros((*domain.shape, 3), np.float32)
    gap[domain] = np.where(compared[:, None], picture[domain] - base, 0.0)
    weight = np.zeros(domain.shape, np.float32)
    weight[domain] = compared
    correction = spread(gap, weight, domain, _bonds(traced, domain))
    sides = _sides(traced, domain)
    result = np.maximum(base + _mixed(correction, traced, domain, sides), 0.0)
    refracts = np.zeros_like(domain)
    refracts[domain] = traced.refracts
    refracts = dilate(refracts, 1)[domain]
    mixed = (doubted & _beside_edges(traced, domain, nearness))[domain]
    share = np.where(mixed, _picture_share(tone(result) - tone(base), same), 0.0)
    least = TUNING.min_refracting_share
    share = np.where(refracts & doubted[domain], np.maximum(share, least), share).astype(np.float32)[:, None]
    # Mixed after tone mapping: a highlight of the one would drown the other.
    toned = share * tone(picture[domain]) + (1.0 - share) * tone(result)
    if refracts.any():
        seen = known | doubted
        both = [1.0 / depth[refracts] for depth in sides[:2]]
        toned[refracts] = _within_both_sides(
            toned[refracts], np.argwhere(domain)[refracts], both, tone(picture), nearness, seen
        )
    return np.where((share > 0.0) | refracts[:, None], untone(toned), result)


def _picture_share(unexplained: NDArray, same: NDArray[np.bool_]) -> NDArray:
    """Return the weight (N,), 0 to 1, that the picture has in silhouettes; the rest is that of the matched light.

    unexplained (N, 3) is the part of the matched light, after tone mapping, that the learned law does not explain; same
    (N,) is set where picture and tracer show the same surface.
    """
    squared = np.mean(np.abs(unexplained), axis=-1) ** 2
    least = TUNING.min_silhouette_share
    share = least + (1.0 - least) * squared / (squared + TUNING.unexplained_step**2)
    return np.where(same, share, TUNING.other_depth_factor * share)


def correction_of(matched: NDArray, traced: NDArray, picture: NDArray) -> Correction:
    """Return the size of the change from traced to matched colours (N, 3), as a share of a picture's (H, W, >= 3)
    brightness.

    All are scene-linear. It is 0 where nothing was matched, or the picture is black.
    """
    brightness = float(np.mean(tone(picture)))
    if matched.size == 0 or brightness == 0.0:
        return Correction(0.0, 0.0)
    change = np.mean(np.abs(tone(matched) - tone(traced)), axis=-1) / brightness
    return Correction(float(change.mean()), float(np.percentile(change, 95.0)))


def _learned(traced: TracedPixels, wanted: NDArray, kept: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return colours (N, 3) of all pixels, by the linear function of their features that best gives the wanted colours.

    The function is learned on the pixels that are set in `kept` (N,); wanted (N, 3) is the picture's light there,
    without the emitted part, and so is the result. The fit is least squares of the difference after tone mapping, with
    a ridge towards the traced light itself.
    """
    features = traced.features()
    result = np.empty_like(traced.colour)
    prior = np.zeros(features.shape[2])
    prior[COLOUR_FEATURE] = 1.0
    for channel in range(3):
        of_all = features[:, channel].astype(np.float64)
        target = wanted[kept, channel].astype(np.float64)
        # The slope of x / (1 + x).
        slope = 1.0 / (1.0 + np.maximum(target + traced.emitted[kept, channel], 0.0)) ** 2
        rows = of_all[kept] * slope[:, None]
        size = np.sqrt(np.mean(np.square(of_all), axis=0)) + FEATURE_SIZE_MARGIN
        ridge_pixels = TUNING.feature_ridge * len(rows) + TUNING.prior_pixels
        ridge = ridge_pixels * float(np.mean(slope**2)) if len(rows) else 1.0
        normal_matrix = (rows / size).T @ (rows / size) + ridge * np.eye(len(size))
        weights = np.linalg.solve(normal_matrix, (rows / size).T @ (target * slope) + ridge * prior * size) / size
        result[:, channel] = of_all @ weights
    return result


def _bonds(traced: TracedPixels, domain: NDArray[np.bool_]) -> Bonds:
    """Return the membrane's bonds between neighbours in the domain (H, W): 1 where they are alike, min_bond across an
    edge.

    They get weaker the more two traced pixels differ in nearness, albedo or normal.
    """
    known = np.zeros((*domain.shape, 7), np.float32)
    albedo = np.minimum(traced.albedo + traced.specular, 1.0) / TUNING.albedo_step
    nearness = np.log(np.maximum(traced.nearness, MIN_NEARNESS))[:, None] / TUNING.nearness_step
    known[domain] = np.concatenate([nearness, albedo, traced.normal / TUNING.normal_step], axis=1)
    within = Bonds.within(domain)
    right = np.square(np.diff(known, axis=1)).sum(axis=-1)
    down = np.square(np.diff(known, axis=0)).sum(axis=-1)
    least = TUNING.min_bond
    return Bonds(within.right * np.maximum(np.exp(-right), least), within.down * np.maximum(np.exp(-down), least))


def _beside_edges(traced: TracedPixels, domain: NDArray[np.bool_], nearness: NDArray) -> NDArray[np.bool_]:
    """Return the pixels (H, W) that are at most one pixel away from a pixel at an edge of depth.

    A silhouette elsewhere is one that the source saw beside a thing that the target does not see there: it would show
    as a ghost. nearness (H, W) is the picture's; in the domain (H, W) that of the traced pixels replaces it.
    """
    whole = nearness.astype(np.float32)
    whole[domain] = traced.nearness
    edges = np.zeros(domain.shape, bool)
    for axis, ahead, behind in ((0, np.s_[1:], np.s_[:-1]), (1, np.s_[:, 1:], np.s_[:, :-1])):
        greater = np.maximum(whole[ahead], whole[behind])
        step = np.abs(np.diff(whole, axis=axis)) > TUNING.nearness_step * greater
        edges[ahead] |= step
        edges[behind] |= step
    return dilate(edges, 1)


def _within_both_sides(
    toned: NDArray,
    places: NDArray[np.intp],
    sides: Sequence[NDArray],
    picture: NDArray[np.float32],
    nearness: NDArray,
    seen: NDArray[np.bool_],
) -> NDArray:
    """Return colours (K, 3), after tone mapping, held within the range of the picture's colours around their pixels.

    toned (K, 3) are the colours before, places (K, 2) the pixels' rows and columns. picture (H, W, 3) is tone-mapped.
    Only those of its pixels count that are set in `seen` (H, W) and whose nearness (H, W) is that of the near or the
    far side of the pixel's edge; sides holds the nearness (K,) of either. Where not both sides are found around a
    pixel, its colour is left as it is.
    """
    rows, columns = places.T
    low, high = np.full_like(toned, np.inf), np.full_like(toned, -np.inf)
    met = np.zeros((2, rows.size), bool)
    reach = TUNING.refracting_reach_px
    border = (reach, reach)
    picture = np.pad(picture, (border, border, (0, 0)))
    nearness, seen = np.pad(nearness, (border, border)), np.pad(seen, (border, border))
    for down, right in np.ndindex(2 * reach + 1, 2 * reach + 1):
        there = rows + down, columns + right
        same = np.array([seen[there] & _same_surface(nearness[there], side) for side in sides])
        met |= same
        either = same.any(axis=0)[:, None]
        low = np.where(either, np.minimum(low, picture[there]), low)
        high = np.where(either, np.maximum(high, picture[there]), high)
    return np.where(met.all(axis=0)[:, None], np.clip(toned, low, high), toned)


def _same_surface(a: NDArray, b: NDArray) -> NDArray[np.bool_]:
    """Return (N,) whether two nearnesses (N,) differ so little that they belong to the same surface."""
    return np.abs(a - b) <= TUNING.max_same_surface_step * np.maximum(a, b)


def _sides(traced: TracedPixels, domain: NDArray[np.bool_]) -> tuple[NDArray, NDArray, NDArray]:
    """Return the least and the greatest depth (N,) among the 3 x 3 pixels around each traced pixel, and all nine (N,
    9).

    The nine are NaN where they are not traced, that is, outside the domain (H, W).
    """
    depth = np.full(domain.shape, np.nan, np.float32)
    with np.errstate(divide="ignore"):
        depth[domain] = 1.0 / traced.nearness
    around = _windows(depth, np.nonzero(domain))
    return np.fmin.reduce(around, axis=1), np.fmax.reduce(around, axis=1), around


def _mixed(
    correction: NDArray[np.float32],
    traced: TracedPixels,
    domain: NDArray[np.bool_],
    sides: tuple[NDArray, NDArray, NDArray],
) -> NDArray[np.float32]:
    """Return the correction (N, 3) for each traced pixel: the membrane's own, but at an edge of depth a mix of both
    sides'.

    There each side's mean correction counts by its share of the pixel. correction (H, W, 3) is the membrane; sides is
    the result of `_sides`.
    """
    near, far, around = sides
    places = np.nonzero(domain)
    edge = np.nonzero(far > (1.0 + TUNING.nearness_step) * near)[0]
    near, far, around = near[edge], far[edge], around[edge]
    share = _near_share(traced, domain, edge, near, far, np.isinf(around))
    with np.errstate(invalid="ignore"):
        # Compared as nearness, in which the sky is no farther than other things far away.
        is_near = 2.0 / around > 1.0 / near[:, None] + 1.0 / far[:, None]
    known = ~np.isnan(around)
    places = (places[0][edge], places[1][edge])
    values = np.stack([np.nan_to_num(_windows(correction[..., k], places)) for k in range(3)], axis=-1)
    of_near, of_far = (_mean_of(values, chosen & known) for chosen in (is_near, ~is_near))
    result = correction[domain]
    result[edge] = share[:, None] * of_near + (1.0 - share[:, None]) * of_far
    return result


def _near_share(
    traced: TracedPixels, domain: NDArray[np.bool_], edge: NDArray, near: NDArray, far: NDArray, sky: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Return the share (K,), 0 to 1, of K pixels at edges that the nearer side covers.

    edge (K,) are their indices among the traced pixels. It follows from a pixel's mean depth, and before the sky from
    how much of the sky's light is left. near and far (K,) are the depths of both sides; sky (K, 9) is set where one of
    the 3 x 3 pixels shows sky.
    """
    mean = traced.mean_depth[edge]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (far - mean) / (far - near)
    light = np.zeros(domain.shape, np.float32)
    light[domain] = traced.emitted.sum(axis=1)
    brightest = np.where(sky, np.nan_to_num(_windows(light, [place[edge] for place in np.nonzero(domain)])), 0.0).max(
        axis=1
    )
    before_sky = 1.0 - np.divide(light[domain][edge], brightest, out=np.zeros_like(mean), where=brightest > 0.0)
    return np.clip(np.where(np.isinf(far), before_sky, share), 0.0, 1.0)


def _mean_of(values: NDArray[np.float32], chosen: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return the mean (K, 3) of those of nine colours (K, 9, 3) that are chosen (K, 9); 0 where none is."""
    count = np.maximum(chosen.sum(axis=1), 1)
    return ((values * chosen[..., None]).sum(axis=1) / count[:, None]).astype(np.float32)


def _windows(image: NDArray[np.float32], places: Sequence[NDArray[np.intp]]) -> NDArray[np.float32]:
    """Return (K, 9) the 3 x 3 pixels of an image (H, W) around K places, row by row; NaN outside the image.

    places is their rows (K,) and columns (K,).
    """
    padded = np.pad(image, 1, constant_values=np.nan)
    rows, columns = places
    return np.stack([padded[rows + i, columns + j] for i in range(3) for j in range(3)], axis=-1)
