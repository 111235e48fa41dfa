"""Several sources of one target: which of them answers for a pixel, and that it is really that one's colour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.holes.reprojection import reproject
from stereo_reproject.images.reasons import Reason
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.view import View
from stereo_reproject.warp.composite import spoilt
from stereo_reproject.warp.options import WarpOptions
from stereo_reproject.warp.warper import NUMPY, warp_view
from tests.warp.analytic import Plane, World, camera, pose
from tests.warp.exact import STRICT, nothing_said, traced
from tests.warp.sources import CAMERAS, ROOM, SIZE, WALL, rendered, sources_of

NEARLY_ALL = 0.97
"""Of the pixels that both sources show well: at the rims of surfaces one of them has a flag."""

SAME_PLACE = 0.1
"""Pixels in the source: a coarse cell's place, and a float32."""

BALANCED = SETTINGS["balanced"]


def colours(view):
    return view.passes["Combined"]


@pytest.mark.parametrize("kind", CAMERAS)
def test_each_pixel_has_the_colour_of_the_source_that_the_map_names(kind):
    target, sources = sources_of(kind)
    seen = NUMPY.warp(sources, target)
    covered = seen.warp.covered
    assert (colours(seen)[covered] == (seen.warp.source[covered] + 1.0)[:, None]).all()
    assert (colours(seen)[~covered] == 0.0).all()
    assert not seen.warp.source[~covered].any()
    assert set(np.unique(seen.warp.source)) == {0, 1}


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("swapped", [False, True])
def test_where_both_show_a_point_it_is_the_nearer_view_s(kind, swapped):
    target, sources = sources_of(kind, World((Plane((0.0, 0.0, -WALL)),)))
    nearer = int(swapped)
    if swapped:
        sources.reverse()
    seen = NUMPY.warp(sources, target)
    both = np.logical_and(*(warp_view(source, target).empty == 0 for source in sources))
    assert both.mean() > 0.5
    assert (seen.warp.source[both] == nearer).mean() > NEARLY_ALL


@pytest.mark.parametrize("kind", CAMERAS)
def test_what_is_not_traced_is_where_it_should_be_in_its_source(kind):
    target, sources = sources_of(kind)
    result = reproject(sources, target, STRICT)
    kept = result.reasons == 0
    assert kept.mean() > 0.6
    for number, source in enumerate(sources):
        exact = traced(ROOM, source.camera, target.camera)
        own = kept & (result.warp.source == number)
        assert own.any()
        assert exact.seen[own].all()
        assert np.abs(result.warp.x - exact.x)[own].max() < SAME_PLACE
        assert np.abs(result.warp.y - exact.y)[own].max() < SAME_PLACE


@pytest.mark.parametrize("kind", CAMERAS)
def test_a_hole_of_one_is_covered_by_the_other(kind):
    target, sources = sources_of(kind)
    alone = [NUMPY.warp([source], target).warp.covered for source in sources]
    both = NUMPY.warp(sources, target)
    np.testing.assert_array_equal(both.warp.covered, alone[0] | alone[1])
    filled = alone[1] & ~alone[0]
    assert filled.any()
    assert (both.warp.source[filled] == 1).all()
    unseen = ~both.warp.covered
    assert np.isin(both.empty[unseen], (Reason.DISOCCLUDED.bit, Reason.OUTSIDE.bit)).all()
    assert np.isposinf(both.passes["Depth"][unseen]).all()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_an_occluder_that_one_source_alone_sees_is_not_lost(order):
    """The other stands beyond it, nearer to the wall, which it shows in more detail."""
    target, behind = View("target", camera(SIZE)), camera(SIZE, pose((0.3, 0.0, 0.0)))
    beyond = camera(SIZE, pose((0.0, 0.0, -3.0)))
    sources = [(rendered(behind, 0), rendered(beyond, 1))[number] for number in order]
    panel = ROOM.hit(target.camera, *np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5))[1] == 2
    result = reproject(sources, target, STRICT)
    kept = result.reasons == 0
    assert (kept & panel).sum() > 0.6 * panel.sum(), "all but its rim"
    assert (colours(result)[kept & panel] == 1.0).all()
    wall = NUMPY.warp([source for source in sources if source.camera is beyond], target)
    assert (panel & wall.warp.covered).sum() > 0.6 * panel.sum(), "the other shows the wall there"
    assert (colours(result)[kept & ~panel] == 2.0).sum() > 100, "and is taken where that is the nearest"


def test_three_sources_cover_more_than_two():
    target = View("target", camera(SIZE))
    eyes = [pose((-0.3, 0.0, 0.0)), pose((-0.2, 0.0, 0.0), roll=0.02), pose((0.0, 0.35, 0.0), pitch=0.02)]
    sources = [rendered(camera(SIZE, eye), number) for number, eye in enumerate(eyes)]
    two, three = (reproject(sources[:count], target, BALANCED) for count in (2, 3))
    assert set(np.unique(three.warp.source)) == {0, 1, 2}
    assert (two.warp.covered <= three.warp.covered).all()
    assert (three.reasons > 0).sum() < (two.reasons > 0).sum()
    covered = three.warp.covered
    assert (colours(three)[covered] == (three.warp.source[covered] + 1.0)[:, None]).all()


