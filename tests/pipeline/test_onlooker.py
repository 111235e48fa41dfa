"""What an onlooker is shown of a frame, and that it costs the frame nothing but time."""

from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.pipeline.onlooker import CHECKER_GREYS, CHECKER_SIDE_PX, NOBODY, Onlooker, with_checkerboard
from stereo_reproject.pipeline.stages import Stage
from stereo_reproject.pipeline.stopwatch import Stopwatch
from stereo_reproject.settings.frame import StereoSettings
from stereo_reproject.trace.fill import SourceCost
from tests.pipeline.test_pipeline import ROOM, Caster, Denoiser, caster

LOOK_SYNC_SECONDS = 3.0
ROUNDING_SECONDS = 1e-6
"""Of sums of seconds in double precision, generously."""


class Looker(Caster):
    """A renderer whose first look syncs the scene, so that the source need not."""

    def first_look(self, view, *, probed):  # noqa: ARG002 - as the protocol has it
        return self.picture(view, seed=7)["Combined"], SourceCost(LOOK_SYNC_SECONDS + 0.5, LOOK_SYNC_SECONDS)


def memory(*, first_look=False):
    """An onlooker, and the list of what it was shown, as (view, picture)."""
    seen = []
    return Onlooker(show=lambda view, colour: seen.append((view, colour.copy())), first_look=first_look), seen


def frame_seen_by(onlooker, *, denoised=False, **options):
    plain = caster(ROOM)
    renderer = Looker(plain.world, plain.cameras, noise=0.05, **options)
    renderer.denoise = Denoiser() if denoised else None
    settings = StereoSettings(accuracy="draft", fill="packed")
    return render_stereo_frame(renderer, settings, watch=Stopwatch(onlooker))


def test_the_source_is_shown_first_then_the_target_with_holes_then_without():
    onlooker, seen = memory()
    frame = frame_seen_by(onlooker)
    (first, source), (second, warped), (third, traced) = seen
    assert (first, second, third) == ("left", "right", "right")
    assert np.array_equal(source, frame.eyes["left"]["Combined"])
    holes = frame.traced
    assert holes.any()
    assert not np.allclose(warped[holes], traced[holes])
    assert np.array_equal(warped[~holes], traced[~holes])
    assert np.array_equal(traced, frame.eyes["right"]["Combined"])


def test_a_first_look_comes_before_the_source():
    onlooker, seen = memory(first_look=True)
    frame = frame_seen_by(onlooker)
    assert [view for view, _ in seen] == ["left", "left", "right", "right"]
    assert not np.array_equal(seen[0][1], frame.eyes["left"]["Combined"])


def test_a_denoised_source_is_shown_as_rendered_and_as_denoised():
    onlooker, seen = memory()
    frame_seen_by(onlooker, denoised=True)
    assert [view for view, _ in seen][:2] == ["left", "left"]


@pytest.mark.parametrize("first_look", [False, True])
def test_showing_changes_no_pixel(first_look):
    plain, shown = frame_seen_by(NOBODY), frame_seen_by(memory(first_look=first_look)[0])
    for view, passes in plain.eyes.items():
        assert passes.keys() == shown.eyes[view].keys()
        for name, image in passes.items():
            assert np.array_equal(image, shown.eyes[view][name], equal_nan=True), (view, name)


def test_what_a_look_has_synced_counts_as_the_source_s():
    """And the rest of it is outside the pair's total."""
    cost = SourceCost(seconds=10.0, sync_seconds=1.0)
    plain = frame_seen_by(NOBODY, cost=cost)
    shown = frame_seen_by(memory(first_look=True)[0], cost=cost)
    moved = LOOK_SYNC_SECONDS - cost.sync_seconds
    assert plain.source_cost == cost
    assert shown.source_cost == replace(cost, seconds=cost.seconds + moved, sync_seconds=LOOK_SYNC_SECONDS)
    assert Stage.LOOK not in plain.seconds
    parts = {stage: seconds for stage, seconds in shown.seconds.items() if stage != "total"}
    outside = parts[Stage.LOOK] + parts[Stage.ACCOUNT]
    assert shown.seconds["total"] == pytest.approx(sum(parts.values()) - outside, abs=ROUNDING_SECONDS)
    assert parts[Stage.SOURCE] > moved


def test_a_renderer_without_a_first_look_shows_the_rest():
    class Blind(Looker):
        def first_look(self, _view, **_):
            return None

    onlooker, seen = memory(first_look=True)
    plain = caster(ROOM)
    renderer = Blind(plain.world, plain.cameras)
    render_stereo_frame(renderer, StereoSettings(accuracy="draft", fill="packed"), watch=Stopwatch(onlooker))
    assert [view for view, _ in seen] == ["left", "right", "right"]


def test_holes_are_a_dark_checkerboard_and_the_rest_stays():
    colour = np.full((2 * CHECKER_SIDE_PX, 3 * CHECKER_SIDE_PX, 4), 0.5, np.float32)
    holes = np.ones(colour.shape[:2], bool)
    holes[0, 0] = False
    shown = with_checkerboard(colour, holes)
    assert np.array_equal(shown[0, 0], colour[0, 0])
    assert set(np.unique(shown[holes][:, :3])) == {np.float32(grey) for grey in CHECKER_GREYS}
    assert (shown[holes][:, 3] == 1.0).all()
    assert shown[1, 0, 0] != shown[1, CHECKER_SIDE_PX, 0] != shown[1, 2 * CHECKER_SIDE_PX, 0]
    assert (colour == 0.5).all()
