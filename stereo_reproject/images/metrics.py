"""How far a picture is from another, and from what rendering it again would give."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

TILE = 16


def tone(colour: NDArray) -> NDArray[np.float32]:
    """x / (1 + x) of scene-linear colour (..., C >= 3), alpha left out: bright pixels do not drown the others."""
    positive = np.maximum(np.asarray(colour, np.float32)[..., :3], 0.0)
    # numpy's stubs take the sum of a float32 array and 1.0 for float64.
    return positive / (1.0 + positive)  # pyright: ignore[reportReturnType]


def untone(toned: NDArray) -> NDArray:
    """The scene-linear colour that `tone` makes this of; what is all but 1 stands for a very bright one."""
    return toned / np.maximum(1.0 - toned, 1e-6)


def squared_error(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """(H, W): mean over the colour channels of the squared difference after `tone`."""
    return np.mean((tone(a).astype(np.float64) - tone(b)) ** 2, axis=-1)


def rmse(a: NDArray, b: NDArray) -> float:
    """Root mean square of the difference after `tone`."""
    return float(np.sqrt(squared_error(a, b).mean()))


def tile_rmse(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """`rmse` of each 16 x 16 tile; those at the right and bottom may be smaller."""
    error = squared_error(a, b)
    rows, columns = np.arange(0, error.shape[0], TILE), np.arange(0, error.shape[1], TILE)
    total = np.add.reduceat(np.add.reduceat(error, rows, axis=0), columns, axis=1)
    count = np.diff([*rows, error.shape[0]])[:, None] * np.diff([*columns, error.shape[1]])[None, :]
    return np.sqrt(total / count)


def border_step(picture: NDArray, holes: NDArray[np.bool_]) -> float:
    """Mean difference after `tone` of the neighbours on either side of the borders of `holes` (H, W), 0 without any.

    picture (H, W, >= 3) is scene-linear. Where a seam shows, it is above that of a plain picture at the same places,
    where there are edges too.
    """
    toned = tone(picture)
    steps = [np.abs(np.diff(toned, axis=axis))[np.diff(holes, axis=axis)] for axis in (0, 1)]
    found = np.concatenate([step.mean(axis=-1) for step in steps])
    return float(found.mean()) if found.size else 0.0


def noise_ratio(ours: NDArray, reference: NDArray, again: NDArray) -> float:
    """rmse(ours, A) / rmse(B, A), A and B two plain renders that differ in their seed; 1 is as good as rendering."""
    ours_rmse, noise = rmse(ours, reference), rmse(again, reference)
    if noise == 0.0:
        return 1.0 if ours_rmse == 0.0 else float("inf")
    return ours_rmse / noise


def worst_tiles(ours: NDArray, reference: NDArray, again: NDArray) -> float:
    """99th percentile over tiles of rmse_tile(ours, A) / max(rmse_tile(B, A), its median)."""
    noise = tile_rmse(again, reference)
    floor = np.maximum(noise, np.median(noise))
    error = tile_rmse(ours, reference)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(floor > 0.0, error / floor, np.where(error > 0.0, np.inf, 1.0))
    if not np.isfinite(ratio).all():
        return float(np.percentile(ratio, 99.0, method="higher"))
    return float(np.percentile(ratio, 99.0))
