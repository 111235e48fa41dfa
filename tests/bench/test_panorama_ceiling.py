"""What can be reused of an equirectangular pair, in worlds in which it is known."""

import numpy as np
import pytest

from stereo_reproject.views.camera import ViewPlane
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.spherical import SphericalStereo
from stereo_reproject.warp.tuning import TUNING
from tests.bench.panorama_ceiling import ceiling, reusable
from tests.warp.test_panoramas import PROJECTIONS, eye

SIZE = (96, 192)
"""(H, W) of the eyes of `tests.warp.test_panoramas`."""


def eyes(name, offset):
    return eye(PROJECTIONS[name], -offset, None), eye(PROJECTIONS[name], offset, None)


def test_the_most_that_can_be_gained():
    assert [ceiling(share) for share in (0.0, 0.5, 1.0)] == pytest.approx([1.0, 4.0 / 3.0, 2.0])


@pytest.mark.parametrize("depth", [0.3, np.inf])
def test_all_of_a_ball_and_of_the_sky_is_seen_by_both(depth):
    """All around, the picture's sides among it."""
    depths = {view: np.full(SIZE, depth, np.float32) for view in ("left", "right")}
    shown, usable = reusable(*eyes("360", 0.03), depths)
    assert shown.all()
    assert usable.all()


def test_what_hides_in_the_source_or_is_outside_of_it_is_not_seen():
    depths = {view: np.full(SIZE, 5.0, np.float32) for view in ("left", "right")}
    depths["left"][:, :48] = 1.0
    shown, _ = reusable(*eyes("VR180", 0.05), depths)
    # Beside the poles a place is up to some columns elsewhere, and the next column may be seen.
    assert not shown[20:-20, :46].any()
    assert shown[20:-20, 50:190].all()
    apart, _ = reusable(*eyes("VR180", 0.5), {view: np.full(SIZE, 2.0, np.float32) for view in ("left", "right")})
    assert 0.7 < apart.mean() < 0.95


@pytest.mark.parametrize(("stretch", "kept"), [(0.8 * TUNING.max_stretch, True), (1.2 * TUNING.max_stretch, False)])
def test_what_is_stretched_too_far_is_not_usable(stretch, kept):
    """A surface comes nearer from column to column, by just as much as has the source see it so many times as
    narrow. Parallel eyes, which stand o from the middle, are apart by 2 asin(o / distance)."""
    o, columns = 0.05, np.arange(SIZE[1]) + 0.5
    source, target = (eye_of(side * o) for side in (-1.0, 1.0))
    shift = np.clip((1.0 - 1.0 / stretch) * (80.0 - columns), 0.5, 12.0)
    ramp = (shift > 0.5) & (shift < 12.0)
    away = o / np.tan(0.5 * shift * 2.0 * np.pi / SIZE[1])
    cosine = np.cos((0.5 - (np.arange(SIZE[0]) + 0.5) / SIZE[0]) * np.pi)[:, None]
    in_source = np.interp(columns, columns + shift, away)
    depths = {"left": in_source / cosine, "right": away / cosine}
    shown, usable = reusable(source, target, depths)
    inner = ramp & np.roll(ramp, 1) & np.roll(ramp, -1)
    assert inner.sum() > 10
    assert shown[:, inner].all()
    assert np.all(usable[:, inner] == kept)


def eye_of(offset):
    stereo = SphericalStereo(offset, np.inf)
    return PanoramicCamera(*SIZE[::-1], np.eye(4), ViewPlane(0.0, 1.0, 0.0, 1.0), PROJECTIONS["360"], stereo)
