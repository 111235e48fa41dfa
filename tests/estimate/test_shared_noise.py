"""Noise that views have in common, told by where they were looked up, against that of views that are looked up so."""

import numpy as np
import pytest

from stereo_reproject.estimate.shared_noise import OWN, NoiseOrigins, origins_of_render, shared_noise
from stereo_reproject.estimate.tuning import TUNING
from stereo_reproject.images.lookup import lookup, variance_share
from stereo_reproject.images.sharpness import pixel_noise

SHAPE = (40, 60)
SEEDS = 200
AGREES = 0.04
"""Relative: 200 seeds of 2400 pixels, some of which share their noise, tell a deviation to about a hundredth."""


def place(across):
    y, x = (np.indices(SHAPE) + 0.5).astype(np.float32)
    return x + np.float32(across), y


def looked_up(across, render=0, own=None):
    """Origins of a view that shows a render, moved; own (H, W) are pixels that were traced for it alone."""
    x, y = place(across)
    number = np.where(np.zeros(SHAPE, bool) if own is None else own, np.int16(OWN), np.int16(render))
    share = np.where(number == OWN, np.float32(1.0), variance_share(x, y))
    return NoiseOrigins(number, x, y, share, np.ones(SHAPE, np.float32), np.zeros(SHAPE, bool))


def measured(views):
    """Deviation of the mean of views over that of as many renders, by many renders of noise alone."""
    rng, means = np.random.default_rng(5), []
    for _ in range(SEEDS):
        renders = {number: rng.normal(size=(*SHAPE, 1)).astype(np.float32) for number in (0, 1)}
        pictures = []
        for view in views:
            picture = rng.normal(size=SHAPE)
            for number, render in renders.items():
                np.copyto(picture, lookup(render, view.x, view.y)[..., 0], where=view.render == number)
            pictures.append(picture)
        means.append(np.mean(pictures, axis=0)[:, 4:-4])
    return np.std(means) * np.sqrt(len(views))


HALF = np.random.default_rng(2).random(SHAPE) < 0.5


@pytest.mark.parametrize(
    "views",
    [
        pytest.param([looked_up(0.0)] * 3, id="one place of one render"),
        pytest.param([looked_up(0.0), looked_up(0.3), looked_up(0.7)], id="less than a pixel apart"),
        pytest.param([looked_up(0.2), looked_up(-0.7), looked_up(1.4)], id="about a pixel apart"),
        pytest.param([looked_up(0.0), looked_up(2.5), looked_up(5.0)], id="far apart"),
        pytest.param([looked_up(0.0), looked_up(0.0, render=1), looked_up(0.4)], id="two renders"),
        pytest.param([looked_up(0.2), looked_up(0.2, own=HALF), looked_up(0.2)], id="half traced"),
    ],
)
def test_told_as_measured(views):
    assert shared_noise(views).mean == pytest.approx(measured(views), rel=AGREES)


def test_renders_have_nothing_in_common():
    colour = np.random.default_rng(0).random((*SHAPE, 4)).astype(np.float32)
    noise = shared_noise([origins_of_render(number, colour) for number in range(5)])
    assert (noise.count, noise.mean, noise.worst) == (3, pytest.approx(1.0), pytest.approx(1.0))


def test_the_worst_views_are_named():
    noise = shared_noise([*(looked_up(9.0 * k) for k in range(3)), looked_up(40.0), looked_up(40.0)])
    # Of the last three views two show the same pixels: the variance of the sum is 1 + 4 in place of 3.
    assert (noise.worst_first, noise.worst) == (2, pytest.approx(np.sqrt(5.0 / 3.0)))
    assert noise.mean == pytest.approx(np.sqrt((3.0 + 3.0 + 5.0) / 9.0))


def test_two_views_are_neighbours_of_each_other():
    noise = shared_noise([looked_up(0.0), looked_up(0.0)])
    assert (noise.count, noise.mean) == (2, pytest.approx(np.sqrt(2.0)))


def test_pictures_without_noise():
    colour = np.full((*SHAPE, 4), 0.5, np.float32)
    assert shared_noise([origins_of_render(number, colour) for number in range(3)]).mean == 1.0


def test_large_views_are_told_by_some_of_their_pixels():
    colour = np.random.default_rng(0).random((90, 700, 4)).astype(np.float32)
    rendered = origins_of_render(0, colour)
    rows, columns = TUNING.shared_noise_pixels
    assert {array.shape for array in vars(rendered).values()} == {(rows, columns)}
    pixel = np.s_[rows // 2, columns // 3]
    place = int(rendered.y[pixel]), int(rendered.x[pixel])
    assert rendered.noise[pixel] == pixel_noise(colour)[place]
    assert (rendered.x[0, -1], rendered.y[-1, 0]) == (699.5, 89.5)