def test_an_edge_between_two_sources_is_traced():
    """Neither has both of its sides: the panel is the one's, the wall beside it the other's."""
    target, sources = sources_of("parallel", World((Plane((0.0, 0.0, -WALL)),)))
    near = np.zeros(SIZE[::-1], bool)
    near[20:44, 30:60] = True
    passes = {**sources[0].passes, "Depth": np.where(near[..., None], 2.0, np.nan).astype(np.float32)}
    result = reproject([replace(sources[0], passes=passes), sources[1]], target, BALANCED)
    index, covered = result.warp.source, result.warp.covered
    assert set(np.unique(index)) == {0, 1}
    border = (index[:, 1:] != index[:, :-1]) & covered[:, 1:] & covered[:, :-1]
    assert border.any()
    assert (result.reasons[:, 1:][border] > 0).all()
    assert (result.reasons[:, :-1][border] > 0).all()


def test_one_without_a_flag_goes_before_a_nearer_one_that_has_one():
    target, sources = sources_of("parallel", World((Plane((0.0, 0.0, -WALL)),)))
    invalid = np.zeros(SIZE[::-1], bool)
    invalid[20:30, 40:50] = True
    result = reproject([replace(sources[0], invalid=invalid), sources[1]], target, BALANCED)
    alone = reproject([replace(sources[0], invalid=invalid)], target, BALANCED)
    spoiled = (alone.reasons & Reason.INVALID.bit) > 0
    assert spoiled.sum() >= 100
    assert not result.reasons[spoiled].any()
    assert (colours(result)[spoiled] == 2.0).all()
    both = reproject([replace(source, invalid=invalid) for source in sources], target, BALANCED)
    flagged = (both.reasons & Reason.INVALID.bit) > 0
    assert 0 < flagged.sum() < spoiled.sum()
    assert (both.warp.source[flagged] == 0).all(), "of two with a flag, the nearer one"


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_what_a_source_has_not_traced_is_not_looked_up_again(interpolation):
    target, sources = sources_of("toe-in", World((Plane((0.0, 0.0, -WALL)),)))
    known = np.zeros(SIZE[::-1], bool)
    known[:, : SIZE[0] // 2] = True
    partly = replace(sources[0], traced=known)
    # Anything taken of these pixels would show.
    partly.passes["Combined"][~known] = 100.0
    options = WarpOptions(interpolation=interpolation)
    alone = reproject([partly], target, BALANCED, options=options)
    assert (colours(alone)[alone.reasons == 0] == 1.0).all()
    assert 0.3 < (alone.reasons == 0).mean() < 0.6
    result = reproject([partly, sources[1]], target, BALANCED, options=options)
    kept = result.reasons == 0
    assert kept.mean() > 0.8
    assert set(np.unique(colours(result)[kept])) == {1.0, 2.0}


def test_samples_and_what_is_no_number_are_those_of_the_pixel_s_own_source():
    target, sources = sources_of("turned")
    result = reproject(sources, target, BALANCED)
    place = np.nonzero(result.warp.covered)
    np.testing.assert_array_equal(result.answered().sampled(place)[:, 0], result.warp.source[place] + 1.0)
    everywhere = [np.ones(SIZE[::-1], bool), np.zeros(SIZE[::-1], bool)]
    for lost in (everywhere, everywhere[::-1]):
        number = int(lost[1].any())
        found = spoilt([{"AOV": mask} for mask in lost], result.warp, interpolation="linear")["AOV"]
        np.testing.assert_array_equal(found, result.warp.covered & (result.warp.source == number))


def test_flags_of_another_accuracy_are_of_the_same_warp():
    target, sources = sources_of("off-axis")
    result = reproject(sources, target, BALANCED)
    np.testing.assert_array_equal(result.reasons, result.reasons_at(BALANCED))
    assert (result.reasons_at(STRICT) > 0).sum() >= (result.reasons > 0).sum()


@pytest.mark.parametrize("kind", CAMERAS)
def test_one_source_takes_no_memory_in_the_map(kind):
    target, (source, _) = sources_of(kind)
    seen = NUMPY.warp([source], target)
    assert seen.warp.source.shape == seen.warp.x.shape
    assert not seen.warp.source.any()
    assert seen.warp.source.strides == (0, 0), "it takes no memory"


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("seed", range(4))
def test_any_depths_are_merged_without_a_word(kind, seed):
    """Noise from next to nothing to all that a float32 holds, skies, unknown depths: each has its source's colour."""
    rng = np.random.default_rng(seed)
    target, sources = sources_of(kind)
    for source in sources:
        depth = source.passes["Depth"]
        depth[...] = 10.0 ** rng.uniform(*((-30.0, 30.0) if seed % 2 else (-1.0, 2.0)), depth.shape)
        depth[rng.random(depth.shape) < 0.1] = np.inf
        depth[rng.random(depth.shape) < 0.1] = np.nan
    with nothing_said():
        result = reproject(sources, target, BALANCED)
        covered = result.warp.covered
        assert (colours(result)[covered] == (result.warp.source[covered] + 1.0)[:, None]).all()
    assert (result.reasons[~covered] > 0).all()


def test_the_same_source_twice_is_the_first():
    target, (source, _) = sources_of("turned")
    seen, alone = NUMPY.warp([source, source], target), NUMPY.warp([source], target)
    np.testing.assert_array_equal(seen.passes["Combined"], alone.passes["Combined"])
    np.testing.assert_array_equal(seen.empty, alone.empty)
    assert not seen.warp.source.any()
