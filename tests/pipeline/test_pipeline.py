"""The way of a frame, with a ray caster in Blender's place: it renders the same scene exactly from either eye, so what
comes out can be held against what a render of the target would have shown."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from stereo_reproject.errors import BadInputError
from stereo_reproject.estimate.tracing import ProbedTracing
from stereo_reproject.holes.classifier import PINHOLE
from stereo_reproject.images.effects import Effect, EffectsPlan, Finding
from stereo_reproject.images.metrics import honest_ratio, noise_ratio, worst_tiles
from stereo_reproject.images.passes import ALBEDO_PASS, EFFECTS_PASS, NOISY_PASS, NORMAL_PASS
from stereo_reproject.images.reasons import Reason
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.pipeline.matched_tracing import MatchedTracing
from stereo_reproject.pipeline.onlooker import Onlooker
from stereo_reproject.pipeline.shared_findings import SharedFindings
from stereo_reproject.pipeline.stereo_frame import traced_fractions
from stereo_reproject.pipeline.stopwatch import Stopwatch
from stereo_reproject.settings.accuracy import Accuracy
from stereo_reproject.settings.frame import StereoSettings
from stereo_reproject.settings.tuning import TUNING
from stereo_reproject.trace.fill import SourceCost
from stereo_reproject.trace.planner import FillPlanner
from stereo_reproject.views.frustum import Lens
from stereo_reproject.views.parallax import ARC_MINUTE, parallax_difference
from stereo_reproject.warp.composite import replace_non_finite
from tests.warp.analytic import (
    ORTHOGRAPHIC_WIDTH,
    Plane,
    Sphere,
    World,
    camera,
    focal_px,
    pixel_centres,
    pose,
    px_from_world,
    stereo_rig,
    world_rays,
)
from tests.warp.pairs import reproject_pair

SIZE = (150, 100)
IPD = 0.15

ROOM = World(
    (
        Plane((0.0, 0.0, -8.0), (0.3, 0.1, 1.0)),
        Plane((0.0, -1.2, 0.0), (0.0, 1.0, 0.0)),
        Plane((-0.7, 0.3, -3.0), (0.2, 0.0, 1.0), half=0.5),
        Sphere((0.7, -0.1, -4.5), 0.7),
    )
)
OUTDOORS = World((Plane((0.0, -1.2, 0.0), (0.0, 1.0, 0.0)), Sphere((0.7, -0.1, -4.5), 0.7)), frequency=0.5)
SKY = World()

COLOUR_TOLERANCE = 0.03
"""Colours of 0.2 to 0.8 change by up to 0.1 per pixel here, at the sphere's limb by more. Interpolated between pixels
that is good to a hundredth (an eighth of the second difference), and as much goes to the grid: a cell's threshold of
1 arc minute is 0.05 pixels at this size."""

RIM = 1.5
"""Pixels from the source's frame: what the target shows of them is extrapolated, or mixed with what is."""

MISSED = {"draft": 0.008, "preview": 0.008, "balanced": 0.008, "high": 3e-4, "exact": 3e-4}
"""Share of pixels that may be off by more than COLOUR_TOLERANCE. A foreground's true edge lies up to a pixel beyond
its outermost pixel's centre: a band of one pixel on either side does not always reach it, one of two next to always."""

DEPTH_STEP = 2.0
"""Thresholds: a coarse cell's corners stand for all of its depths, which differ by one; the neighbour's by another."""

EDGE_REACH = 8
"""Pixels: an edge is judged by a window of 3 around each of its band's pixels, and the band is 2 wide."""

BOX_REACH = 1.5
"""Pixels: a colour that was filtered over a box holds nothing from further away than this after interpolation."""


@dataclass
class Caster:
    """A renderer that the pipeline can ask, after `pipeline.renderer.Renderer`; it remembers what it was asked."""

    world: World
    cameras: dict
    noise: float = 0.0
    subpixels: int = 1
    blockers: dict = field(default_factory=lambda: {"packed": None, "card": None})
    cost: SourceCost = field(default_factory=lambda: SourceCost(seconds=100.0, sync_seconds=1.0))
    spoil: object = None
    traced_colour: float | None = None
    asked: list = field(default_factory=list)
    deepest: float = 0.0
    gpu: object = staticmethod(lambda: None)
    metadata: dict = field(default_factory=lambda: {"a text": "of Blender's"})
    other_engine: bool = False
    packed_by: str = "osl"
    probed: bool | None = None

    def picture(self, view, seed):
        passes = self.world.render(self.cameras[view], noise=self.noise, seed=seed, subpixels=self.subpixels)
        colour = passes["Combined"]
        guides = {NOISY_PASS: colour, ALBEDO_PASS: colour[..., :3], NORMAL_PASS: colour[..., :3]}
        return passes if self.denoise is None else {**passes, **guides}

    def render_source(self, view, *, probed):
        self.asked.append(("source", view))
        self.probed = probed
        rendered = self.picture(view, seed=1)
        if self.spoil:
            self.spoil(rendered)
        return rendered, self.cost

    def fill_blockers(self, deepest=0.0):
        self.deepest = deepest
        return self.blockers

    view_dependent: tuple = ()
    seed: int = 0
    lens: Lens = PINHOLE
    volumes: tuple = ()
    motion = None
    denoise = None

    @property
    def plan(self):
        return EffectsPlan((Finding(Effect.GLOSSY, self.view_dependent, "probed"),), {})

    def tracing_of(self, warped):
        return MatchedTracing(self, warped) if self.other_engine else ProbedTracing(self, warped)

    def trace(self, method, requests):
        [request] = requests
        view, masks = request.view, request.masks
        self.asked.append((method, view, request.pixels.copy()))
        # The first trace has a seed that the tests know; each after it has one of its own.
        seeds = [2 + 1000 * (len(self.asked) - 2) + k for k in range(len(masks))]
        pictures = [self.picture(view, seed=seed) for seed in seeds]
        parts = [
            {name: image[mask] for name, image in picture.items()}
            for picture, mask in zip(pictures, masks, strict=True)
        ]
        passes = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        if self.traced_colour is not None:
            passes["Combined"][:] = self.traced_colour
        return [passes]


