"""The most that reuse can gain for an equirectangular pair, by the depths of both its eyes alone.

    python -m tests.bench.panorama_ceiling SCENE.blend --panorama vr180 --size 1024x1024

Both eyes are rendered for their depth. A target pixel can be warped if the source shows its point too, and not so
obliquely that it would be stretched to more than the pixels that the warp draws; each other pixel has to be traced. If
a traced pixel costs what a rendered one does and all else costs nothing, a pair takes one eye and that share of one
more, where multiview takes two.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from stereo_reproject.views.camera import Camera, disparity_per_nearness, target_px_from_source_px
from stereo_reproject.warp.tuning import TUNING
from tests.bench.panorama_rows import Depths, options_of, rendered, within_half_a_turn


def main() -> None:
    """Render the eyes, and print what share of the target the source shows, and the most that can be gained."""
    options = options_of(__doc__)
    cameras, depths = rendered(options)
    shown, usable = (float(pixels.mean()) for pixels in reusable(cameras["left"], cameras["right"], depths))
    height, width = depths["left"].shape
    print(
        f"{width} x {height}: the source shows {shown:.1%} of the target, {usable:.1%} stretched to at most "
        f"{TUNING.max_stretch:g} pixels: {ceiling(usable):.2f} x at most"
    )


def ceiling(usable: float) -> float:
    """Return the greatest speed-up over multiview where this share of the target's pixels can be warped."""
    return 2.0 / (2.0 - usable)


def reusable(source: Camera, target: Camera, depths: Depths) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return two masks (H, W) of the target: pixels whose point the source shows, and those of them that are not
    overstretched. depths are both eyes', "left" that of the source, as their cameras have it; rows match."""
    x, y = np.arange(target.width) + 0.5, np.arange(target.height)[:, None] + 0.5
    place, row, away = target_px_from_source_px(target, source, x, y, depths["right"].astype(np.float64))
    inside = (place >= 0.0) & (place < source.width) & (row >= 0.0) & (row < source.height)
    column, line = (np.where(inside, at, 0.0).astype(np.intp) for at in (place, row))
    shown, per_nearness = np.zeros(inside.shape, bool), disparity_per_nearness(source, target)
    for right, down in itertools.product((-1, 0, 1), repeat=2):
        beside = np.clip(column + right, 0, source.width - 1)
        found = depths["left"][np.clip(line + down, 0, source.height - 1), beside]
        # So much of a pixel beside the place, the source shows the point.
        shown |= per_nearness * np.abs(1.0 / found - 1.0 / away) < TUNING.same_point_pixels
    shown &= inside
    return shown, shown & (_source_px_per_target_px(place, source) >= 1.0 / TUNING.max_stretch)


def _source_px_per_target_px(place: NDArray, source: Camera) -> NDArray:
    """Return (H, W) how far apart in the source, in pixels, neighbours in a row of the target are; place is the source
    x (H, W) of each. Of the steps to both neighbours it is the mean."""
    step = within_half_a_turn(np.diff(place, axis=1), source)
    return 0.5 * (np.pad(step, ((0, 0), (1, 0)), mode="edge") + np.pad(step, ((0, 0), (0, 1)), mode="edge"))


if __name__ == "__main__":
    main()
