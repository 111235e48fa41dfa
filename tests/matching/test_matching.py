"""Traced pixels matched to a picture: nothing changes where engines agree, and a law is found where one holds."""

import numpy as np
import pytest

from stereo_reproject.images.masks import dilate
from stereo_reproject.images.metrics import tone
from stereo_reproject.matching.matching import Correction, TracedPixels, correction_of, match, ring_of

HEIGHT, WIDTH = 40, 60

VISIBLE_STEP = 1.0 / 255.0
"""Difference after tone mapping that can be seen: a step of 8 bits."""

LEARNED_ERROR = 8.0 * VISIBLE_STEP
"""Largest error, after tone mapping, of a law that was learned from 180 pixels full of noise."""


class Room:
    """A wall in two colours, bent in the middle, and a hole in its picture."""

    def __init__(self):
        random = np.random.default_rng(7)
        rows, columns = np.indices((HEIGHT, WIDTH))
        self.albedo = np.where((columns // 7 + rows // 5)[..., None] % 2, (0.8, 0.4, 0.2), (0.2, 0.5, 0.6))
        bend = np.clip((columns - WIDTH / 2) / 10.0, -1.0, 1.0)
        self.normal = np.stack([0.7 * bend, 0.0 * bend, np.sqrt(1.0 - 0.49 * bend**2)], axis=-1)
        self.nearness = np.full((HEIGHT, WIDTH), 0.2)
        self.light = self.albedo * random.uniform(0.2, 0.6, (HEIGHT, WIDTH, 1))
        self.emitted = np.zeros((HEIGHT, WIDTH, 3))
        self.holes = np.zeros((HEIGHT, WIDTH), bool)
        self.holes[10:30, 15:45] = True
        self.refracts = np.zeros_like(self.holes)

    def matched(self, picture, *, doubted=None, seen_at=None):
        """The picture with its holes matched; seen_at (H, W) is its nearness, where that is not what is traced."""
        ring = ring_of(self.holes, np.ones_like(self.holes))
        domain = self.holes | ring
        fields = [self.light + self.emitted, self.emitted, self.albedo, 0.0 * self.albedo, self.normal]
        depth = np.divide(1.0, self.nearness, out=np.zeros_like(self.nearness), where=self.nearness > 0.0)
        traced = TracedPixels(
            *(field[domain].astype(np.float32) for field in (*fields, self.nearness, depth)), self.refracts[domain]
        )
        doubted = np.zeros_like(domain) if doubted is None else doubted
        # What the picture shows in the holes must not matter.
        blind = np.where((self.holes & ~doubted)[..., None], 77.0, picture).astype(np.float32)
        nearness = np.where(self.holes & ~doubted, 0.0, self.nearness if seen_at is None else seen_at)
        result = picture.copy()
        result[domain] = match(blind, traced, domain, known=ring, doubted=doubted, nearness=nearness)
        return result


def test_where_both_engines_agree_nothing_changes():
    room = Room()
    assert np.abs(tone(room.matched(room.light)) - tone(room.light)).max() < VISIBLE_STEP


def test_light_from_all_around_is_learned_apart_from_albedo():
    """The tracer has shadows and noise where the picture is evenly lit."""
    room = Room()
    even = room.albedo * (1.5 + 0.6 * room.normal[..., :1] + 0.4 * room.normal[..., 2:])
    assert np.abs(tone(room.matched(even)) - tone(even)).max() < LEARNED_ERROR


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.5), (3.0, 0.0), (0.5, 0.1)])
def test_a_constant_difference_is_taken_out(gain, offset):
    room = Room()
    picture = gain * room.light + offset
    assert np.abs(tone(room.matched(picture)) - tone(picture)).max() < LEARNED_ERROR


