"""The way of many views, with a ray caster in Blender's place, so that each view can be held against its own render."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from stereo_reproject.estimate.shared_noise import shared_noise
from stereo_reproject.images.metrics import honest_ratio, tone
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.pipeline.many_views import WantedViews, render_many_views
from stereo_reproject.settings.frame import StereoSettings
from stereo_reproject.settings.views import view_names
from stereo_reproject.trace.costs import TraceCosts
from stereo_reproject.trace.fill import SourceCost
from stereo_reproject.views.cone import beside, offsets_of
from tests.pipeline.test_pipeline import ROOM, Caster
from tests.warp.exact import Rig

SIZE = (120, 80)
FOCUS = 4.0
NOISE = 0.05

CALM = replace(ROOM, frequency=0.1)
"""The room with a texture that changes so slowly that noise rules it nearly everywhere."""

TOLD = 0.06
"""Relative difference of what is told of noise from what is measured by two runs: pictures are small, and which pixels
are single differs a little between the runs."""


@dataclass
class ViewsCaster(Caster):
    """A caster of many views: each rendered whole with a seed of its own, and many requests answered at once.

    first_seed is that of all renders: another one has other noise everywhere.
    """

    first_seed: int = 0

    def picture(self, view, seed):
        return super().picture(view, self.first_seed + seed)

    def render_source(self, view, *, probed):  # noqa: ARG002
        self.asked.append(("source", view))
        return self.picture(view, seed=10_000 + list(self.cameras).index(view)), self.cost

    def trace(self, method, requests):
        first = len(self.asked)
        answers = [super(ViewsCaster, self).trace(method, [request])[0] for request in requests]
        self.asked[first:] = [("together", method, [request.view for request in requests])]
        return answers


def caster(count, baseline, world=ROOM, noise=NOISE, **kept):
    middle, _ = Rig(size=SIZE, ipd=0.0).eyes
    names = view_names(count)
    cameras = {
        name: beside(middle, offset, FOCUS) for name, offset in zip(names, offsets_of(count, baseline), strict=True)
    }
    return ViewsCaster(world, cameras, noise=noise, cost=SourceCost(seconds=100.0, sync_seconds=1.0), **kept)


def made(renderer, accuracy="balanced", fresh=0.0, **options):
    """Return the maker and the finished views of the renderer's cameras, in order."""
    views = []
    settings = StereoSettings(accuracy=accuracy)
    wanted = WantedViews(list(renderer.cameras), fresh)
    maker = render_many_views(renderer, settings, wanted, views.append, known_costs=TraceCosts, **options)
    return maker, sorted(views, key=lambda view: view.number)


def honest(renderer, view):
    """Return the honest ratio of a view against two renders of it."""
    a, b = (renderer.picture(view.name, seed=seed)[COLOUR_PASS] for seed in (71, 72))
    return honest_ratio(view.passes[COLOUR_PASS], a, b, view.variance_share)


def test_all_views_come_once_and_each_keeps_the_promise():
    renderer = caster(9, 0.6)
    maker, views = made(renderer)
    assert [view.name for view in views] == list(renderer.cameras)
    whole = [view for view in views if not view.sources]
    assert {views[0].name, views[-1].name} <= {view.name for view in whole}
    assert len(whole) < len(views)
    for view in views:
        assert view.traced.all() == (not view.sources)
        assert honest(renderer, view) <= 1.10
    assert {name for step in maker.steps for name in step.views} == set(renderer.cameras)


def test_views_far_apart_are_rendered_in_between():
    near, far = (len([v for v in made(caster(17, baseline))[1] if not v.sources]) for baseline in (0.2, 8.0))
    assert near < far


def test_views_of_a_gap_are_traced_together():
    renderer = caster(9, 0.2)
    made(renderer)
    together = [asked[2] for asked in renderer.asked if asked[0] == "together"]
    assert max(len(views) for views in together) == 6


