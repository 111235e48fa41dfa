"""Pixels that one engine has traced, matched to a picture that another has rendered.

The light of two engines differs, and not by a constant: what one puts in shadow is bright in the other. A ring of
pixels around the holes is known to both. From it is learned how the picture follows from what the tracer tells of a
pixel (its light, and how it reflects from where), which holds for the holes too; what is left of the difference on the
ring is spread over each hole by a membrane that does not reach over edges. What the tracer tells is filtered over the
pixel as colours are, and the picture follows from it linearly: so edges stay as smooth as they were traced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.masks import dilate
from ..images.metrics import tone, untone
from .membrane import Bonds, spread

RING = 1
"""Pixels around the holes that are traced to be compared. Wider rings gave nothing but cost: the membrane averages."""

SAME_DEPTH = 0.03
"""Difference of two depths, as a share, up to which they are of the same surface."""

BENT = 0.05
"""Difference in nearness, as a share, over which the membrane hardly reaches; likewise those of colour and normal."""
ALBEDO_STEP, NORMAL_STEP = 0.3, 0.5

LEAK = 1e-3
"""How firmly what an edge parts is still tied: a surface without any ring follows its surroundings."""

DOUBT = 1e-5
"""Share of its own size by which a feature must explain the picture to be believed."""

TRUST, UNEXPLAINED = 0.3, 0.05
"""Share of the picture in a silhouette that the tracer can tell, and how much of one (after tone mapping) may rest on
what is only spread over it until the picture counts as much. Tried on a room and on a vase of glass, where it took the
error of silhouettes from 0.030 and 0.066 to 0.023 and 0.037."""

ELSEWHERE = 0.5
"""Of that share, how much where the picture shows another depth than the tracer: the one may have the near side of an
edge there and the other the far one, or not have what is a pixel wide."""

REFRACTING = 0.5
"""Share of the picture in a silhouette of what refracts, at least: one engine shows there what the other may not."""

NEAR = 3
"""Pixels each way from which the colours are that such a pixel may have."""

PRIOR_PIXELS = 0.5
"""As many pixels of the ring outweigh that both engines are taken to see the same light."""


@dataclass(frozen=True)
class Traced:
    """What the tracer tells of N pixels, in scene-linear colour.

    colour (N, 3); seen (N, 3): the light in it that comes straight from what shines, lamps and sky, which every engine
    shows alike; albedo and specular (N, 3), that light left out; normal (N, 3) in any frame, 0 where there is none;
    nearness (N,) at the pixel's centre, 0 for the sky, and mean_depth (N,) over the pixel, of whatever is not sky;
    refracts (N,): what is told of its albedo is light that it refracts.
    """

    colour: NDArray[np.float32]
    seen: NDArray[np.float32]
    albedo: NDArray[np.float32]
    specular: NDArray[np.float32]
    normal: NDArray[np.float32]
    nearness: NDArray[np.float32]
    mean_depth: NDArray[np.float32]
    refracts: NDArray[np.bool_]

    def features(self) -> NDArray[np.float32]:
        """(N, 3, K): what a surface's look is made of. Light from all around has no sharper shape than its reflection
        by a matte surface, which is nearly linear in the normal."""
        by_normal = (self.albedo * self.normal[:, axis, None] for axis in range(3))
        surface = np.broadcast_to(np.linalg.norm(self.normal, axis=1, keepdims=True), self.albedo.shape)
        return np.stack([self.colour - self.seen, self.albedo, *by_normal, self.specular, surface], axis=-1)


@dataclass(frozen=True)
class Correction:
    """How far the matched pixels are from what was traced: the mean and the 95th percentile of the difference after
    tone mapping, over the mean of the picture after it."""

    mean: float
    p95: float


def ring_of(holes: NDArray[np.bool_], covered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W): warped pixels beside the holes."""
    return dilate(holes, RING) & covered & ~holes


