"""Detail that is too fine for a lookup between pixels, and that a denoiser leaves otherwise in each eye."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import box_sum
from ..images.lookup import lookup
from ..images.metrics import COLOUR_CHANNELS, judged_channel, judged_channels, untone
from ..images.passes import COLOUR_PASS, NOISY_PASS
from ..images.sharpness import Sharpness, pixel_noise, sharpness_of
from ..images.sides import mend_sides
from ..settings.accuracy import Accuracy
from ..warp.rendered_view import RenderedView
from ..warp.warped_view import WarpedView
from .tuning import TUNING


def fine_detail(
    source: RenderedView, warped: WarpedView, kept: NDArray[np.bool_], accuracy: Accuracy
) -> NDArray[np.bool_]:
    """Return (H, W) target pixels whose detail is lost by more than the accuracy tolerates.

    warped is the target as the source shows it. kept (H, W) are the pixels that nothing else has traced: in a denoised
    picture none but them is returned, and alpha counts apart from the colour, because no denoiser takes its noise away.
    """
    result = _lost_detail(source, warped, kept, accuracy)

    def of_columns(columns: NDArray[np.intp]) -> list[NDArray[np.bool_]]:
        return [_lost_detail(source, warped.of_columns(columns), kept[:, columns], accuracy)]

    mend_sides([result], of_columns, wraps=source.wraps)
    return result


def _lost_detail(
    source: RenderedView, warped: WarpedView, kept: NDArray[np.bool_], accuracy: Accuracy
) -> NDArray[np.bool_]:
    """Return what `fine_detail` does for a target that ends at its sides."""
    result = np.zeros(kept.shape, bool)
    if warped.sharpness is not None:
        result |= _blurred(warped.sharpness, accuracy)
    if NOISY_PASS in warped.passes:
        colour = warped.passes[COLOUR_PASS]
        result |= kept & _finer_than_denoised(colour, warped.warp.covered, accuracy)
        if judged_channels(colour, kept) > COLOUR_CHANNELS:
            result |= kept & _blurred(_sharpness_of_alpha(source, warped, kept), accuracy)
    return result


def _blurred(sharpness: Sharpness, accuracy: Accuracy) -> NDArray[np.bool_]:
    """Return (H, W) target pixels that a lookup between the source's pixels blurs by more than the accuracy
    tolerates: where a linear and a cubic lookup differ by so much, either is about as far from the scene."""
    noise = max(TUNING.indirect_tolerance_share * accuracy.colour_tolerance, TUNING.least_detail_tolerance)
    unseen = max(TUNING.unseen_detail_share * accuracy.unseen, TUNING.unseen_difference)
    return sharpness.lost > np.maximum(noise**2 * sharpness.noise, unseen**2)


def _sharpness_of_alpha(source: RenderedView, warped: WarpedView, kept: NDArray[np.bool_]) -> Sharpness:
    """Return the sharpness of the source's alpha alone, as it was looked up at the kept (H, W) target pixels."""
    x, y = (np.where(kept, at, np.float32(np.nan)) for at in (warped.warp.x, warped.warp.y))
    alpha = judged_channel(source.passes[COLOUR_PASS], COLOUR_CHANNELS)[..., None]
    linear, cubic = (lookup(alpha, x, y, interpolation=kernel, wraps=source.wraps) for kernel in ("linear", "cubic"))
    noise = pixel_noise(_as_light(alpha), wraps=source.wraps)
    return sharpness_of(noise, _as_light(linear), _as_light(cubic), x, y)


def _as_light(alpha: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return scene-linear light (H, W, 3) that is alpha (H, W, 1) in one channel after `metrics.tone`, and black in the
    others: a `channel_mean` then counts alpha as it does in a colour."""
    light = np.zeros((*alpha.shape[:2], COLOUR_CHANNELS), np.float32)
    light[..., :1] = untone(np.clip(alpha, 0.0, 1.0))
    return light


def _finer_than_denoised(
    colour: NDArray[np.float32], covered: NDArray[np.bool_], accuracy: Accuracy
) -> NDArray[np.bool_]:
    """Return (H, W) target pixels of a denoised picture around which it has detail that a denoiser leaves otherwise in
    each eye: a lookup between pixels loses some of it, and what a denoiser keeps of it depends on where the pixels lie.

    It is told by the second differences, down and across, of the tone-mapped colour (H, W, >= 3): their mean square
    over 5 x 5 pixels is above what the accuracy tolerates. Pixels that are traced anyway count too, since a denoiser
    spreads what happens at an edge over the pixels beside it. Those that are not covered (H, W) count as black: nothing
    is known of what they hide, and beside something bright that may be off by as much.
    """
    squares = np.zeros(covered.shape, np.float32)
    for channel in range(COLOUR_CHANNELS):
        toned = np.pad(np.where(covered, judged_channel(colour, channel), np.float32(0.0)), 1, mode="edge")
        middle = toned[1:-1, 1:-1]
        squares += (middle - 0.5 * (toned[1:-1, 2:] + toned[1:-1, :-2])) ** 2
        squares += (middle - 0.5 * (toned[2:, 1:-1] + toned[:-2, 1:-1])) ** 2
    reach = TUNING.denoised_detail_reach_pixels
    count = box_sum(np.ones(covered.shape, bool), reach)
    allowed = TUNING.denoised_detail_ratio * max(accuracy.unseen, TUNING.unseen_difference)
    return box_sum(squares / COLOUR_CHANNELS, reach) > allowed**2 * count