class Denoiser:
    """Leaves all noise where it is, and remembers how many pictures it was given each time."""

    def __init__(self):
        self.given = []

    def __call__(self, pictures):
        self.given.append(len(pictures))
        return [picture[NOISY_PASS][..., :3] for picture in pictures]


def caster(world=ROOM, *, mode="off-axis", orthographic=False, ipd=IPD, **options):
    rig = stereo_rig(SIZE, mode=mode, ipd=ipd, convergence=4.0, orthographic=orthographic)
    return Caster(world, rig, **options)


def settings(**options):
    return StereoSettings(**{"fill": "packed", **options})


def holes_of(frame):
    return frame.reasons > 0


def target_of(frame, asked):
    return frame.eyes[asked.target]


def near(mask_points, shape, reach):
    """(H, W): pixels whose centres lie within `reach`, in the square sense, of one of the points (N, 2), x and y."""
    x, y = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
    result = np.zeros(shape, bool)
    for point_x, point_y in mask_points:
        result |= np.maximum(np.abs(x - point_x), np.abs(y - point_y)) <= reach
    return result


def landing(renderer, source, target, places):
    """Where source pixels (row, column) appear in the target, by way of the world; NaN for the sky."""
    eye = renderer.cameras[source]
    x, y = np.array([j + 0.5 for _, j in places]), np.array([i + 0.5 for i, _ in places])
    depth, _ = renderer.world.hit(eye, x, y)
    origin, direction = world_rays(eye, x, y)
    target_x, target_y, _ = px_from_world(renderer.cameras[target], origin + depth[:, None] * direction)
    return np.column_stack([target_x, target_y])


# The result against the target's own render

RIGS = [
    ("off-axis", False),
    ("parallel", False),
    ("toe-in", False),
    ("parallel", True),
    ("toe-in", True),
]


def inside_source(renderer, source, target, margin=RIM):
    """(H, W): target pixels whose point, were it visible, would lie inside the source's frame; the sky's are."""
    eye = renderer.cameras[target]
    x, y = pixel_centres(eye)
    depth, _ = renderer.world.hit(eye, x, y)
    sky = np.isinf(depth)
    origin, direction = world_rays(eye, x, y)
    points = origin + np.where(sky, 1e9, depth)[..., None] * direction
    x, y, _ = px_from_world(renderer.cameras[source], points)
    return (x > margin) & (x < SIZE[0] - margin) & (y > margin) & (y < SIZE[1] - margin)


def warped_error(renderer, frame, asked):
    """(H, W): greatest difference in colour from a render of the target; 0 in holes and at the source's rim."""
    truth = renderer.picture(asked.target, seed=2)
    error = np.abs(target_of(frame, asked)["Combined"] - truth["Combined"]).max(axis=-1)
    return error * (~holes_of(frame) & inside_source(renderer, asked.source, asked.target))


@pytest.mark.parametrize("source", ["left", "right"])
@pytest.mark.parametrize(("mode", "orthographic"), RIGS)
@pytest.mark.parametrize("subpixels", [1, 3])
@pytest.mark.parametrize("accuracy", ["balanced", "high"])
def test_the_target_is_what_rendering_it_would_have_shown(mode, orthographic, source, subpixels, accuracy):
    """Exactly so where it was traced, to within interpolation where it was warped."""
    # Orthographic eyes side by side show the same picture, only elsewhere. By whole pixels, so that no edge in it is
    # resampled: as nothing comes apart, none is traced.
    ipd = 4 * ORTHOGRAPHIC_WIDTH / SIZE[0] if (mode, orthographic) == ("parallel", True) else IPD
    renderer = caster(mode=mode, orthographic=orthographic, subpixels=subpixels, ipd=ipd)
    asked = settings(source=source, accuracy=accuracy)
    frame = render_stereo_frame(renderer, asked)
    truth = renderer.picture(asked.target, seed=2)
    holes = holes_of(frame)
    assert holes.mean() < 0.3
    for name, image in target_of(frame, asked).items():
        np.testing.assert_array_equal(image[holes], truth[name][holes], err_msg=name)
    error = warped_error(renderer, frame, asked)
    assert np.mean(error > COLOUR_TOLERANCE) <= MISSED[accuracy]
    assert np.mean(error) < 0.1 * COLOUR_TOLERANCE
    assert list(frame.eyes) == [asked.source, asked.target]
    for name, image in renderer.picture(source, seed=1).items():
        np.testing.assert_array_equal(frame.eyes[source][name], image, err_msg="the source is delivered as rendered")


