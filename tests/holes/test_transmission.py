"""What is seen through a surface is traced where it may lie far behind and has contrast."""

import numpy as np

from stereo_reproject.holes.transmission import transmission_parallax
from stereo_reproject.images.contrast import contrast_of, gradient_of, window_reach
from stereo_reproject.images.masks import box_around
from stereo_reproject.settings.accuracy import DISPLAY_STEP

SIZE = (40, 60)
GLASS = (slice(10, 30), slice(15, 45))


def flagged(*, stripes=True, disparity_behind=0.0, noise=0.01, limit=2.0):
    rng = np.random.default_rng(0)
    grey = 0.4 + 0.3 * np.sin(np.arange(SIZE[1]) / 2.0) * stripes
    colour = np.repeat(np.broadcast_to(grey, SIZE)[..., None], 4, axis=2) + rng.normal(0, noise, (*SIZE, 4))
    known = np.ones(SIZE, bool)
    glass = np.zeros(SIZE, bool)
    glass[GLASS] = True
    behind = np.full(SIZE, 20.0 - disparity_behind)
    contrast = contrast_of(colour, known)
    return transmission_parallax(glass, behind, gradient_of(colour, known), contrast, limit=limit, unseen=DISPLAY_STEP)


def test_glass_before_something_far_is_traced_and_nothing_else():
    traced = flagged()
    assert traced[GLASS].mean() > 0.6
    traced[GLASS] = False
    assert not traced.any()


def test_glass_is_left_alone_where_nothing_shows():
    assert not flagged(stripes=False).any()
    assert not flagged(disparity_behind=20.0).any(), "nothing is farther than the glass itself"
    assert not flagged(noise=0.5).any()


def test_a_stricter_limit_traces_no_less():
    assert (flagged(limit=1.2) >= flagged(limit=3.0)).all()


def test_without_any_depth_nothing_is_claimed():
    glass = np.ones((8, 8), bool)
    colour = np.zeros((8, 8, 4))
    known = np.zeros((8, 8), bool)
    nothing = np.full((8, 8), np.nan)
    assert not transmission_parallax(
        glass, nothing, gradient_of(colour, known), contrast_of(colour, known), limit=2.0, unseen=0.0
    ).any()


def test_without_noise_what_nobody_sees_is_left_alone():
    glass = np.ones(SIZE, bool)
    colour = np.repeat(np.broadcast_to(0.4 + 1e-5 * np.arange(SIZE[1]), SIZE)[..., None], 4, axis=2)
    behind = np.full(SIZE, 20.0)
    gradient, contrast = gradient_of(colour, glass), contrast_of(colour, glass)
    assert not transmission_parallax(glass, behind, gradient, contrast, limit=2.0, unseen=DISPLAY_STEP).any()


def test_what_is_around_glass_tells_as_much_as_the_whole_picture():
    rng = np.random.default_rng(2)
    colour, known = rng.random((*SIZE, 4)), rng.random(SIZE) < 0.9
    for corner in (GLASS, (slice(0, 3), slice(50, 60)), (slice(39, 40), slice(0, 1))):
        glass = np.zeros(SIZE, bool)
        glass[corner] = True
        box = box_around(glass, window_reach())
        whole, part = (contrast_of(colour[at], known[at]) for at in (np.s_[:, :], box))
        for name in ("signal", "noise"):
            inside, all_of_it = np.zeros(SIZE), getattr(whole, name)
            inside[box] = getattr(part, name)
            np.testing.assert_allclose(inside[glass], all_of_it[glass], rtol=1e-4, atol=1e-7)
        inside[box] = gradient_of(colour[box], known[box])
        np.testing.assert_allclose(inside[glass], gradient_of(colour, known)[glass], rtol=1e-4, atol=1e-7)