def test_where_pixels_cannot_be_packed_all_views_are_rendered():
    renderer = caster(5, 0.4, blockers={"packed": "no", "card": "no"})
    _, views = made(renderer)
    assert all(view.traced.all() for view in views)
    assert len(renderer.asked) == len(views)


def test_two_views_are_a_pair():
    renderer = caster(2, 0.15)
    maker, [first, other] = made(renderer)
    assert not first.sources
    assert other.sources == (first.name,)
    assert honest(renderer, other) <= 1.10
    assert [asked for asked in renderer.asked if asked[0] == "source"] == [("source", first.name)]
    assert maker.plain_seconds(2) == pytest.approx(199.0)


def test_noise_of_whole_views_is_not_the_same():
    _, views = made(caster(3, 0.3))
    first, last = views[0].passes[COLOUR_PASS], views[-1].passes[COLOUR_PASS]
    assert not np.array_equal(first, last)


def noise_of_neighbours(pictures, again):
    """Root mean square of the noise of the mean of each three neighbouring pictures; `again` has other noise."""
    off = [tone(one).astype(np.float64) - tone(other) for one, other in zip(pictures, again, strict=True)]
    return np.sqrt(np.mean([np.mean(off[k : k + 3], axis=0) ** 2 for k in range(len(off) - 2)]))


@pytest.mark.parametrize("fresh", [0.0, 0.5])
def test_noise_of_neighbouring_views_is_told_as_it_is(fresh):
    """Of two whole runs, against plain renders."""
    renderers = [caster(7, 0.1, CALM, first_seed=seed) for seed in (0, 500_000)]
    runs = [made(renderer, fresh=fresh) for renderer in renderers]
    ours = [[view.passes[COLOUR_PASS] for view in views] for _, views in runs]
    plain = [
        [renderer.picture(name, seed=90_000 + k)[COLOUR_PASS] for k, name in enumerate(renderer.cameras)]
        for renderer in renderers
    ]
    told = shared_noise([view.origins.anew() for view in runs[0][1]]).mean
    assert told == pytest.approx(noise_of_neighbours(*ours) / noise_of_neighbours(*plain), rel=TOLD)
    assert told > 1.1


def test_noise_of_made_views_looks_like_that_of_rendered_ones():
    renderer = caster(5, 0.1, CALM)
    _, views = made(renderer)
    for view in views:
        noise = view.passes[COLOUR_PASS][..., :3] - CALM.render(renderer.cameras[view.name])[COLOUR_PASS][..., :3]
        beside = np.mean(noise[:, 1:] * noise[:, :-1]) / np.mean(noise**2)
        # Of a linear lookup halfway between two pixels it is a half.
        assert abs(beside) < 0.1
        assert np.std(noise) == pytest.approx(NOISE, rel=0.1)
        assert not view.sources or view.variance_share.mean() > 0.9


def test_another_share_of_each_view_is_traced_anew():
    plain, anew = (made(caster(5, 0.1, CALM), fresh=fresh) for fresh in (0.0, 0.3))
    for before, view in zip(plain[1], anew[1], strict=True):
        if view.sources:
            added = (view.traced & ~before.traced).mean() / (~before.traced).mean()
            assert added == pytest.approx(0.3, abs=0.03)
            assert honest(caster(5, 0.1, CALM), view) <= 1.10
    first, second, *_ = (view.origins.fresh for view in anew[1] if view.sources)
    assert np.mean(first & second) == pytest.approx(0.09, abs=0.03)
    noise = [shared_noise([view.origins.anew() for view in views]).mean for _, views in (plain, anew)]
    assert noise[1] < 0.95 * noise[0]
    assert anew[0].fresh.traced > 0
    assert plain[0].fresh.traced == 0


def test_where_all_is_traced_anew_all_views_are_rendered():
    _, views = made(caster(5, 0.1), fresh=1.0)
    assert not any(view.sources for view in views)
