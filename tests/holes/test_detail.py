"""Detail that a lookup between pixels blurs: traced where it stands above noise and can be seen."""

import numpy as np
import pytest

from stereo_reproject.images.masks import dilate
from stereo_reproject.images.metrics import tone, untone
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS, NOISY_PASS
from stereo_reproject.images.reasons import Reason
from stereo_reproject.settings.accuracy import SETTINGS, for_denoised
from stereo_reproject.views.camera import disparity_per_nearness
from tests.warp.analytic import stereo_rig
from tests.warp.pairs import reproject_pair

SIZE = (96, 48)
WAVE_PX = 3.0
"""Length of the stripes' waves, in pixels: a lookup halfway between pixels loses much of them."""
INNER = np.s_[:, 12:-12]
"""Columns that the source shows, and whose neighbours it shows."""


def stripes(columns, contrast):
    """Colour (H, W, 3), after tone mapping, of upright stripes at these positions of pixel columns."""
    wave = 0.5 + contrast * np.sin(2.0 * np.pi * columns / WAVE_PX)
    return np.broadcast_to(wave, SIZE[::-1])[..., None].repeat(3, axis=2)


def striped_wall(
    contrast,
    *,
    moved_px,
    noise=0.0,
    accuracy="balanced",
    colour_interpolation="adaptive",
    denoised=False,
    alpha_contrast=0.0,
    alpha_noise=0.0,
):
    """A wall as the target sees it, `moved_px` pixels aside: its pixels traced for detail, and its error (H, W)."""
    eyes = stereo_rig(SIZE, mode="parallel", ipd=0.06)
    depth = disparity_per_nearness(eyes["left"], eyes["right"]) / moved_px
    columns = np.arange(SIZE[0]) + 0.5
    toned = stripes(columns, contrast) + np.random.default_rng(4).normal(0.0, noise, (*SIZE[::-1], 3))
    colour = np.ones((*SIZE[::-1], 4), np.float32)
    colour[..., :3] = untone(np.clip(toned, 0.01, 0.99))
    if alpha_contrast or alpha_noise:
        alpha = stripes(columns, alpha_contrast)[..., 0]
        colour[..., 3] = np.clip(alpha + np.random.default_rng(5).normal(0.0, alpha_noise, alpha.shape), 0.0, 1.0)
    passes = {COLOUR_PASS: colour, DEPTH_PASS: np.full((*SIZE[::-1], 1), depth, np.float32)}
    if denoised:
        passes[NOISY_PASS] = colour
    result = reproject_pair(
        passes,
        eyes["left"],
        eyes["right"],
        accuracy=SETTINGS[accuracy],
        invalid=np.zeros(SIZE[::-1], bool),
        colour_interpolation=colour_interpolation,
    )
    error = tone(result.passes[COLOUR_PASS][..., :3]) - stripes(columns + moved_px, contrast)
    return ((result.reasons & Reason.DETAIL.bit) > 0)[INNER], np.sqrt(np.mean(error**2, axis=-1))[INNER]


def test_what_a_lookup_halfway_between_pixels_blurs_is_traced():
    traced, error = striped_wall(0.1, moved_px=2.5)
    assert traced.all()
    assert error.max() > 2.0 / 255.0


def test_where_pixels_fall_on_pixels_nothing_is_lost():
    traced, error = striped_wall(0.1, moved_px=3.0)
    assert not traced.any()
    assert error.max() < 0.5 / 255.0


def test_stripes_that_nobody_sees_are_left_alone():
    traced, error = striped_wall(0.003, moved_px=2.5)
    assert not traced.any()
    assert error.max() < 1.0 / 255.0


@pytest.mark.parametrize("contrast", [0.0, 0.01])
def test_noise_is_no_detail_and_hides_it(contrast):
    traced, _ = striped_wall(contrast, moved_px=2.5, noise=0.05)
    assert traced.mean() < 0.02


