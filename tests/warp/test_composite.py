"""The target eye put together from what was warped and what was traced, and what is no number kept in its place."""

import numpy as np
import pytest

from stereo_reproject.views.camera import target_px_from_source_px
from stereo_reproject.warp.composite import composite, not_numbers, replace_non_finite
from stereo_reproject.warp.forward import Warp
from tests.warp.analytic import pixel_centres, px_from_world, stereo_rig
from tests.warp.pairs import warp_passes_of_pair

SHAPE = (7, 9)


def passes(seed, shape=SHAPE):
    rng = np.random.default_rng(seed)
    channels = {"Combined": 4, "Depth": 1, "Normal": 3, "IndexOB": 1}
    return {name: rng.uniform(0.1, 5.0, (*shape, count)).astype(np.float32) for name, count in channels.items()}


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_compositing_changes_the_holes_and_nothing_else(share):
    warped, fresh = passes(1), passes(2)
    kept = {name: image.copy() for name, image in warped.items()}
    holes = np.random.default_rng(3).random(SHAPE) < share
    composite(warped, {name: image[holes] for name, image in fresh.items()}, holes)
    assert list(warped) == list(kept)
    for name, image in warped.items():
        np.testing.assert_array_equal(image[holes], fresh[name][holes])
        np.testing.assert_array_equal(image[~holes], kept[name][~holes])


def test_a_pass_that_was_not_traced_keeps_what_was_warped_and_no_pass_is_made_up():
    warped, fresh = passes(1), passes(2)
    holes = np.zeros(SHAPE, bool)
    holes[2, 3:6] = True
    traced = {"Combined": fresh["Combined"][holes], "Other": fresh["Depth"][holes]}
    composite(warped, traced, holes)
    assert list(warped) == list(fresh)
    np.testing.assert_array_equal(warped["Combined"][holes], fresh["Combined"][holes])
    np.testing.assert_array_equal(warped["Normal"], passes(1)["Normal"])


def test_contain_leaves_numbers_alone():
    given = passes(1)
    given["Depth"][2, 3] = np.inf
    clean, invalid = replace_non_finite(given)
    assert not invalid.any()
    for name, image in clean.items():
        np.testing.assert_array_equal(image, given[name])
        assert image.dtype == np.float32


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_contain_blacks_out_what_is_no_number_and_says_where(value):
    given = passes(1)
    given["Combined"][2, 3, 1] = given["Combined"][5, 8, 3] = value
    given["Normal"][4, 4, 2] = value
    before = {name: image.copy() for name, image in given.items()}
    clean, invalid = replace_non_finite(given)
    assert np.argwhere(invalid).tolist() == [[2, 3], [5, 8]], "a normal is not what a pixel looks like"
    assert {name: np.argwhere(pixels).tolist() for name, pixels in not_numbers(given).items()} == {
        "Combined": [[2, 3], [5, 8]],
        "Normal": [[4, 4]],
    }
    assert clean["Combined"][2, 3, 1] == clean["Combined"][5, 8, 3] == clean["Normal"][4, 4, 2] == 0.0
    for name, image in clean.items():
        assert np.all(np.isfinite(image))
        finite = np.isfinite(before[name])
        np.testing.assert_array_equal(image[finite], before[name][finite])
        np.testing.assert_array_equal(given[name], before[name], err_msg="what was given is left as it is")


def test_contain_knows_no_depth_but_those_above_zero_and_the_sky():
    given = passes(1)
    values = [np.nan, -np.inf, -1.0, 0.0, 1e-30, 5.0, 1e9, np.inf]
    given["Depth"][0, :8, 0] = values
    clean, invalid = replace_non_finite(given)
    np.testing.assert_array_equal(clean["Depth"][0, :8, 0], np.float32([np.nan] * 4 + values[4:]))
    assert not invalid.any(), "a colour without a depth is a colour"


def warp_by_hand(x, y, nearness):
    return Warp(np.float32(x), np.float32(y), np.float32(nearness))