def test_the_sky_and_lamps_stay_as_they_are():
    room = Room()
    sky = np.zeros((HEIGHT, WIDTH), bool)
    sky[:, 30:] = True
    room.emitted[sky] = np.random.default_rng(1).uniform(3.0, 9.0, (int(sky.sum()), 3))
    room.albedo[sky] = room.light[sky] = room.normal[sky] = 0.0
    room.nearness[sky] = 0.0
    picture = room.emitted + 2.0 * room.albedo
    matched = room.matched(picture)
    inside = room.holes & ~dilate(~sky, 1)
    assert np.abs(tone(matched) - tone(picture))[inside].max() < VISIBLE_STEP


def test_colours_stay_from_zero():
    room = Room()
    assert room.matched(0.0 * room.light).min() >= 0.0


def test_what_the_tracer_cannot_tell_is_left_to_a_silhouette_that_shows_it():
    """One surface is lit in the picture in a way that nothing explains; at its edge the picture tells."""
    room = Room()
    near = np.zeros((HEIGHT, WIDTH), bool)
    near[:, 30:] = True
    room.nearness[near] = 0.5
    strange = np.where(near[..., None], 0.2 + 2.0 * np.random.default_rng(2).random((HEIGHT, 1, 1)), room.light)
    doubted = np.zeros_like(near)
    doubted[10:30, 29:31] = True
    off = [np.abs(tone(room.matched(strange, doubted=mask)) - tone(strange))[doubted] for mask in (None, doubted)]
    assert off[1].mean() < 0.5 * off[0].mean()


def test_a_silhouette_that_shows_another_depth_is_believed_less():
    """A wire of one pixel, of which the picture shows what is behind it."""
    room = Room()
    wire = np.zeros((HEIGHT, WIDTH), bool)
    wire[10:30, 30] = True
    behind = room.nearness.copy()
    room.nearness[wire] = 2.0 * behind[wire]
    room.light[wire] = 0.01
    picture = room.light.copy()
    picture[wire] = 1.0
    shown = [room.matched(picture, doubted=wire, seen_at=nearness)[wire].mean() for nearness in (room.nearness, behind)]
    assert shown[1] < 0.7 * shown[0]


def test_what_refracts_is_no_brighter_than_what_is_beside_it():
    """Light from behind it that is taken for its albedo, in single pixels of a rim that the source has seen."""
    room = Room()
    rim = np.zeros((HEIGHT, WIDTH), bool)
    rim[10:30, 30] = True
    room.nearness[:, 30:] = 0.5
    picture = room.light.copy()
    room.albedo[rim], room.light[rim] = 1.0, 5.0
    band = np.zeros_like(rim)
    band[10:30, 29:31] = True
    shown = []
    for refracts in (False, True):
        room.refracts = rim & refracts
        shown.append(room.matched(picture, doubted=band)[rim].max())
    assert shown[1] <= picture.max() < 0.5 * shown[0]
    # From one side alone nothing follows.
    assert room.matched(picture, doubted=rim)[rim].max() > picture.max()


def test_what_the_source_saw_beside_something_else_leaves_no_ghost():
    """A silhouette where there is no edge in the target is not believed."""
    room = Room()
    doubted = np.zeros((HEIGHT, WIDTH), bool)
    doubted[12:28, 20] = True
    picture = room.light.copy()
    picture[doubted] = 9.0
    assert room.matched(picture, doubted=doubted)[doubted].max() < 1.0


def test_without_a_ring_what_was_traced_stays():
    room = Room()
    room.holes[:] = True
    traced = room.matched(room.light)
    assert np.allclose(traced, room.light, atol=1e-5)


def test_the_correction_is_in_shares_of_the_picture_s_brightness():
    assert correction_of(np.full((10, 3), 1.0), np.full((10, 3), 1.0), np.ones((4, 4, 3))) == Correction(0.0, 0.0)
    found = correction_of(np.full((10, 3), 1.0), np.zeros((10, 3)), np.ones((4, 4, 4)))
    assert found == Correction(1.0, 1.0)
    assert correction_of(np.zeros((0, 3)), np.zeros((0, 3)), np.ones((4, 4, 3))) == Correction(0.0, 0.0)
