import numpy as np
import pytest

from stereo_reproject.delivery.anaglyph import LEFT, RIGHT, _encoded, dubois, light_of_srgb
from tests.delivery.movies import ffmpeg

ROUNDED = 5e-4
"""The published coefficients have three decimals."""

EIGHT_BITS = 2.0 / 255
"""FFmpeg cuts off what we round, and its coefficients are finer than three decimals (at most 5e-4 of 1 each, six of
them)."""


def pictures(seed=1, shape=(8, 16, 3)):
    chance = np.random.default_rng(seed)
    return chance.random(shape, np.float32), chance.random(shape, np.float32)


def test_grey_stays_grey_within_the_matrices_row_sums():
    sums = (LEFT + RIGHT).sum(axis=1)
    np.testing.assert_allclose(sums, 1, atol=3 * ROUNDED)
    grey = np.repeat(np.linspace(0, 1, 64, dtype=np.float32)[None, :, None], 3, axis=2)
    expected = _encoded(np.clip(light_of_srgb(grey) * sums, 0, 1))
    np.testing.assert_allclose(dubois(grey, grey), expected, atol=1e-5)
    np.testing.assert_allclose(dubois(grey, grey), grey, atol=2e-3)


def test_each_eye_has_its_filter():
    left, right = pictures()
    black = np.zeros_like(left)
    only_left, only_right = dubois(left, black), dubois(black, right)
    assert (only_left[..., 0] > only_left[..., 1:].max(axis=-1)).all()
    assert only_left[..., 1:].max() == 0
    assert (only_right[..., 0] == 0).all()
    assert (only_right[..., 1:].max(axis=-1) > 0.1).all()


def test_what_comes_out():
    left, right = pictures(shape=(4, 5, 4))
    result = dubois(left * 3 - 1, right)
    assert (result.dtype, result.shape) == (np.float32, left.shape)
    assert np.isfinite(result).all()
    assert (result[..., :3] >= 0).all()
    assert (result[..., :3] <= 1).all()
    np.testing.assert_array_equal(dubois(left, right)[..., 3], np.maximum(left, right)[..., 3])
    np.testing.assert_array_equal(dubois(left, right)[..., :3], dubois(left[..., :3], right[..., :3]))
    with pytest.raises(ValueError, match="shape"):
        dubois(left, right[:2])


def test_encoding_and_decoding_are_inverse():
    values = np.linspace(0, 1, 1001, dtype=np.float32)
    np.testing.assert_allclose(_encoded(light_of_srgb(values)), values, atol=1e-6)


def test_ffmpegs_filter_agrees(tmp_path):
    """It multiplies whatever numbers it is given; so it is given linear ones."""
    left, right = (np.round(picture * 255) / 255 for picture in pictures(shape=(16, 32, 3)))
    pair = np.concatenate([left, right], axis=1)
    source, target = tmp_path / "pair.rgb", tmp_path / "anaglyph.rgb"
    source.write_bytes(np.round(pair * 255).astype(np.uint8).tobytes())
    raw = ("-f", "rawvideo", "-pix_fmt", "rgb24")
    done = ffmpeg(*raw, "-s", "64x16", "-i", source, "-vf", "stereo3d=sbsl:arcd", *raw, target)
    assert done.returncode == 0, done.stderr
    theirs = np.frombuffer(target.read_bytes(), np.uint8).reshape(left.shape) / 255
    ours = light_of_srgb(dubois(_encoded(left), _encoded(right)))
    np.testing.assert_allclose(ours, theirs, atol=EIGHT_BITS)