def match(
    picture: NDArray[np.float32],
    traced: Traced,
    domain: NDArray[np.bool_],
    *,
    known: NDArray[np.bool_],
    doubted: NDArray[np.bool_],
    nearness: NDArray,
) -> NDArray[np.float32]:
    """(N, 3): the colours of the `domain` (H, W), of which `traced` tells, as the engine of the picture would have it.

    picture (H, W, 3) and nearness (H, W) count where `known` (H, W) is set. Where `doubted` (H, W) is, the picture
    shows the right surface and mixes it with the wrong background: it counts as far as the tracer cannot tell.
    """
    at = nearness[domain]
    same = _same_depth(at, traced.nearness)
    kept = known[domain] & same
    base = _learned(traced, picture[domain] - traced.seen, kept) + traced.seen
    gap = np.zeros((*domain.shape, 3), np.float32)
    gap[domain] = np.where(kept[:, None], picture[domain] - base, 0.0)
    weight = np.zeros(domain.shape, np.float32)
    weight[domain] = kept
    correction = spread(gap, weight, domain, _bonds(traced, domain))
    sides = _sides(traced, domain)
    result = np.maximum(base + _mixed(correction, traced, domain, sides), 0.0)
    refracts = np.zeros_like(domain)
    refracts[domain] = traced.refracts
    refracts = dilate(refracts, 1)[domain]
    mixed = (doubted & _beside_edges(traced, domain, nearness))[domain]
    share = np.where(mixed, _trusted(tone(result) - tone(base), same), 0.0)
    share = np.where(refracts & doubted[domain], np.maximum(share, REFRACTING), share).astype(np.float32)[:, None]
    # Mixed as they are seen: a highlight of the one would drown the other.
    toned = share * tone(picture[domain]) + (1.0 - share) * tone(result)
    if refracts.any():
        seen = known | doubted
        both = [1.0 / depth[refracts] for depth in sides[:2]]
        toned[refracts] = _within_both_sides(
            toned[refracts], np.argwhere(domain)[refracts], both, tone(picture), nearness, seen
        )
    return np.where((share > 0.0) | refracts[:, None], untone(toned), result)


def _trusted(unexplained: NDArray, same: NDArray[np.bool_]) -> NDArray:
    """(N,): the share of the picture in a silhouette, by what (N, 3) no law explains, and where it shows the same depth
    (N,)."""
    squared = np.mean(np.abs(unexplained), axis=-1) ** 2
    share = TRUST + (1.0 - TRUST) * squared / (squared + UNEXPLAINED**2)
    return np.where(same, share, ELSEWHERE * share)


def correction_of(matched: NDArray, traced: NDArray, picture: NDArray) -> Correction:
    """Of pixels (N, 3) that were traced and then matched, in a picture (H, W, 3 or more)."""
    brightness = float(np.mean(tone(picture)))
    if matched.size == 0 or brightness == 0.0:
        return Correction(0.0, 0.0)
    change = np.mean(np.abs(tone(matched) - tone(traced)), axis=-1) / brightness
    return Correction(float(change.mean()), float(np.percentile(change, 95.0)))


