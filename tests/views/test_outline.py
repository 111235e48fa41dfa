"""Pixels that triangles cover, against rays that are held against the triangles themselves."""

import numpy as np
import pytest

from stereo_reproject.images.masks import dilate
from stereo_reproject.views.outline import covered_pixels
from tests.warp.analytic import pixel_centres, px_from_world, stereo_rig, world_rays

EYE = stereo_rig((90, 60), mode="off-axis", ipd=0.15, convergence=4.0)["left"]

BESIDE_PX = 3
"""Pixels beside a covered one that may count as covered too."""


def hit(points, triangles, eye):
    """(H, W) whether the ray through each pixel's centre meets any triangle; by Moeller and Trumbore."""
    x, y = pixel_centres(eye)
    origin, direction = world_rays(eye, x, y)
    found = np.zeros(x.shape, bool)
    for one, two, three in points[triangles]:
        across = np.cross(direction, three - one)
        det = across @ (two - one)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.sum(across * (origin - one), axis=-1) / det
            beside = np.cross(origin - one, two - one)
            v = np.sum(direction * beside, axis=-1) / det
            ahead = np.sum(beside * (three - one), axis=-1) / det
        found |= (u >= 0) & (v >= 0) & (u + v <= 1) & (ahead > 0)
    return found


def shown_points(points, triangles, eye):
    """(H, W) the pixels in which points lie that are strewn over the triangles: slivers that no ray meets too."""
    shares = np.random.default_rng(1).dirichlet((0.7, 0.7, 0.7), size=4000)
    place = np.einsum("nk,tkc->tnc", shares, points[triangles]).reshape(-1, 3)
    x, y = px_from_world(eye, place)[:2]
    found = np.zeros((eye.height, eye.width), bool)
    inside = (x >= 0) & (x < eye.width) & (y >= 0) & (y < eye.height)
    found[y[inside].astype(int), x[inside].astype(int)] = True
    return found


def one_of_each():
    generator = np.random.default_rng(4)
    middle = np.array([0.0, 0.0, -5.0])
    small = middle + generator.normal(scale=1.2, size=(60, 1, 3)) + generator.normal(scale=0.05, size=(60, 3, 3))
    large = middle + generator.normal(scale=1.0, size=(3, 3, 3))
    points = np.concatenate([small, large]).reshape(-1, 3)
    return points, np.arange(len(points)).reshape(-1, 3)


def test_all_that_a_ray_meets_is_covered_and_little_else():
    points, triangles = one_of_each()
    met, covered = hit(points, triangles, EYE), covered_pixels(points, triangles, EYE)
    assert 0.05 < met.mean() < 0.9
    assert not (met & ~covered).any()
    shown = shown_points(points, triangles, EYE)
    assert not (shown & ~covered).any()
    assert not (covered & ~dilate(met | shown, BESIDE_PX)).any()


@pytest.mark.parametrize("behind", [1, 2])
def test_of_a_triangle_that_reaches_behind_the_camera_all_that_is_ahead_is_covered(behind):
    points = np.array([[-1.0, -0.5, -4.0], [1.0, -0.4, -4.0], [0.2, 0.6, -3.0]])
    points[:behind, 2] = 2.0
    triangles = np.array([[0, 1, 2]])
    met, covered = hit(points, triangles, EYE), covered_pixels(points, triangles, EYE)
    assert met.any()
    assert not (met & ~covered).any()


def test_what_is_behind_the_camera_or_beside_the_picture_covers_nothing():
    points = np.array([[-1.0, -0.5, 4.0], [1.0, -0.4, 4.0], [0.2, 0.6, 3.0]])
    assert not covered_pixels(points, np.array([[0, 1, 2]]), EYE).any()
    assert not covered_pixels(points * (1, 1, -1) + (50, 0, 0), np.array([[0, 1, 2]]), EYE).any()
    assert not covered_pixels(np.zeros((0, 3)), np.zeros((0, 3), int), EYE).any()
