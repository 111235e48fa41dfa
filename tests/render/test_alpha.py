"""Alpha of a warped eye: along a black object's edges, in a catcher's shadow and around what a holdout cuts out."""

from __future__ import annotations

import numpy as np
import pytest

from stereo_reproject.blender.commands.compare import flips, render_reference
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.settings.frame import StereoSettings
from tests.blender.toolbox import (
    add_camera,
    add_plane,
    add_sphere,
    add_sun,
    diffuse,
    emission,
    empty_scene,
)
from tests.render.ruler import TARGET, render_frame

SIZE = (192, 108)
SAMPLES = 16

PROMISE = SETTINGS["balanced"].promise
"""Honest ratio, and so noise ratio too, that the balanced setting promises."""

FLIP_RATIO = 1.05
"""What FLIP over a middle grey may be at most, over that of a second plain render."""

VISIBLE_ALPHA = 0.1
"""A pixel of the band along an edge may be told from its inside by this much, a fraction of what is mixed along it."""


def black_ball(scene):
    """Its light is that of the film behind it: none."""
    add_sphere(scene, emission("black", strength=0.0), radius=0.8, location=(0, 0, -4))


def shadow_catcher(scene):
    """A ball's shadow on a floor that is nothing but a catcher."""
    floor = add_plane(scene, diffuse("floor"), size=(20.0, 20.0), location=(0, -1, -5), rotation=(-np.pi / 2, 0, 0))
    floor.is_shadow_catcher = True
    add_sphere(scene, diffuse("ball"), radius=0.6, location=(0, 0, -4))
    sun = add_sun(scene, rotation=(-0.9, 0.4, 0.0))
    sun.data.angle = 0.3


def holdout(scene):
    """A ball that cuts a hole into a bright wall."""
    add_plane(scene, diffuse("wall"), size=(20.0, 20.0), location=(0, 0, -7))
    add_sphere(scene, diffuse("cut"), radius=0.8, location=(0, 0, -4)).is_holdout = True
    add_sun(scene)


@pytest.fixture
def scene():
    scene = empty_scene(*SIZE, samples=SAMPLES)
    scene.render.film_transparent = True
    add_camera(scene)
    return scene


@pytest.mark.parametrize(("subject", "percent"), [(black_ball, 100), (shadow_catcher, 100), (holdout, 200)])
def test_alpha_is_within_the_noise_of_plain_renders(scene, tmp_path, subject, percent):
    """A holdout has no depth, and probes alone find its rim: that takes a larger picture, which has more of them."""
    subject(scene)
    scene.render.resolution_percentage = percent
    frame = render_frame(scene, tmp_path, fill="packed")
    ours = frame.eyes[TARGET][COLOUR_PASS]
    multiview = render_reference(scene, StereoSettings(), tmp_path, light_scale=frame.light_scale)
    measured = multiview.judge(ours, frame.variance_share)
    assert measured["noise_ratio"] <= PROMISE
    assert measured["honest_ratio"] <= PROMISE
    flip, noise_flip = flips(scene, StereoSettings(), ours, multiview, tmp_path)
    assert flip <= FLIP_RATIO * noise_flip
    reference, again = multiview.reference, multiview.again
    warped = ~frame.traced
    off, noise = (np.abs(picture - reference)[..., 3] for picture in (ours, again))
    # Beside an edge two standard deviations of noise are allowed, and a plain render's largest difference is some four.
    assert off[warped].max() < max(1.5 * noise.max(), VISIBLE_ALPHA)