def _learned(traced: Traced, wanted: NDArray, kept: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(N, 3): the wanted colours (N, 3) of the pixels in `kept` (N,), as a linear function of the features, for all.

    Least squares of the difference after tone mapping, as far as a ridge towards the traced light itself lets it.
    """
    features = traced.features()
    result = np.empty_like(traced.colour)
    prior = np.zeros(features.shape[2])
    prior[0] = 1.0
    for channel in range(3):
        of_all = features[:, channel].astype(np.float64)
        target = wanted[kept, channel].astype(np.float64)
        # The slope of x / (1 + x).
        slope = 1.0 / (1.0 + np.maximum(target + traced.seen[kept, channel], 0.0)) ** 2
        rows = of_all[kept] * slope[:, None]
        size = np.sqrt(np.mean(np.square(of_all), axis=0)) + 1e-9
        doubt = (DOUBT * len(rows) + PRIOR_PIXELS) * float(np.mean(slope**2)) if len(rows) else 1.0
        normal_matrix = (rows / size).T @ (rows / size) + doubt * np.eye(len(size))
        weights = np.linalg.solve(normal_matrix, (rows / size).T @ (target * slope) + doubt * prior * size) / size
        result[:, channel] = of_all @ weights
    return result


def _bonds(traced: Traced, domain: NDArray[np.bool_]) -> Bonds:
    """Neighbours are tied as far as they are of the same surface."""
    known = np.zeros((*domain.shape, 7), np.float32)
    albedo = np.minimum(traced.albedo + traced.specular, 1.0) / ALBEDO_STEP
    nearness = np.log(np.maximum(traced.nearness, 1e-6))[:, None] / BENT
    known[domain] = np.concatenate([nearness, albedo, traced.normal / NORMAL_STEP], axis=1)
    within = Bonds.within(domain)
    right = np.square(np.diff(known, axis=1)).sum(axis=-1)
    down = np.square(np.diff(known, axis=0)).sum(axis=-1)
    return Bonds(within.right * np.maximum(np.exp(-right), LEAK), within.down * np.maximum(np.exp(-down), LEAK))


def _beside_edges(traced: Traced, domain: NDArray[np.bool_], nearness: NDArray) -> NDArray[np.bool_]:
    """(H, W): what lies within two pixels of an edge of depth.

    Elsewhere a silhouette is what the source saw beside something that is no longer there: it would show as a ghost.
    """
    whole = nearness.astype(np.float32)
    whole[domain] = traced.nearness
    edges = np.zeros(domain.shape, bool)
    for axis, ahead, behind in ((0, np.s_[1:], np.s_[:-1]), (1, np.s_[:, 1:], np.s_[:, :-1])):
        greater = np.maximum(whole[ahead], whole[behind])
        step = np.abs(np.diff(whole, axis=axis)) > BENT * greater
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
    """Colours (K, 3) of the pixels at places (K, 2), held within the range of the picture (H, W, 3) around.

    Of what it shows as `seen` (H, W) of the near and of the far side of their edge, whose nearness (K,) is in `sides`;
    where only one of the two is near, they are left as they are.
    """
    rows, columns = places.T
    low, high = np.full_like(toned, np.inf), np.full_like(toned, -np.inf)
    met = np.zeros((2, rows.size), bool)
    border = (NEAR, NEAR)
    picture = np.pad(picture, (border, border, (0, 0)))
    nearness, seen = np.pad(nearness, (border, border)), np.pad(seen, (border, border))
    for down, right in np.ndindex(2 * NEAR + 1, 2 * NEAR + 1):
        there = rows + down, columns + right
        same = np.array([seen[there] & _same_depth(nearness[there], side) for side in sides])
        met |= same
        either = same.any(axis=0)[:, None]
        low = np.where(either, np.minimum(low, picture[there]), low)
        high = np.where(either, np.maximum(high, picture[there]), high)
    return np.where(met.all(axis=0)[:, None], np.clip(toned, low, high), toned)


def _same_depth(a: NDArray, b: NDArray) -> NDArray[np.bool_]:
    """Whether two nearnesses are of the same surface."""
    return np.abs(a - b) <= SAME_DEPTH * np.maximum(a, b)


def _sides(traced: Traced, domain: NDArray[np.bool_]) -> tuple[NDArray, NDArray, NDArray]:
    """(N,) least and greatest depth around each pixel, and (N, 9) all of them, not a number where it is not traced."""
    depth = np.full(domain.shape, np.nan, np.float32)
    with np.errstate(divide="ignore"):
        depth[domain] = 1.0 / traced.nearness
    around = _windows(depth, np.nonzero(domain))
    return np.fmin.reduce(around, axis=1), np.fmax.reduce(around, axis=1), around


def _mixed(
    correction: NDArray[np.float32], traced: Traced, domain: NDArray[np.bool_], sides: tuple[NDArray, NDArray, NDArray]
) -> NDArray[np.float32]:
    """(N, 3): at an edge of depth, the correction of either of its `_sides` by the share that it has of the pixel."""
    near, far, around = sides
    places = np.nonzero(domain)
    edge = np.nonzero(far > (1.0 + BENT) * near)[0]
    near, far, around = near[edge], far[edge], around[edge]
    share = _near_share(traced, domain, edge, near, far, np.isinf(around))
    with np.errstate(invalid="ignore"):
        # The side that is closer, in nearness: the sky is no farther than other things far away.
        is_near = 2.0 / around > 1.0 / near[:, None] + 1.0 / far[:, None]
    known = ~np.isnan(around)
    places = (places[0][edge], places[1][edge])
    values = np.stack([np.nan_to_num(_windows(correction[..., k], places)) for k in range(3)], axis=-1)
    of_near, of_far = (_mean_of(values, chosen & known) for chosen in (is_near, ~is_near))
    result = correction[domain]
    result[edge] = share[:, None] * of_near + (1.0 - share[:, None]) * of_far
    return result


def _near_share(
    traced: Traced, domain: NDArray[np.bool_], edge: NDArray, near: NDArray, far: NDArray, sky: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """(K,): how much of the pixels `edge` shows the nearer side: by their mean depth, before the sky by its light."""
    mean = traced.mean_depth[edge]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (far - mean) / (far - near)
    light = np.zeros(domain.shape, np.float32)
    light[domain] = traced.seen.sum(axis=1)
    brightest = np.where(sky, np.nan_to_num(_windows(light, [place[edge] for place in np.nonzero(domain)])), 0.0).max(
        axis=1
    )
    before_sky = 1.0 - np.divide(light[domain][edge], brightest, out=np.zeros_like(mean), where=brightest > 0.0)
    return np.clip(np.where(np.isinf(far), before_sky, share), 0.0, 1.0)


def _mean_of(values: NDArray[np.float32], chosen: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(K, 3): the mean of those of (K, 9, 3) that are chosen (K, 9)."""
    count = np.maximum(chosen.sum(axis=1), 1)
    return ((values * chosen[..., None]).sum(axis=1) / count[:, None]).astype(np.float32)


def _windows(image: NDArray[np.float32], places: Sequence[NDArray[np.intp]]) -> NDArray[np.float32]:
    """(K, 9): the pixels of (H, W) at these rows and columns and those around them, not a number outside of it."""
    padded = np.pad(image, 1, constant_values=np.nan)
    rows, columns = places
    return np.stack([padded[rows + i, columns + j] for i in range(3) for j in range(3)], axis=-1)
