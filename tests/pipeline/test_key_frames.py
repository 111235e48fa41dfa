"""Frames made from a key frame, with a ray caster in Blender's place, so that each eye can be held against its own
render."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from stereo_reproject.holes.moved import Movers
from stereo_reproject.images.metrics import honest_ratio
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.images.reasons import Reason
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.pipeline.key_frames import KeyFrame, SinceKey, render_from_key
from stereo_reproject.pipeline.shared_findings import SharedFindings
from stereo_reproject.pipeline.stopwatch import Stopwatch
from stereo_reproject.pipeline.whole_view import render_whole_view
from stereo_reproject.settings.frame import StereoSettings, for_mono
from stereo_reproject.trace.costs import TraceCosts
from stereo_reproject.trace.fill import SourceCost
from tests.pipeline.test_pipeline import ROOM, Caster
from tests.warp.analytic import Sphere, World
from tests.warp.exact import Rig

SIZE = (120, 80)
NOISE = 0.05
SETTINGS = StereoSettings(fill="packed")
MONO = for_mono(SETTINGS)
COST = SourceCost(seconds=100.0, sync_seconds=1.0)


@dataclass
class FramesCaster(Caster):
    """A caster that answers several requests at once, and remembers whether probes were announced."""

    def trace(self, method, requests):
        first = len(self.asked)
        answers = [super(FramesCaster, self).trace(method, [request])[0] for request in requests]
        self.asked[first:] = [("together", method, [request.view for request in requests])]
        return answers

    def expect_probes(self, *, probed):
        self.probed = probed


def caster(moved=0.0, world=ROOM, **options):
    """A caster whose eyes have gone sideways and forwards by `moved` scene units."""
    place = np.eye(4)
    place[:3, 3] = moved, 0.0, -moved
    eyes = Rig(size=SIZE, ipd=0.1, convergence=4.0, world=place).eyes
    cameras = dict(zip(("left", "right"), eyes, strict=True))
    return FramesCaster(world, cameras, noise=NOISE, cost=COST, asked=[("begun",)], **options)


def key_of(renderer):
    sources = []
    render_stereo_frame(renderer, SETTINGS, on_source=sources.append)
    return KeyFrame(7, sources[0], {"a text": "of the key frame"})


def tools():
    return {"findings": SharedFindings(), "watch": Stopwatch(), "known_costs": TraceCosts}


def made(renderer, key, changed=None, settings=SETTINGS):
    return render_from_key(renderer, settings, key, changed or SinceKey(9), **tools())


def honest(renderer, frame):
    """Return the honest ratio of each eye of a made frame against two renders of it."""
    shares = {"left": frame.reused.variance_share, "right": frame.variance_share}
    found = {}
    for view, share in shares.items():
        a, b = (renderer.picture(view, seed=seed)[COLOUR_PASS] for seed in (71, 72))
        found[view] = honest_ratio(frame.eyes[view][COLOUR_PASS], a, b, share)
    return found


@pytest.mark.parametrize("moved", [0.0, 0.05, 0.2])
def test_both_eyes_are_as_if_rendered_wherever_the_camera_has_gone(moved):
    renderer = caster(moved)
    frame = made(renderer, key_of(caster()))
    assert not [asked for asked in renderer.asked if asked[0] == "source"], "an eye was rendered whole"
    assert max(honest(renderer, frame).values()) < 1.10
    for view in ("left", "right"):
        truth = renderer.picture(view, seed=1)[DEPTH_PASS]
        off = np.abs(frame.eyes[view][DEPTH_PASS] - truth) > 0.05 * truth
        assert off.mean() < 0.01
    assert frame.reused.key_frame == 7
    assert 0.0 <= frame.reused.traced.mean() < frame.traced.mean() + 0.05 < 0.5


def test_of_a_camera_that_has_not_moved_nothing_is_traced_of_the_first_eye():
    renderer = caster()
    key = key_of(caster())
    frame = made(renderer, key)
    assert not frame.reused.traced.any()
    np.testing.assert_allclose(frame.eyes["left"][COLOUR_PASS], key.source.rendered[COLOUR_PASS], rtol=1e-5, atol=1e-6)


def test_probes_stand_elsewhere_in_each_frame_and_each_eye():
    key = key_of(caster(view_dependent=("Gloss",)))
    places = []
    for number in (8, 9):
        renderer = caster(0.02, view_dependent=("Gloss",))
        frame = made(renderer, key, SinceKey(number))
        assert renderer.probed
        places += [(reasons & Reason.PROBE.bit) > 0 for reasons in (frame.reused.reasons, frame.reasons)]
    assert all(mask.any() for mask in places)
    assert len({mask.tobytes() for mask in places}) == len(places)


def test_the_one_view_of_a_mono_frame_is_the_first_eye_of_a_pair():
    glossy = {"view_dependent": ("Gloss",)}
    key = key_of(caster(**glossy))
    pair, mono = made(caster(0.05, **glossy), key), made(caster(0.05, **glossy), key, settings=MONO)
    assert list(mono.eyes) == ["left"]
    for name, image in pair.eyes["left"].items():
        np.testing.assert_array_equal(mono.eyes["left"][name], image, err_msg=name)
    np.testing.assert_array_equal(mono.traced, pair.reused.traced)
    np.testing.assert_array_equal(mono.reasons, pair.reused.reasons)
    assert mono.refinement.estimate.honest_ratio == pair.reused.refinement.estimate.honest_ratio


def test_a_mono_key_frame_is_rendered_whole_and_for_the_probes_of_other_frames():
    renderer, sources = caster(view_dependent=("Gloss",)), []
    frame = render_whole_view(renderer, MONO, **tools(), on_source=sources.append)
    assert renderer.asked[1:] == [("source", "left")]
    assert renderer.probed
    assert list(frame.eyes) == ["left"]
    assert frame.traced.all()
    np.testing.assert_array_equal(frame.eyes["left"][COLOUR_PASS], renderer.picture("left", seed=1)[COLOUR_PASS])
    assert made(caster(0.05), KeyFrame(7, sources[0], {}), settings=MONO) is not None


def test_a_frame_of_which_the_key_frame_shows_too_little_is_not_made():
    assert made(caster(1.5), key_of(caster())) is None


def movers_between(before, after):
    """The pixels in which two worlds differ, as a scene's movers are told, with boxes around the first and the last
    sphere of theirs."""
    eyes = caster().cameras
    apart = {view: after.hit(eye, *_centres())[1] != before.hit(eye, *_centres())[1] for view, eye in eyes.items()}
    for view, eye in eyes.items():
        depths = [world.hit(eye, *_centres())[0] for world in (before, after)]
        apart[view] |= np.abs(depths[0] - depths[1]) > 1e-6
    boxes = [
        (np.array(sphere.centre) - sphere.radius, np.array(sphere.centre) + sphere.radius)
        for sphere in (before.surfaces[-1], after.surfaces[-1])
    ]
    return SinceKey(9, {view: Movers(mask, boxes) for view, mask in apart.items()}, apart["left"])


def _centres():
    return np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)


def test_what_has_moved_is_traced_where_it_was_and_where_it_is():
    ball = ROOM.surfaces[-1]
    after = replace(ROOM, surfaces=(*ROOM.surfaces[:-1], Sphere((ball.centre[0] - 0.4, *ball.centre[1:]), ball.radius)))
    assert isinstance(after, World)
    key, renderer = key_of(caster()), caster(world=after)
    blind, seeing = made(renderer, key), made(caster(world=after), key, movers_between(ROOM, after))
    assert max(honest(renderer, blind).values()) > 1.5, "the test would not see a ball that stayed behind"
    assert max(honest(renderer, seeing).values()) < 1.10
    shares = [np.mean((reasons & Reason.MOVED.bit) > 0) for reasons in (seeing.reused.reasons, seeing.reasons)]
    assert 0.02 < shares[0] < 0.5
    assert shares[1] < 0.2 * shares[0], "the second eye does not look up what was traced for the first one"