def test_the_stricter_an_accuracy_the_more_is_traced():
    shares = [
        striped_wall(0.05, moved_px=2.5, noise=0.02, accuracy=name)[0].mean()
        for name in ("preview", "balanced", "high", "exact")
    ]
    assert shares == sorted(shares)
    assert shares[-1] > shares[0] + 0.2


def test_a_lookup_that_was_asked_for_is_left_as_it_is():
    for how in ("linear", "cubic"):
        traced, _ = striped_wall(0.1, moved_px=2.5, colour_interpolation=how)
        assert not traced.any()


@pytest.mark.parametrize(
    ("contrast", "accuracy", "traced"),
    [(0.1, "balanced", True), (0.05, "balanced", False), (0.05, "high", True), (0.025, "exact", True)],
)
def test_in_a_denoised_picture_detail_is_told_by_how_the_colour_bends(contrast, accuracy, traced):
    found, _ = striped_wall(contrast, moved_px=2.5, accuracy=accuracy, colour_interpolation="cubic", denoised=True)
    assert found.all() if traced else not found.any()


def test_in_a_denoised_picture_a_draft_leaves_detail_as_it_is():
    found, _ = striped_wall(0.2, moved_px=2.5, accuracy="draft", colour_interpolation="cubic", denoised=True)
    assert not found.any()


def denoised_alpha(contrast, *, moved_px=2.5, noise=0.0, accuracy="balanced"):
    """The share of a flat, denoised wall's pixels that are traced because its alpha has stripes, or noise."""
    cubic = {"colour_interpolation": "cubic", "denoised": True, "accuracy": accuracy}
    return striped_wall(0.0, moved_px=moved_px, alpha_contrast=contrast, alpha_noise=noise, **cubic)[0].mean()


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_in_a_denoised_picture_alpha_that_a_lookup_blurs_is_traced(noise):
    assert denoised_alpha(0.2, noise=noise) > 0.9
    assert denoised_alpha(0.2, noise=noise, moved_px=3.0) < 0.02
    assert denoised_alpha(0.2, noise=noise, accuracy="draft") == 0.0


def test_stripes_of_alpha_that_nobody_sees_are_left_alone():
    assert denoised_alpha(0.003) == 0.0


@pytest.mark.parametrize("noise", [0.01, 0.05, 0.2])
def test_noise_of_alpha_that_no_denoiser_takes_away_is_no_detail(noise):
    assert denoised_alpha(0.0, noise=noise) < 0.02


def step_in_colour(bright, *, object_px):
    """Pixels (H, W) traced for detail of a denoised, grey wall of this brightness, and those that nothing covers:
    before it stands something as bright, `object_px` pixels wide, that has moved by 6 pixels."""
    eyes = stereo_rig(SIZE, mode="parallel", ipd=0.06)
    far = disparity_per_nearness(eyes["left"], eyes["right"])
    depth = np.full((*SIZE[::-1], 1), far, np.float32)
    depth[:, 40 : 40 + object_px] = far / 7.0
    colour = np.ones((*SIZE[::-1], 4), np.float32)
    colour[..., :3] = untone(bright)
    result = reproject_pair(
        {COLOUR_PASS: colour, DEPTH_PASS: depth, NOISY_PASS: colour},
        eyes["left"],
        eyes["right"],
        accuracy=for_denoised(SETTINGS["balanced"]),
        invalid=np.zeros(SIZE[::-1], bool),
        colour_interpolation="cubic",
    )
    return (result.reasons & Reason.DETAIL.bit) > 0, (result.reasons & Reason.DISOCCLUDED.bit) > 0


def test_in_a_denoised_picture_what_is_beside_a_gap_is_traced_as_far_as_a_denoiser_spreads_where_it_is_bright():
    """Beyond the ring of one pixel that is traced as a silhouette anyway."""
    bright, gap = step_in_colour(0.5, object_px=16)
    assert gap[INNER].any()
    assert bright[dilate(gap, 2) & ~dilate(gap, 1)].all()
    assert not (bright & ~dilate(gap, 4))[INNER].any()
    dark, _ = step_in_colour(0.02, object_px=16)
    assert not dark[INNER].any()
