"""The target eye while it is made: what a pilot finds out early, and what refinement adds."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from stereo_reproject.estimate.target import Provenance
from stereo_reproject.estimate.tracing import ProbedTracing, WarpedTarget
from stereo_reproject.images.metrics import noise_ratio, wrong_tiles
from stereo_reproject.images.reasons import Reason
from stereo_reproject.settings.accuracy import DISPLAY_STEP, SETTINGS, for_size
from stereo_reproject.trace.fill import SourceCost
from stereo_reproject.trace.planner import FillPlanner
from stereo_reproject.views.solid_angle import LEAST_WEIGHT
from tests.estimate.colours import opaque

SIZE = (160, 240)
NOISE = 0.05
COST = SourceCost(60.0, 1.0)
BALANCED, HIGH = (for_size(SETTINGS[name], SIZE[0] * SIZE[1]) for name in ("balanced", "high"))


@dataclass
class Frame:
    """A textured picture, holes in a share of it, and a warp that is off by some pixels in another share."""

    holes: float = 0.2
    wrong: float = 0.0
    shift: int = 5
    seed: int = 0

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)
        y, x = np.mgrid[: SIZE[0], : SIZE[1]]
        self.truth = np.repeat((0.5 + 0.3 * np.sin(x / 3.0) * np.cos(y / 5.0))[..., None], 4, axis=2).astype(np.float32)
        warped = self.traced()
        wrong = int(self.wrong * SIZE[1])
        warped[:, :wrong] = np.roll(self.traced(), self.shift, axis=1)[:, :wrong]
        reasons = np.zeros(SIZE, np.uint16)
        reasons[:, SIZE[1] - int(self.holes * SIZE[1]) :] = Reason.DISOCCLUDED.bit
        self.reprojection = SimpleNamespace(
            passes={"Combined": warped},
            reasons=reasons,
            sampled=lambda place: self.reprojection.passes["Combined"][place],
            variance_share=np.ones(SIZE, np.float32),
            single=None,
        )
        self.asked = []

    def handed_on(self):
        """The reprojection with passes of its own, into which pixels are traced."""
        passes = {name: image.copy() for name, image in self.reprojection.passes.items()}
        return SimpleNamespace(**{**vars(self.reprojection), "passes": passes})

    def traced(self):
        return opaque((self.truth + self.rng.normal(0.0, NOISE, self.truth.shape)).astype(np.float32))

    def trace(self, method, requests):
        [request] = requests
        assert request.view == "right"
        self.asked.append((method, int(request.pixels.sum())))
        return [{"Combined": np.concatenate([self.traced()[mask] for mask in request.masks])}]

    def eye(self, accuracy=BALANCED, *, asked="auto", watched=True, blockers=None):
        planner = FillPlanner(asked, COST, blockers or {})
        return ProbedTracing(self, WarpedTarget("right", self.handed_on(), planner, accuracy, None, watched, self.seed))

    def ratio(self, eye):
        return noise_ratio(eye.target.passes["Combined"], self.traced(), self.traced())


def test_a_hopeless_frame_is_found_out_by_a_few_probes_and_rendered_whole():
    frame = Frame(holes=0.25, wrong=0.7)
    eye = frame.eye()
    assert eye.wants_pilot
    eye.send_pilot()
    _, pixels = frame.asked[-1]
    assert pixels < 0.005 * eye.target.traced.size, "early means: before much is traced"
    choice = eye.fill()
    assert choice.method == "full"
    assert "expected" in choice.reason
    assert eye.target.traced.all()
    refinement = eye.refine()
    assert refinement.whole
    assert refinement.estimate.low < refinement.estimate.noise_ratio == 1.0 < refinement.estimate.high
    assert len(frame.asked) == 2


@pytest.mark.parametrize("wrong", [0.0, 0.2])
def test_a_pilot_does_not_give_up_a_frame_that_is_worth_it(wrong):
    frame = Frame(holes=0.25, wrong=wrong)
    eye = frame.eye()
    eye.send_pilot()
    assert eye.fill().method == "packed"
    refinement = eye.refine()
    assert eye.target.traced.mean() < 0.4 + wrong
    assert refinement.estimate.noise_ratio <= BALANCED.promise
    assert frame.ratio(eye) <= BALANCED.promise + 0.03


def test_a_pilot_is_sent_only_where_it_may_save_something():
    assert not Frame(holes=0.05).eye().wants_pilot, "little would be lost"
    assert not Frame(holes=0.95).eye().wants_pilot, "a full render is the answer already"
    assert not Frame().eye(asked="packed").wants_pilot, "it is asked for, whatever it costs"
    assert not Frame().eye(SETTINGS["draft"]).wants_pilot
    assert not Frame().eye(watched=False).wants_pilot
    assert not Frame().eye(blockers={"packed": "no OSL"}).wants_pilot


def test_refinement_takes_one_render_and_keeps_the_promise():
    frame = Frame(wrong=0.15)
    eye = frame.eye(HIGH, asked="packed")
    eye.fill()
    refinement = eye.refine()
    assert refinement.fill.method == "packed"
    assert len(frame.asked) == 2
    refined, probes = (eye.target.any_of(flag) for flag in (Provenance.REFINED, Provenance.PROBE))
    np.testing.assert_array_equal(refinement.pixels, refined & ~probes)
    assert refinement.pixels[:, :30].mean() > 0.8
    assert refinement.pixels[:, 60:].mean() < 0.1
    assert frame.ratio(eye) <= HIGH.promise + 0.02


class QuietPart(Frame):
    """A picture two fifths of which have next to no noise. There the warp is off to either side by four display steps,
    some two after tone mapping: a third of the noise elsewhere, so that neither the frame nor its worst tiles call for
    it."""

    columns = slice(0, 96)
    inside = slice(0, 80)
    """Columns of whose noise those beside the quiet part tell nothing."""

    def __post_init__(self):
        super().__post_init__()
        off = 4.0 * DISPLAY_STEP * self.rng.choice([-1.0, 1.0], size=(*SIZE, 1))
        self.reprojection.passes["Combined"][:, self.columns, :3] += off[:, self.columns].astype(np.float32)

    def traced(self):
        noisy = super().traced()
        noisy[:, self.columns] += 0.99 * (self.truth - noisy)[:, self.columns]
        return opaque(noisy)

    def wrong_share(self, eye):
        return wrong_tiles(*(picture[:, self.inside] for picture in (eye.target.colour, self.traced(), self.traced())))


@pytest.mark.parametrize("none_wrong", [True, False])
def test_where_no_tile_may_be_wrong_a_quiet_part_is_traced_though_the_frame_is_kept(none_wrong):
    frame = QuietPart(holes=0.0)
    exact = for_size(SETTINGS["exact"], SIZE[0] * SIZE[1])
    assert exact.promises_worst_tiles
    # Looser, so that chance has nothing traced.
    eye = frame.eye(replace(exact, promise=1.1, tile_limit=2.0, promises_worst_tiles=none_wrong), asked="packed")
    eye.fill()
    refinement = eye.refine()
    assert refinement.pixels.mean() == pytest.approx(1.0 / 3.0 if none_wrong else 0.0, abs=0.03)
    assert frame.wrong_share(eye) == pytest.approx(0.0 if none_wrong else 1.0, abs=0.02)


def test_where_tracing_the_rest_is_no_dearer_all_of_it_is_traced():
    frame = Frame(holes=0.05, wrong=0.94)
    eye = frame.eye()
    eye.fill()
    refinement = eye.refine()
    assert refinement.whole
    assert refinement.fill.method == "full"
    assert eye.target.traced.all()


def test_without_a_promise_nothing_is_probed_and_nothing_claimed():
    frame = Frame(wrong=0.3)
    eye = frame.eye(SETTINGS["draft"])
    eye.fill()
    refinement = eye.refine()
    assert refinement.estimate is None
    assert not eye.target.any_of(Provenance.PROBE).any()
    np.testing.assert_array_equal(eye.target.traced, frame.reprojection.reasons > 0)


def test_a_frame_that_is_all_hole_needs_no_probe_to_be_as_rendered():
    frame = Frame(holes=1.0)
    eye = frame.eye()
    assert not eye.wants_pilot
    assert eye.fill().method == "full"
    assert eye.refine().estimate.noise_ratio == 1.0


def test_a_probe_of_which_one_trace_is_no_number_takes_the_other():
    frame = Frame()
    eye = frame.eye(asked="packed")
    plain = frame.trace

    def trace(method, requests):
        [passes], [request] = plain(method, requests), requests
        if request.twice is not None:
            passes["Combined"][int(request.pixels.sum()) + 3] = np.nan
        return [passes]

    frame.trace = trace
    eye.fill()
    assert np.isfinite(eye.target.passes["Combined"]).all()
    assert eye.refine().estimate.noise_ratio < 1.1


def test_a_watched_frame_without_holes_is_probed_or_rendered_whole():
    """Without any other way to trace, there is no other way to know."""
    frame = Frame(holes=0.0, wrong=0.5)
    eye = frame.eye(blockers={"packed": "no OSL", "card": "no card"})
    assert eye.fill().method == "full"
    assert eye.target.traced.all()
    assert eye.refine().whole
    unwatched = Frame(holes=0.0).eye(blockers={"packed": "no OSL", "card": "no card"}, watched=False)
    unwatched.fill()
    assert not unwatched.target.traced.any()


class SlowError(Frame):
    """A highlight that stands elsewhere for the other eye: the warp is brighter at its middle by as much as its noise.
    The light is two passes' sum, of which one is another's times a colour."""

    def __post_init__(self):
        super().__post_init__()
        y, x = np.mgrid[: SIZE[0], : SIZE[1]]
        light = NOISE * np.exp(-((x - 100) ** 2 + (y - 80) ** 2) / (2 * 30.0**2)).astype(np.float32)
        combined = self.reprojection.passes["Combined"]
        combined[..., :3] += 4.0 * light[..., None]
        self.color = np.full((*SIZE, 3), 0.25, np.float32)
        direct = combined[..., :3].copy()
        self.reprojection.passes |= {
            "Diffuse Direct": direct,
            "Diffuse Color": self.color,
            "Emission": combined[..., :3] - self.color * direct,
            "Index": np.ones((*SIZE, 1), np.float32),
        }


def slow_error(**options):
    frame = SlowError(holes=0.1, **options)
    eye = frame.eye(asked="packed")
    eye.fill()
    return frame, eye


def test_a_slow_error_of_a_noisy_picture_is_taken_away_and_not_traced():
    """Or single tiles of it would be, and stand out of the others."""
    frame, eye = slow_error()
    warped = ~eye.target.traced
    before, after = (
        (image["Combined"] - frame.truth)[..., :3].mean(axis=-1)
        for image in (frame.reprojection.passes, eye.target.passes)
    )
    middle = np.s_[60:100, 80:120]
    assert before[middle].mean() > 2.0 * NOISE
    assert abs(after[middle][warped[middle]].mean()) < 0.25 * before[middle].mean()
    refinement = eye.refine()
    assert refinement.pixels.mean() < 0.02
    assert frame.ratio(eye) <= min(1.03, refinement.estimate.noise_ratio + 0.03)


def test_parts_of_the_light_still_add_up_when_a_slow_error_is_taken_away():
    frame, eye = slow_error()
    warped, passes = ~eye.target.traced, eye.target.passes
    assert not np.array_equal(passes["Emission"], frame.reprojection.passes["Emission"])
    parts = passes["Diffuse Color"] * passes["Diffuse Direct"] + passes["Emission"]
    np.testing.assert_allclose(parts[warped], passes["Combined"][..., :3][warped], rtol=1e-5, atol=1e-6)
    for name in ("Diffuse Color", "Index"):
        assert np.array_equal(passes[name], frame.reprojection.passes[name]), name


def test_beyond_the_edge_of_a_lens_nothing_is_probed_counted_or_traced():
    """The picture's left half shows nothing. A tile at its edge has pixels on either side."""
    frame = Frame(wrong=1.0)
    shown = np.broadcast_to(np.arange(SIZE[1]) >= SIZE[1] // 2 + 3, SIZE)
    weight = np.where(shown, np.float32(1.0), np.float32(LEAST_WEIGHT))
    for image in (frame.truth, frame.reprojection.passes["Combined"]):
        image[~shown] = 0.0
    planner = FillPlanner("packed", COST, {})
    warped = WarpedTarget("right", frame.handed_on(), planner, BALANCED, None, True, 1, pixel_weight=weight)
    eye = ProbedTracing(frame, warped)
    eye.fill()
    evidence = eye.refine().evidence
    holes = frame.reprojection.reasons > 0
    assert evidence.probes.rows.size
    assert shown[evidence.probes.rows, evidence.probes.columns].all()
    assert evidence.pixels.sum() == np.count_nonzero(shown & ~holes)
    assert eye.target.any_of(Provenance.REFINED).any()
    assert not (eye.target.traced & ~shown).any()
    assert (eye.target.colour[~shown] == 0.0).all()