@pytest.mark.parametrize("subpixels", [1, 3])
def test_higher_accuracies_trace_no_less_and_miss_no_more(subpixels):
    traced, missed = [], []
    for accuracy, allowed in MISSED.items():
        renderer, asked = caster(subpixels=subpixels), settings(accuracy=accuracy)
        frame = render_stereo_frame(renderer, asked)
        traced.append(holes_of(frame).mean())
        missed.append(np.mean(warped_error(renderer, frame, asked) > COLOUR_TOLERANCE))
        assert missed[-1] <= allowed
    assert np.all(np.diff(traced) >= 0)
    # A pixel of a mixed colour may be right by chance, where one without it is not.
    assert np.all(np.diff(missed) <= 1.0 / (SIZE[0] * SIZE[1]))


@pytest.mark.parametrize("step", [1.5, 2.2])
def test_a_step_of_more_than_a_pixel_tears_the_surface(step):
    """Even one that is not wide enough to be given away by how far it stretches the surface."""
    per_nearness = focal_px(SIZE) * IPD
    card = per_nearness / (per_nearness / 8.0 + step)
    world = World((Plane((0.0, 0.0, -8.0)), Plane((0.1, 0.2, -card), half=1.5)))
    renderer = caster(world)
    source, invalid = replace_non_finite(renderer.picture("left", seed=1))
    no_band = Accuracy(silhouette_step=1e9, silhouette_radius=0, colour_tolerance=0.0)
    left, right = renderer.cameras["left"], renderer.cameras["right"]
    reprojection = reproject_pair(source, left, right, accuracy=no_band, invalid=invalid, grid_threshold=1.0)
    index = reprojection.passes["IndexOB"][..., 0]
    rows = (index == 2).sum(axis=1) > 10
    strip = ((reprojection.reasons & Reason.DISOCCLUDED.bit) > 0)[rows].sum(axis=1)
    assert rows.sum() > 30
    # The torn quad is a pixel wide in the source, and the step wider in the target; its other side is covered.
    assert np.all(np.abs(strip - (step + 1.0)) <= 1.0)


def test_cubic_interpolation_comes_closer():
    errors = {}
    for interpolation in ("linear", "cubic"):
        renderer, asked = caster(), settings(interpolation=interpolation, accuracy="high", grid_threshold=0.0)
        errors[interpolation] = warped_error(renderer, render_stereo_frame(renderer, asked), asked).mean()
    assert errors["cubic"] < 0.7 * errors["linear"]