def test_colours_are_interpolated_and_what_must_not_be_mixed_is_not():
    shape = (1, 3)
    source = {
        "Combined": np.zeros((*shape, 4), np.float32),
        "Depth": np.full((*shape, 1), 2.0, np.float32),
        "Diffuse Color": np.zeros((*shape, 3), np.float32),
    }
    unmixed = ["Normal", "UV", "IndexOB", "IndexMA", "Object Index", "Material Index", "CryptoObject00"]
    unmixed += ["CryptoMaterial01", "CryptoAsset02", "Denoising Normal", "Denoising Depth", "Debug Sample Count"]
    mixed = ["Combined", "Diffuse Color", "Mist", "Combined_Sun", "AO", "Shadow Catcher"]
    mixed += ["Normal map", "UV mask", "Depth of it", "Position of it", "Vector 2", "Cryptic", "IndexOB 2"]
    source |= {name: np.zeros((*shape, 1), np.float32) for name in (*unmixed, *mixed[2:])}
    for name in source:
        if name != "Depth":
            source[name][0, 1] = 8.0
    rig = stereo_rig((3, 1))
    warp = warp_by_hand([[0.5, 0.75, 1.25]], np.full(shape, 0.5), np.full(shape, 0.5))
    warped = warp_passes_of_pair(source, warp, rig["left"], rig["right"], interpolation="linear")
    for name in mixed:
        np.testing.assert_allclose(warped[name][0, :, 0], [0.0, 2.0, 6.0])
    for name in unmixed:
        np.testing.assert_array_equal(warped[name][0, :, 0], [0.0, 0.0, 8.0], err_msg=name)


def identity_warp(camera):
    x, y = pixel_centres(camera)
    return warp_by_hand(x, y, np.ones(x.shape))


def spike(low):
    """One bright column in a dim picture: a cubic spline swings below its surroundings on both sides."""
    image = np.full((9, 9, 4), low, np.float32)
    image[:, 4] = 10.0
    image[..., 3] = 1.0
    image[:, 4:, 3] = 0.0
    return image


def test_interpolation_does_not_make_negative_light_or_an_alpha_above_one():
    rig = stereo_rig((9, 9))
    x, y = pixel_centres(rig["left"])
    source = {"Combined": spike(0.0), "Depth": np.full((9, 9, 1), 2.0, np.float32), "Mist": spike(0.0)[..., :1]}
    warp = warp_by_hand(x + 0.4, y, np.ones(x.shape))
    cubic = warp_passes_of_pair(source, warp, rig["left"], rig["right"], interpolation="cubic")
    for name in ("Combined", "Mist"):
        assert cubic[name].min() == 0.0
        assert cubic[name].max() > warp_passes_of_pair(source, warp, *rig.values(), interpolation="linear")[name].max()
    assert cubic["Combined"][..., 3].max() == 1.0


def test_beside_a_bright_light_cubic_makes_nothing_darker_and_no_alpha_out_of_range():
    rig = stereo_rig((9, 9))
    x, y = pixel_centres(rig["left"])
    image = spike(0.5)
    image[:, 6, 0] = -0.25
    source = {"Combined": image, "Depth": np.full((9, 9, 1), 2.0, np.float32)}
    warp = warp_by_hand(x + 0.4, y + 0.3, np.ones(x.shape))
    red, green, _, alpha = np.moveaxis(
        warp_passes_of_pair(source, warp, *rig.values(), interpolation="cubic")["Combined"], 2, 0
    )
    assert green.min() == 0.5
    assert (alpha.min(), alpha.max()) == (0.0, 1.0)
    assert -0.25 <= red.min() < 0.0, "what is negative may stay so"


