"""Denoised pictures: the view that each pixel comes from, and the noise that a denoiser leaves."""

import numpy as np
import pytest

from stereo_reproject.images.contrast import box_sum
from stereo_reproject.images.denoising import Denoising, denoise_source, denoise_target
from stereo_reproject.images.passes import ALBEDO_PASS, COLOUR_PASS, NOISY_PASS, NORMAL_PASS

NOISE = 0.05


def blurred(pictures, reach=2):
    """The mean over (2 reach + 1)^2 pixels: it leaves that share of the variance."""
    result = []
    for picture in pictures:
        noisy = picture[NOISY_PASS]
        count = box_sum(np.ones(noisy.shape[:2]), (reach, reach))
        means = [box_sum(noisy[..., k], (reach, reach)) / count for k in range(3)]
        result.append(np.stack(means, axis=-1).astype(np.float32))
    return result


def picture(shape=(256, 480), *, noise=NOISE, seed=1):
    rng = np.random.default_rng(seed)
    colour = np.full((*shape, 4), 0.5, np.float32)
    colour[..., :3] += rng.normal(0.0, noise, (*shape, 3)).astype(np.float32)
    nothing = np.zeros((*shape, 3), np.float32)
    return {COLOUR_PASS: colour, NOISY_PASS: colour.copy(), ALBEDO_PASS: nothing, NORMAL_PASS: nothing}


def test_the_source_keeps_its_alpha_and_its_noisy_pixels():
    source = picture()
    source[NOISY_PASS][..., 3] = 0.25
    clean = denoise_source(source, Denoising(blurred))
    assert np.array_equal(clean[COLOUR_PASS][..., :3], blurred([source])[0])
    assert np.all(clean[COLOUR_PASS][..., 3] == 0.25)
    assert np.array_equal(clean[NOISY_PASS], source[NOISY_PASS])


def test_of_the_target_only_what_was_traced_is_denoised_as_a_whole():
    target = picture()
    colour = np.full_like(target[COLOUR_PASS], 0.7)
    warped = np.zeros(colour.shape[:2], bool)
    warped[:, :100] = True
    finished = denoise_target({**target, COLOUR_PASS: colour}, warped, Denoising(blurred))
    assert np.array_equal(finished[COLOUR_PASS][warped], colour[warped])
    assert np.array_equal(finished[COLOUR_PASS][~warped][:, :3], blurred([target])[0][~warped])


def test_a_target_of_which_nothing_was_traced_is_not_denoised_at_all():
    def never(pictures):
        raise AssertionError

    target = picture()
    warped = np.ones(target[COLOUR_PASS].shape[:2], bool)
    assert denoise_target(target, warped, Denoising(never)) is target


def test_beside_what_was_refined_the_warped_colours_change_over():
    target = picture((64, 96), noise=0.0)
    target[COLOUR_PASS][...] = 0.7
    refined = np.zeros((64, 96), bool)
    refined[:, 40:56] = True
    finished = denoise_target(target, ~refined, Denoising(blurred), refined=refined)[COLOUR_PASS][32, :, 0]
    assert np.allclose(finished[40:56], 0.5)
    assert np.allclose(finished[:30], 0.7)
    assert np.all(np.diff(finished[30:41]) <= 1e-6)
    assert np.abs(np.diff(finished)).max() < 0.05


@pytest.mark.parametrize("turn", [1, 20, -33])
def test_a_picture_of_a_whole_turn_is_denoised_alike_wherever_its_sides_are(turn):
    target = picture((64, 96))
    target[COLOUR_PASS] = np.full_like(target[COLOUR_PASS], 0.7)
    refined = np.zeros((64, 96), bool)
    refined[20:40, 4:20] = True

    def finished(turn, *, wraps):
        passes = {name: np.roll(image, turn, axis=1) for name, image in target.items()}
        pixels = np.roll(refined, turn, axis=1)
        done = denoise_target(passes, ~pixels, Denoising(blurred, wraps=wraps), refined=pixels)
        whole = denoise_source(passes, Denoising(blurred, wraps=wraps))
        return np.roll(np.stack([done[COLOUR_PASS], whole[COLOUR_PASS]]), -turn, axis=2)

    plain = finished(0, wraps=True)
    np.testing.assert_allclose(finished(turn, wraps=True), plain, atol=1e-6)
    off = np.abs(finished(0, wraps=False) - plain).max(axis=(1, 2, 3))
    assert (off > 1e-3).all()