@pytest.mark.parametrize("denoised", [False, True])
def test_the_colour_is_looked_up_as_its_noise_has_it_unless_told_otherwise(denoised):
    """The colour alone: an AOV is not denoised, and may be no light at all."""

    def warped(asked):
        renderer = caster()
        if denoised:
            renderer.denoise = Denoiser()
        renderer.spoil = lambda passes: passes.update(Checker=checker)
        frame = render_stereo_frame(renderer, settings(interpolation=asked, accuracy="draft"))
        # The noise that is left in a denoised picture is smooth: a lookup takes nothing from it.
        assert (frame.variance_share == 1.0).all() == denoised
        return frame.eyes["right"], ~holes_of(frame)

    checker = (np.indices(SIZE[::-1]).sum(axis=0) // 3 % 2).astype(np.float32)[..., None]
    (auto, kept), (linear, kept_linear), (cubic, kept_cubic) = map(warped, ("auto", "linear", "cubic"))
    both = kept & kept_linear & kept_cubic
    np.testing.assert_array_equal(auto["Checker"][both], linear["Checker"][both])
    assert np.any(auto["Checker"][both] != cubic["Checker"][both])
    if denoised:
        np.testing.assert_array_equal(auto["Combined"][both], cubic["Combined"][both])
        assert np.any(auto["Combined"][both] != linear["Combined"][both])
    else:
        # A mixture, which the picture's noise decides.
        low, high = (bound(linear["Combined"][both], cubic["Combined"][both]) for bound in (np.minimum, np.maximum))
        mixed = auto["Combined"][both]
        assert (mixed >= low - 1e-6).all()
        assert (mixed <= high + 1e-6).all()
        assert np.any(mixed != linear["Combined"][both])


def test_a_frame_s_cost_is_found_once_and_chosen_by_what_is_known():
    class Known(SharedFindings):
        found = ()

        def cost(self, found):
            self.found = (*self.found, found)
            return found

    renderer, findings = caster(noise=0.1), Known()
    renderer.view_dependent, renderer.denoise = ("a mirror",), Denoiser()
    render_stereo_frame(renderer, settings(), findings=findings)
    assert [cost.seconds for cost in findings.found] == [renderer.cost.seconds]


def test_the_source_is_denoised_once():
    """What the denoiser leaves is told by the picture, and not by denoising parts of it again."""
    renderer = caster(noise=0.1)
    renderer.view_dependent, renderer.denoise = ("a mirror",), Denoiser()
    frame = render_stereo_frame(renderer, settings())
    assert frame.refinement.estimate is not None
    assert len(renderer.denoise.given) == 2


@pytest.mark.parametrize("threshold", [0.0, 1.0, 5.0])
@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
def test_depth_is_the_target_s_own_to_within_the_grid_s_threshold(mode, threshold):
    """Measured as the grid measures it: as binocular parallax."""
    renderer, asked = caster(mode=mode), settings(grid_threshold=threshold, accuracy="exact")
    frame = render_stereo_frame(renderer, asked)
    truth = renderer.picture("right", seed=2)["Depth"][..., 0].astype(np.float64)
    depth = frame.eyes["right"]["Depth"][..., 0].astype(np.float64)
    warped = ~holes_of(frame) & inside_source(renderer, "left", "right")
    difference = parallax_difference(np.minimum(depth, truth), np.maximum(depth, truth), IPD)[warped]
    # A native quad of the sphere's limb is off by its bend, in pixels: an arc minute is 0.05 of them.
    assert difference.max() < (DEPTH_STEP * threshold + 1.0) * ARC_MINUTE


def test_indices_are_never_mixed_and_mostly_right():
    """A pixel whose neighbour is another surface may show it, where the two are so close that no edge was traced."""
    frame = render_stereo_frame(caster(), settings(accuracy="exact"))
    index = frame.eyes["right"]["IndexOB"]
    assert set(np.unique(index)) <= {1.0, 2.0, 3.0, 4.0}
    truth = caster().picture("right", seed=2)["IndexOB"]
    wrong = (index != truth)[..., 0]
    assert wrong.mean() < 0.005
    error = np.abs(frame.eyes["right"]["Combined"] - caster().picture("right", seed=2)["Combined"]).max(axis=-1)
    assert error[wrong].max(initial=0.0) < COLOUR_TOLERANCE


def test_noise_stays_what_it_was():
    """A third render of the target is the yardstick: the result is as far from a reference as that would be."""
    renderer = caster(noise=0.05)
    frame = render_stereo_frame(renderer, settings())
    reference, again = renderer.picture("right", seed=3), renderer.picture("right", seed=4)
    pictures = frame.eyes["right"]["Combined"], reference["Combined"], again["Combined"]
    # Interpolation averages, which takes noise away: from sqrt(1/2), all of it gone, to 1, none.
    assert 0.75 < noise_ratio(*pictures) < 1.01
    # 20 tiles or so at the border are smaller than the others: their rms is good to a tenth.
    assert worst_tiles(*pictures) < 1.3
    # And that is no merit: nothing is wrong, so it is as good as a render, and no better.
    assert honest_ratio(*pictures, frame.variance_share) == pytest.approx(1.0, abs=0.02)
    assert (frame.variance_share[frame.traced] == 1.0).all()
    assert frame.variance_share[~frame.traced].mean() < 0.9


def test_a_probe_is_the_mean_of_two_traces():
    renderer = caster(noise=0.1, view_dependent=("glass",))
    frame = render_stereo_frame(renderer, settings(fill="packed"))
    probes = (frame.reasons & Reason.PROBE.bit) > 0
    assert probes.any()
    assert (frame.variance_share[probes] == 0.5).all()
    pictures = frame.eyes["right"]["Combined"], *(renderer.picture("right", seed=k)["Combined"] for k in (91, 92))
    told = frame.refinement.estimate
    assert told.honest_ratio == pytest.approx(honest_ratio(*pictures, frame.variance_share), abs=0.06)
    assert told.noise_ratio < told.honest_ratio


def test_a_sky_is_warped_like_everything_else():
    renderer, asked = caster(OUTDOORS), settings(accuracy="high")
    frame = render_stereo_frame(renderer, asked)
    error = warped_error(renderer, frame, asked)
    sky = np.isinf(renderer.picture("right", seed=2)["Depth"][..., 0])
    assert 0.2 < sky.mean() < 0.8
    # At the horizon the colours of floor and sky do not meet, and their depths do: there is no edge to be found.
    horizon = int(np.argmin(sky[:, 0]))
    error[horizon - 2 : horizon + 2] = 0.0
    assert np.mean(error > COLOUR_TOLERANCE) <= MISSED["high"]
    warped = ~holes_of(frame)
    assert np.all(np.isposinf(frame.eyes["right"]["Depth"][: horizon - 40, :, 0]) == sky[: horizon - 40])
    assert warped[sky].mean() > 0.8


@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
@pytest.mark.parametrize("source", ["left", "right"])
def test_nothing_but_sky(mode, source):
    renderer = caster(SKY, mode=mode)
    asked = settings(source=source, fill="auto")
    frame = render_stereo_frame(renderer, asked)
    assert warped_error(renderer, frame, asked).max() < COLOUR_TOLERANCE
    assert np.all(np.isposinf(target_of(frame, asked)["Depth"]))
    assert set(np.unique(frame.reasons)) <= {0, int(Reason.OUTSIDE)}
    assert not frame.grid.subdivided.any()


# Two equal eyes


@pytest.mark.parametrize("mode", ["off-axis", "parallel", "toe-in"])
@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("world", [ROOM, OUTDOORS, SKY], ids=["room", "outdoors", "sky"])
def test_without_a_baseline_both_eyes_are_equal_and_nothing_is_traced(mode, orthographic, world):
    renderer = caster(world, mode=mode, orthographic=orthographic, ipd=0.0, noise=0.1)
    frame = render_stereo_frame(renderer, settings(fill="auto"))
    assert not frame.reasons.any()
    assert renderer.asked == [("source", "left")]
    # Positions are exact to float32 rounding, 1e-5 pixels here; noise differs by up to one from pixel to pixel.
    np.testing.assert_allclose(frame.eyes["right"]["Combined"], frame.eyes["left"]["Combined"], rtol=0, atol=1e-4)
    np.testing.assert_array_equal(frame.eyes["right"]["IndexOB"], frame.eyes["left"]["IndexOB"])
    np.testing.assert_allclose(frame.eyes["right"]["Depth"], frame.eyes["left"]["Depth"], rtol=1e-5)
    assert traced_fractions(frame)["rerendered"] == 0.0


# Fills


@pytest.mark.parametrize("method", ["packed", "card"])
def test_exactly_the_holes_are_traced_and_nothing_else_changes(method):
    """Whatever comes back from tracing stands in the holes, and only there."""
    frames = {}
    for colour in (-7.0, 3.0):
        renderer = caster(traced_colour=colour)
        frames[colour] = render_stereo_frame(renderer, settings(fill=method))
        (_, (asked, view, pixels)) = renderer.asked
        assert (asked, view) == (method, "right")
        np.testing.assert_array_equal(pixels, holes_of(frames[colour]))
    holes = holes_of(frames[3.0])
    for colour, frame in frames.items():
        assert np.all(frame.eyes["right"]["Combined"][holes] == colour)
        again = frames[3.0].eyes["right"]["Combined"]
        np.testing.assert_array_equal(frame.eyes["right"]["Combined"][~holes], again[~holes])
        assert frame.fill.method == method
        fractions = traced_fractions(frame)
        assert fractions["rerendered"] == pytest.approx(holes.mean())
        assert fractions["disoccluded"] > 0
        assert fractions["outside"] > 0
        assert all(0.0 <= fraction <= fractions["rerendered"] for fraction in fractions.values())


def test_a_full_fill_is_the_target_s_own_render():
    renderer = caster()
    frame = render_stereo_frame(renderer, settings(fill="full"))
    for name, image in renderer.picture("right", seed=2).items():
        np.testing.assert_array_equal(frame.eyes["right"][name], image)
    assert renderer.asked[1][2].all()
    assert traced_fractions(frame)["rerendered"] == 1.0


@pytest.mark.parametrize("other_engine", [False, True])
@pytest.mark.parametrize("accuracy", ["draft", "exact"])
def test_a_target_that_was_rendered_whole_is_offered_nothing_better(other_engine, accuracy):
    renderer = caster()
    renderer.other_engine = other_engine
    renderer.unmatchable = lambda: "its light is odd"
    whole = render_stereo_frame(renderer, settings(fill="full", accuracy=accuracy)).next_accuracy
    assert (whole.accuracy, whole.more_seconds) == ("full", None)
    if not other_engine:
        assert render_stereo_frame(renderer, settings(accuracy=accuracy)).next_accuracy.more_seconds is not None


@pytest.mark.parametrize(
    ("blockers", "method"),
    [
        ({"packed": None, "card": None}, "packed"),
        ({"packed": "no OSL", "card": None}, "card"),
        ({"packed": "no OSL", "card": "no card"}, "full"),
    ],
)
def test_auto_takes_what_the_renderer_can_do_and_says_why(blockers, method):
    renderer = caster(blockers=blockers)
    frame = render_stereo_frame(renderer, settings(fill="auto"))
    assert frame.fill.method == renderer.asked[1][0] == method
    assert all(blocker in frame.fill.reason for blocker in blockers.values() if blocker)


@pytest.mark.parametrize("method", ["packed", "card"])
def test_a_fill_that_cannot_be_had_is_refused_before_anything_is_rendered(method):
    renderer = caster(blockers={"packed": "no OSL", "card": "no card"})
    with pytest.raises(BadInputError, match="no "):
        render_stereo_frame(renderer, settings(fill=method))
    assert renderer.asked == []


@pytest.mark.parametrize("world", [ROOM, OUTDOORS, SKY], ids=["room", "outdoors", "sky"])
def test_a_fill_is_chosen_knowing_how_deep_the_scene_is(world):
    """A card must stand before everything; the sky has no depth."""
    renderer = caster(world)
    render_stereo_frame(renderer, settings(fill="full"))
    depth = renderer.picture("left", seed=1)["Depth"]
    assert renderer.deepest == depth[np.isfinite(depth)].max(initial=0.0)


@pytest.mark.parametrize(
    ("options", "asked", "probed"),
    [
        ({"view_dependent": ("a mirror",)}, {}, True),
        ({"view_dependent": ("a mirror",)}, {"accuracy": "draft"}, False),
        ({"view_dependent": ("a mirror",)}, {"fill": "full"}, False),
        ({"view_dependent": ("a mirror",), "ipd": 0.0}, {}, False),
        ({}, {}, False),
    ],
)
def test_what_only_probes_need_is_rendered_only_where_there_are_probes(options, asked, probed):
    renderer = caster(noise=0.05, **options)
    frame = render_stereo_frame(renderer, settings(**asked))
    assert renderer.probed == probed
    assert (frame.refinement.evidence is not None) == probed


def test_stages_are_told_as_they_begin_and_timed():
    told = []
    frame = render_stereo_frame(caster(), settings(), watch=Stopwatch(Onlooker(told.append)))
    assert told == ["source", "warp", "fill", "refine", "composite", "account"]
    assert set(frame.seconds) == {*told, "total"}
    assert frame.seconds["total"] == pytest.approx(sum(frame.seconds[stage] for stage in told[:-1]))
    assert all(seconds >= 0 for seconds in frame.seconds.values())


def test_what_came_before_the_source_is_in_the_total():
    told = []
    watch = Stopwatch(Onlooker(told.append))
    watch.lap("plan")
    frame = render_stereo_frame(caster(), settings(), watch=watch)
    assert told[:2] == ["plan", "source"]
    inside = [seconds for stage, seconds in frame.seconds.items() if stage not in ("account", "total")]
    assert frame.seconds["plan"] > 0.0
    assert frame.seconds["total"] == pytest.approx(sum(inside))


# What is no number


PLACES = [(20, 30), (50, 75), (51, 75), (0, 140), (99, 60)]


def spoil(name, value):
    def spoiler(passes):
        for i, j in PLACES:
            passes[name][i, j] = value

    return spoiler


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
def test_a_colour_that_is_no_number_is_traced_and_does_not_spread(value, mode, interpolation):
    """Every pixel that such a colour would have gone into is traced; all others are as if it had not been."""
    asked = settings(accuracy="high", interpolation=interpolation)
    whole = render_stereo_frame(caster(mode=mode), asked)
    renderer = caster(mode=mode, spoil=spoil("Combined", value))
    frame = render_stereo_frame(renderer, asked)
    for eye in frame.eyes.values():
        assert np.all(np.isfinite(eye["Combined"]))
    assert frame.invalid_pixels == {"left": len(PLACES), "right": 0}
    places = landing(renderer, "left", "right", PLACES)
    invalid = (frame.reasons & Reason.INVALID.bit) > 0
    assert invalid.any()
    assert not np.any(invalid & ~near(places, invalid.shape, BOX_REACH + (interpolation == "cubic")))
    check_the_rest(frame, whole, asked, places)


@pytest.mark.parametrize("value", [np.nan, -1.0, 0.0, -np.inf])
@pytest.mark.parametrize("source", ["left", "right"])
def test_a_depth_that_is_none_becomes_a_hole_and_does_not_spread(value, source):
    asked = settings(source=source, accuracy="high")
    whole = render_stereo_frame(caster(), asked)
    renderer = caster(spoil=spoil("Depth", value))
    frame = render_stereo_frame(renderer, asked)
    assert np.all(np.isfinite(target_of(frame, asked)["Depth"]))
    places = landing(renderer, source, asked.target, PLACES)
    visible = (places > 1).all(axis=1) & (places < np.array(SIZE) - 1).all(axis=1)
    assert visible.sum() >= 2
    for x, y in places[visible]:
        assert holes_of(frame)[int(y), int(x)]
    check_the_rest(frame, whole, asked, places)


def check_the_rest(frame, whole, asked, places):
    """What is warped is what would have been; fresh holes are there, no further than the edge band looks around. As far
    as that, a lookup may leave out pixels that it would have taken: they cannot be judged beside what is unknown."""
    holes, before = holes_of(frame), holes_of(whole)
    assert not np.any(holes & ~before & ~near(places, holes.shape, EDGE_REACH))
    for name, image in target_of(frame, asked).items():
        kept, far = ~holes & ~before, ~near(places, holes.shape, EDGE_REACH)
        would_be = target_of(whole, asked)[name]
        np.testing.assert_array_equal(image[kept & far], would_be[kept & far], err_msg=name)
        np.testing.assert_allclose(image[kept], would_be[kept], rtol=0.0, atol=COLOUR_TOLERANCE, err_msg=name)
    # What is warped now and was traced before: there must be little of it, and no black.
    freed = before & ~holes
    assert not np.any(freed & ~near(places, holes.shape, EDGE_REACH))
    assert np.all(target_of(frame, asked)["Combined"][freed, :3] > 0.1)


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_an_aov_that_is_no_number_is_0_and_counted_and_nothing_is_traced_for_it(value, interpolation):
    """Half of the source, as of a surface whose shader divides by zero. The AOV is 1 elsewhere: what lies between is a
    mixture, which would pass for a value of it."""
    half = SIZE[0] // 2

    def with_aov(bad):
        def add(passes):
            passes["Dust"] = np.ones((SIZE[1], SIZE[0], 1), np.float32)
            passes["Dust"][:, :half] = bad

        return add

    asked = settings(accuracy="high", interpolation=interpolation)
    whole = render_stereo_frame(caster(spoil=with_aov(1.0)), asked)
    frame = render_stereo_frame(caster(spoil=with_aov(value)), asked)
    np.testing.assert_array_equal(frame.reasons, whole.reasons)
    np.testing.assert_array_equal(frame.traced, whole.traced)
    for view, eye in frame.eyes.items():
        for name in ("Combined", "Depth"):
            np.testing.assert_array_equal(eye[name], whole.eyes[view][name])
    source, target = frame.eyes["left"]["Dust"][..., 0], frame.eyes["right"]["Dust"][..., 0]
    assert np.all(source[:, :half] == 0.0)
    assert np.all(source[:, half:] == 1.0)
    warped = ~frame.traced
    assert np.all((target[warped] == 0.0) | (target[warped] > 0.999)), "no mixtures"
    # The ray caster traces no AOV: holes have none.
    dark = int((target[warped] == 0.0).sum())
    assert frame.invalid_pixels == {"left": half * SIZE[1], "right": dark}
    assert dark > 0.3 * target.size


@pytest.mark.parametrize("name", ["Diffuse Direct", "GlossInd", "Combined_Key"])
def test_light_that_is_no_number_is_traced_for_its_parts_must_add_up(name):
    def add(passes):
        passes[name] = passes["Combined"][..., :3].copy()
        for i, j in PLACES:
            passes[name][i, j] = np.nan

    frame = render_stereo_frame(caster(spoil=add), settings(accuracy="high"))
    assert np.any(frame.reasons & Reason.INVALID.bit)
    assert frame.invalid_pixels == {"left": len(PLACES), "right": 0}
    assert np.all(np.isfinite(frame.eyes["right"][name]))


def test_what_is_no_number_in_a_traced_pixel_is_black_and_counted():
    renderer = caster(traced_colour=np.nan)
    frame = render_stereo_frame(renderer, settings())
    holes = holes_of(frame)
    assert frame.invalid_pixels == {"left": 0, "right": int(holes.sum())}
    assert np.all(frame.eyes["right"]["Combined"][holes] == 0.0)
    assert np.all(np.isfinite(frame.eyes["right"]["Combined"]))


@pytest.mark.parametrize(
    ("name", "orthographic"), [("Combined", False), ("Combined", True), ("Depth", False), ("Depth", True)]
)
def test_a_source_without_a_single_number_is_a_target_that_is_traced_whole(name, orthographic):
    def all_of_it(passes):
        passes[name][:] = np.nan

    renderer = caster(orthographic=orthographic, spoil=all_of_it)
    frame = render_stereo_frame(renderer, settings(fill="auto"))
    truth = renderer.picture("right", seed=2)
    assert frame.fill.method == "full"
    assert holes_of(frame).mean() > 0.95
    for pass_name, image in truth.items():
        np.testing.assert_array_equal(frame.eyes["right"][pass_name], image)


def test_an_eye_that_looks_elsewhere_is_traced_whole():
    renderer = Caster(ROOM, {"left": camera(SIZE), "right": camera(SIZE, pose(yaw=1.2))})
    frame = render_stereo_frame(renderer, settings(fill="auto"))
    assert holes_of(frame).all()
    for name, image in renderer.picture("right", seed=2).items():
        np.testing.assert_array_equal(frame.eyes["right"][name], image)


# The caster itself


def test_the_caster_sees_what_it_should():
    """A yardstick that is wrong proves nothing: depths by hand, and a point's colour is the same from either eye."""
    eye = camera(SIZE)
    depth, index = World((Sphere((0.0, 0.0, -5.0), 1.0), Plane((0.0, 0.0, -9.0)))).hit(eye, 75.0, 50.0)
    assert (depth, index) == (pytest.approx(4.0), 1)
    renderer = caster(mode="toe-in")
    x, y = pixel_centres(renderer.cameras["left"])
    left_depth, left_index = ROOM.hit(renderer.cameras["left"], x, y)
    origin, direction = world_rays(renderer.cameras["left"], x, y)
    points = origin + left_depth[..., None] * direction
    right_x, right_y, expected = px_from_world(renderer.cameras["right"], points)
    right_depth, right_index = ROOM.hit(renderer.cameras["right"], right_x, right_y)
    seen = np.isclose(right_depth, expected, rtol=1e-6)
    assert seen.mean() > 0.8
    np.testing.assert_array_equal(right_index[seen], left_index[seen])
    left = ROOM.colour(renderer.cameras["left"], x, y)
    right = ROOM.colour(renderer.cameras["right"], right_x, right_y)
    np.testing.assert_allclose(left[seen], right[seen], atol=1e-5)


# Probes


def polished(view):
    """A room in which the sphere shows another colour to each eye: what a mirror does to a warp."""

    def spoil(passes):
        passes["Combined"][polished_part(passes), :3] *= 3.0

    return spoil if view == "left" else None


def polished_part(passes):
    return passes["IndexOB"][..., 0] == 4.0


def test_a_scene_with_nothing_that_depends_on_the_view_has_no_probes():
    frame = render_stereo_frame(caster(noise=0.1), settings())
    assert frame.refinement.estimate is None
    assert not ((frame.reasons & Reason.PROBE.bit) > 0).any()


def test_draft_has_no_probes():
    frame = render_stereo_frame(caster(noise=0.1, view_dependent=("glass",)), settings(accuracy="draft"))
    assert frame.refinement.estimate is None


ELSEWHERE = {"packed": 0.2, "card": 0.6}
"""Share of the picture beside the sphere that is traced with it, in whole tiles: a card's are 24 pixels wide, which is
a quarter of this picture's height, and each is judged by those around it. Edges that are left warped are among what
probes find in them; and of some 300 probes a loud one costs tiles elsewhere, since no credit is given for smoothing."""


@pytest.mark.parametrize("method", ["packed", "card"])
def test_what_looks_different_from_each_eye_is_found_and_traced(method):
    renderer = caster(noise=0.1, subpixels=3, view_dependent=("mirror",), spoil=polished("left"))
    frame = render_stereo_frame(renderer, settings(fill=method))
    refined = (frame.reasons & Reason.REFINED.bit) > 0
    sphere = polished_part(renderer.picture("right", seed=9))
    assert refined[sphere].mean() > 0.5
    assert refined[~sphere].mean() < ELSEWHERE[method]
    assert frame.refinement.estimate.noise_ratio <= 1.1
    reference, again = (renderer.picture("right", seed=seed)["Combined"] for seed in (91, 92))
    assert noise_ratio(frame.eyes["right"]["Combined"], reference, again) < 1.2


@pytest.mark.parametrize("method", ["packed", "card"])
def test_a_large_picture_has_larger_tiles(method, monkeypatch):
    """One of more than 16 / 9 times as many pixels as those whose tiles have the setting's side."""
    renderer = caster(noise=0.1, subpixels=3, view_dependent=("mirror",))
    # So few probes are, by chance, unsure enough with some seeds for the next better setting to trace tiles as well.
    renderer.seed = 1
    asked = settings(fill=method)
    small = render_stereo_frame(renderer, asked)
    smaller = replace(TUNING, unscaled_picture_px=SIZE[0] * SIZE[1] // 2)
    monkeypatch.setattr("stereo_reproject.settings.accuracy.TUNING", smaller)
    large = render_stereo_frame(renderer, asked)
    sides = [frame.refinement.evidence.probes.spacing for frame in (small, large)]
    assert sides == [FillPlanner.spacing(method, side) for side in (8, 16)]
    # What the next better setting traces beside holes is a quarter, too.
    assert small.next_accuracy.traced - large.next_accuracy.traced > 0.5 / sides[0] ** 2


def test_motion_vectors_are_carried_over_with_the_probes_there():
    """In a rig that stands still the vectors of what stands still are the same for both eyes."""

    class WithVector(Caster):
        def picture(self, view, seed):
            passes = super().picture(view, seed)
            return passes | {"Vector": np.ones((*passes["Depth"].shape[:2], 4), np.float32)}

    renderer = WithVector(ROOM, caster().cameras, noise=0.1, view_dependent=("mirror",))
    frame = render_stereo_frame(renderer, settings())
    assert frame.refinement.estimate is not None
    for view in ("left", "right"):
        assert np.isfinite(frame.eyes[view]["Vector"]).all()
    assert (frame.eyes["right"]["Vector"][frame.traced] == 1.0).all()
    np.testing.assert_allclose(np.median(frame.eyes["right"]["Vector"]), 1.0, atol=1e-3)


def test_edges_of_hair_are_traced_though_both_sides_look_alike():
    """A strand may be thinner than a pixel: what is on either side of it is not known from colours."""

    def grey(effects):
        def spoil(passes):
            passes["Combined"][..., :3] = 0.5
            passes[EFFECTS_PASS] = (polished_part(passes)[..., None] * effects).astype(np.float32)

        return spoil

    def edges(effects):
        frame = render_stereo_frame(caster(spoil=grey(effects)), settings())
        return (frame.reasons & Reason.SILHOUETTE.bit) > 0

    plain, hair = edges(Effect.GLOSSY.value), edges(Effect.HAIR.value)
    assert hair.sum() > plain.sum() + 50


@pytest.mark.parametrize(("accuracy", "left_to_probes"), [("draft", False), ("balanced", True), ("exact", False)])
def test_edges_within_fur_are_left_to_the_probes(accuracy, left_to_probes):
    """Everything is hair: what lies on either side of an edge is alike, or probes find that it is not."""

    def fur(passes):
        passes[EFFECTS_PASS] = np.full_like(passes["Depth"], Effect.HAIR.value)

    frame = render_stereo_frame(caster(noise=0.1, spoil=fur, view_dependent=("fur",)), settings(accuracy=accuracy))
    assert ((frame.reasons & Reason.SILHOUETTE.bit) > 0).any() != left_to_probes
    assert ((frame.reasons & Reason.DISOCCLUDED.bit) > 0).any()


def test_equal_eyes_stay_equal_whatever_the_surfaces_are():
    frame = render_stereo_frame(caster(ipd=0.0, noise=0.1, view_dependent=("mirror",)), settings(fill="auto"))
    assert not frame.traced.any()


@pytest.mark.parametrize("blocked", [{"packed": "no OSL"}, {"packed": "no OSL", "card": "EEVEE"}])
def test_without_a_hole_nothing_is_traced_by_a_method_that_cannot_be_used(blocked):
    renderer = caster(SKY, view_dependent=("mirror",), blockers={"packed": None, "card": None} | blocked)
    frame = render_stereo_frame(renderer, settings(fill="auto"))
    assert frame.fill.method not in blocked
    assert all(asked[0] not in blocked for asked in renderer.asked)
