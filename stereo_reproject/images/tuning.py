"""Tuned numbers of this room, in one place.

None of them is varied by `make spending`. Each field says where its value comes from; "by hand" means that it was set
by the reasoning that is given and was not compared with other values.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ImagesTuning:
    """Numbers by which contrast, noise, shown materials, glossy pixels and samples are read off a picture."""

    # Contrast
    noise_reach_px: int = 1
    """Pixels each way over which noise is averaged before contrast is measured. By hand: the smallest window there
    is."""
    contrast_reach_px: tuple[int, int] = (2, 5)
    """Pixels, down and across, within which contrast is gathered. By hand: the views stand side by side, so what a
    surface reflects mostly moves across."""

    # Light as it is seen
    max_stops_from_median: int = 10
    """Stops from the median luminance that a pixel counts as being away at most in the mean of a picture's brightness.
    By hand: ten stops hold what a camera sees, and neither fireflies nor what a denoiser leaves of nothing move the
    mean further."""
    brightness_pixels: int = 1 << 17
    """Pixels from which a picture's brightness is told, at least, where it has as many. By hand: of as many, the mean
    is good to a hundredth of a stop."""

    # Sharpness of a lookup
    sharpness_reach_px: tuple[int, int] = (2, 2)
    """Pixels, down and across, over which the difference between a cubic and a linear lookup is averaged. By hand: 25
    pixels tell it from noise, and lettering is not much larger."""

    grain_stretch_px: int = 16
    """Pixels of a row that share the random number by which single pixels are looked up. By eye on cornell-box, 8
    samples: with a number for each pixel dashes are left, and a stretch of 16 is not seen."""

    grain_detail_share: float = 0.5
    """Variance beyond noise, in variances of a pixel's noise, below which single pixels are looked up. By hand: a fine
    texture as strong as noise has more."""

    grain_slope_share: float = 0.04
    """Squared slope per pixel, in variances of a pixel's noise, below which single pixels are looked up. With it edges
    of cornell-box, 8 samples, stay straight by eye, without it they do not; a quarter of it leaves a fifth of the
    picture to dashes (docs/accuracy.md)."""

    detail_reach_px: tuple[int, int] = (1, 1)
    """Pixels, down and across, over which that difference is averaged to find pixels that a lookup blurs too much. By
    measurement on a still life of lettering and cloth: over 5 x 5 pixels more are traced, and a third less of the error
    is taken away (docs/accuracy.md)."""

    # Denoised pictures
    blend_reach_px: int = 6
    """Pixels each way from refined tiles within which warped colours are blended with the target's own denoised ones.
    By hand, about the width of a tile: with it the edges of tiles no longer show on living-room's floor, and its noise
    ratio falls from 1.137 to 1.128 (docs/production.md)."""
    residual_noise_share: float = 0.55
    """Variance of the noise that a denoiser leaves, over what `images/residual_noise` makes of noise and detail. By
    measurement on five scenes at 960 x 540 with 64 samples, where it is 0.47 to 0.67 (docs/production.md); smaller
    pictures have more: 0.55 to 1.17 at 320 x 180."""
    residual_noise_relative_error: float = 0.3
    """Standard error of that, as a share of it. By measurement on the same pictures and smaller ones, with 16 to 256
    samples."""
    residual_noise_reach_px: tuple[int, int] = (2, 2)
    """Pixels, down and across, over which the noise of a picture is averaged for that. By hand: with one or three it
    differs by as much from scene to scene."""
    residual_noise_detail_reach_px: tuple[int, int] = (1, 1)
    """Pixels, down and across, from whose mean a pixel differs by its detail. By measurement on ten pictures: with two,
    what the denoiser leaves varies more from scene to scene (log deviation 0.30 in place of 0.27)."""
    denoise_sides_px: int = 32
    """Columns of the other side that the denoiser sees beyond each side of a picture of a whole turn. By measurement on
    classroom: with none the sides differ by 2.3 times as much as they do in the middle of a picture, with these by 1.04
    times (docs/accuracy.md)."""

    # Materials that a pixel shows
    min_material_coverage: float = 0.1
    """Share of a pixel that a material must cover to count as shown there. By hand: less is hardly seen."""

    # Sparks in reflected light
    spark_reach_px: int = 4
    """Pixels each way whose brightness tells how far above its neighbours a single pixel may be. By hand: 80 pixels
    tell their own spread, and one of them that is another spark does not hide the first."""
    min_spark_sigmas: float = 5.0
    """Standard deviations of the pixels around, after tone mapping, by which a single pixel must be brighter than the
    brightest beside it to be a spark. By hand: its square is `EstimateTuning.max_probe_noise_ratio`, for sparks in
    traces. No more than one pixel in 25 can stand out so far (Chebyshev's inequality), and so light that is nothing but
    sparks keeps them."""
    spark_loss_reach_px: int = 16
    """Pixels each way over which the light of a spark is spread. By hand: of a single spark no pixel gets more than a
    thousandth of white, which nobody sees; of many they get what is missing."""

    # Mask of glossy pixels, for comparison
    min_glossy_light_share: float = 0.1
    """Share of a pixel's light that must be glossy or transmitted for the pixel to be masked: a tenth, as
    docs/accuracy.md says of the row of its table that has this mask. By hand, as a plain guess."""

    # Number of samples, read off a cryptomatte
    min_samples: int = 8
    """Smallest number of samples that is believed. By hand: below it, a few edges that happen to have the same coverage
    look like fewer samples than there are."""
    max_coverages: int = 300
    """Number of coverages that are looked at, at most; of more, as many are drawn by chance. By hand: time
    grows with their number."""
    coverage_error: float = 3e-7
    """Error of a coverage, from 0 to 1: it has been rounded to float32 twice, each time by up to 6e-8. The rest is a
    margin, set by hand."""
    sample_error: float = 1e-4
    """Error, in samples, that the product of a coverage and the number of samples may have beside that; a coverage as
    close as that to 0 or 1 tells nothing and is left out. By hand."""
    min_explained_share: float = 0.5
    """Share of the coverages that a number of samples must explain to be believed. By hand: smoke and half transparent
    surfaces have coverages that no number explains."""
    min_share_of_best: float = 0.9
    """Share, of the coverages that the best number explains, from which a smaller number is preferred to it: each
    multiple of the true number explains them as well as it does. By hand."""


TUNING = ImagesTuning()
"""The numbers that are in use."""