def test_the_colour_may_be_looked_up_otherwise_than_what_is_beside_it():
    rig = stereo_rig((9, 9))
    x, y = pixel_centres(rig["left"])
    source = {"Combined": spike(0.5), "Mist": spike(0.5)[..., :1], "Depth": np.full((9, 9, 1), 2.0, np.float32)}
    warp = warp_by_hand(x + 0.4, y, np.ones(x.shape))

    def warped(**how):
        return warp_passes_of_pair(source, warp, rig["left"], rig["right"], **how)

    both, cubic = warped(interpolation="linear", colour_interpolation="cubic"), warped(interpolation="cubic")
    linear = warped(interpolation="linear")
    np.testing.assert_array_equal(both["Combined"], cubic["Combined"])
    np.testing.assert_array_equal(both["Mist"], linear["Mist"])
    assert np.any(cubic["Mist"] != linear["Mist"])


def test_what_is_negative_in_the_source_stays_so():
    rig = stereo_rig((9, 9))
    x, y = pixel_centres(rig["left"])
    image = spike(0.0)
    image[2, 1, :3] = -3.0
    source = {"Combined": image, "Depth": np.full((9, 9, 1), 2.0, np.float32)}
    warp = warp_by_hand(x + 0.1, y, np.ones(x.shape))
    warped = warp_passes_of_pair(source, warp, rig["left"], rig["right"], interpolation="cubic")["Combined"][..., :3]
    assert warped[2, 1].max() < -2.0
    assert warped[5:].min() == 0.0, "away from it nothing is"


@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
@pytest.mark.parametrize("orthographic", [False, True])
def test_position_is_the_point_that_the_target_s_own_pixel_shows(mode, orthographic):
    """Not the nearest sample's, which is that of a place up to half a pixel beside it."""
    rig = stereo_rig((9, 7), mode=mode, ipd=1.0, orthographic=orthographic)
    target = rig["right"]
    x, y = pixel_centres(target)
    depth = np.full((*x.shape, 1), 5.0, np.float32)
    depth[2, 3] = np.inf
    source = passes(1, x.shape) | {"Depth": depth, "Position": np.zeros((*x.shape, 3), np.float32)}
    warp = identity_warp(rig["left"])
    warped = warp_passes_of_pair(source, warp, rig["left"], target, interpolation="linear")
    known = np.isfinite(warped["Depth"][..., 0])
    assert known.sum() >= x.size - 4
    assert not known.all()
    seen_x, seen_y, seen_depth = px_from_world(target, warped["Position"][known])
    np.testing.assert_allclose(seen_x, x[known], atol=1e-4)
    np.testing.assert_allclose(seen_y, y[known], atol=1e-4)
    np.testing.assert_allclose(seen_depth, warped["Depth"][known, 0], rtol=1e-5)
    assert np.all(warped["Position"][2, 3] == 0.0), "the sky has the position that Blender gives it"


@pytest.mark.parametrize("orthographic", [False, True])
def test_depth_becomes_the_target_s_own(orthographic):
    """Seen from elsewhere a point has another depth; where nothing landed it is the sky's, and colours are black."""
    rig = stereo_rig((9, 7), mode="toe-in", ipd=1.0, orthographic=orthographic)
    x, y = pixel_centres(rig["left"])
    depth = np.full(x.shape, 5.0)
    _, _, expected = target_px_from_source_px(rig["left"], rig["right"], x, y, depth)
    nearness = rig["right"].nearness_from_depth(expected)
    lost = np.zeros(x.shape, bool)
    lost[3, 4] = True
    warp = warp_by_hand(np.where(lost, np.nan, x), np.where(lost, np.nan, y), np.where(lost, -np.inf, nearness))
    source = passes(1, x.shape) | {"Depth": depth[..., None].astype(np.float32)}
    warped = warp_passes_of_pair(source, warp, rig["left"], rig["right"], interpolation="linear")
    np.testing.assert_allclose(warped["Depth"][~lost, 0], expected[~lost], rtol=1e-6)
    assert np.ptp(expected) > 0.1
    assert np.isposinf(warped["Depth"][3, 4, 0])
    assert np.all(warped["Combined"][3, 4] == 0.0)
