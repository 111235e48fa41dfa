"""The warp of panoramas on the GPU: what numpy's is, along rows and quad by quad, across the seam of a whole turn,
beside poles and at the edge of a lens."""

from __future__ import annotations

import bpy  # noqa: F401 - there is no gpu before it
import numpy as np
import pytest

from stereo_reproject.blender.gpu import warp as gpu_warp
from stereo_reproject.views.camera import ViewPlane, goes_round, target_px_from_source_px
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import (
    CentralCylindrical,
    EquiangularCubeFace,
    Equirectangular,
    FisheyeEquidistant,
    FisheyeEquisolid,
    Rectilinear,
)
from stereo_reproject.views.spherical import PoleMerge, SphericalStereo
from stereo_reproject.warp.scanline import row_law_of
from tests.blender.gpu.gpu_cases import (
    HAS_GPU,
    SCENES,
    assert_keeps_its_promise,
    assert_same,
    both,
    both_wholly,
    passes_of,
)
from tests.warp.analytic import pixel_centres, pose
from tests.warp.pairs import warp_pair
from tests.warp.test_hard_cases import blocks, chequers, comb, every_step, rows, slats

SIZE = (260, 130)
HALF, WHOLE = (-np.pi / 2, np.pi / 2), (-np.pi, np.pi)
PICTURE = ViewPlane(0.0, 1.0, 0.0, 1.0)
PROJECTIONS = {
    "VR180": Equirectangular(HALF, HALF),
    "360": Equirectangular(WHOLE, HALF),
    "fisheye": FisheyeEquidistant(np.pi),
    "equisolid": FisheyeEquisolid(10.5, np.radians(170.0), (36.0, 18.0)),
    "cube face": EquiangularCubeFace(),
    "cylinder": CentralCylindrical(WHOLE, (-1.5, 1.5)),
}
STEREO = ["plain", "toed in", "spherical", "parallel", "merged"]
GENERAL = pose((0.2, -0.15, 0.1), yaw=0.3, pitch=-0.2, roll=0.15)


def pair(name, stereo, size=SIZE, window=PICTURE):
    """Two eyes that are plain lenses, side by side or turned towards each other, or those of spherical stereo."""
    merge = PoleMerge(np.radians(60.0), np.radians(75.0)) if stereo == "merged" else None
    eyes = []
    for offset in (-0.0325, 0.0325):
        eye, place = None, GENERAL
        if stereo in ("plain", "toed in"):
            place = GENERAL @ pose((offset, 0.0, 0.0), yaw=offset if stereo == "toed in" else 0.0)
        else:
            eye = SphericalStereo(offset, np.inf if stereo == "parallel" else 2.5, merge)
        eyes.append(PanoramicCamera(*size, place, window, PROJECTIONS[name], eye))
    return eyes


def seen(kind, camera, seed=0):
    """`gpu_cases.passes_of`, with no depth where the lens shows nothing."""
    source = passes_of(kind, (camera.width, camera.height), seed)
    depth = camera.depth_from_pass(*pixel_centres(camera), source["Depth"][..., 0])
    return source | {"Depth": depth.astype(np.float32)[..., None]}


@pytest.mark.parametrize("stereo", STEREO)
@pytest.mark.parametrize("name", PROJECTIONS)
@pytest.mark.parametrize("scene", SCENES)
def test_it_is_what_numpy_does(name, stereo, scene, dispatched):
    one, other = pair(name, stereo)
    ours, numpys = both(seen(scene, one), one, other, colour_interpolation="cubic")
    assert_same(ours, numpys)
    assert bool(dispatched) == HAS_GPU
    assert scene == "noise" or 0.4 < ours.warp.covered.mean() <= 1.0


@pytest.mark.parametrize("stereo", STEREO)
@pytest.mark.parametrize("name", PROJECTIONS)
def test_from_right_to_left_and_with_coarse_cells(name, stereo):
    one, other = pair(name, stereo)[::-1]
    for threshold in (0.0, 1.0, 1000.0):
        assert_same(*both(seen("steps", one), one, other, grid_threshold=threshold))
        assert_same(*both(seen("smooth", one), one, other, grid_threshold=threshold))


@pytest.mark.parametrize("stereo", STEREO)
@pytest.mark.parametrize("name", PROJECTIONS)
@pytest.mark.parametrize("scene", SCENES)
def test_the_whole_stage_has_the_same_mask_and_colours(name, stereo, scene):
    cameras = pair(name, stereo)
    assert_keeps_its_promise(*both_wholly(seen(scene, cameras[0], seed=1), cameras))


PATTERNS = [comb, slats, chequers, blocks, every_step, rows]


@pytest.mark.parametrize("stereo", ["plain", "spherical"])
@pytest.mark.parametrize("name", ["VR180", "360", "fisheye", "cylinder"])
@pytest.mark.parametrize("pattern", PATTERNS)
def test_the_promise_is_kept_on_the_hardest_patterns(name, stereo, pattern):
    size = (124, 62)
    cameras = pair(name, stereo, size)
    source = seen("smooth", cameras[0])
    depth = np.broadcast_to(pattern(*np.meshgrid(np.arange(size[0]), np.arange(size[1]))), size[::-1])
    source["Depth"] = np.where(np.isnan(source["Depth"]), np.nan, depth.astype(np.float32)[..., None])
    assert_keeps_its_promise(*both_wholly(source, cameras, "exact"))


@pytest.mark.parametrize("stereo", STEREO)
@pytest.mark.parametrize("window", [ViewPlane(0.1, 0.9, 0.2, 0.7), ViewPlane(0.3, 1.3, -0.1, 0.9)])
@pytest.mark.parametrize("name", PROJECTIONS)
def test_cut_and_shifted_pictures(name, stereo, window):
    one, other = pair(name, stereo, window=window)
    assert_same(*both(seen("steps", one), one, other))


@pytest.mark.parametrize("scene", SCENES)
def test_spherical_stereo_in_perspective(scene):
    """Around the world's z, which stands aslant in the picture."""
    window = ViewPlane(-0.8, 0.8, -0.4, 0.4)
    one, other = (
        PanoramicCamera(*SIZE, GENERAL, window, Rectilinear(), SphericalStereo(offset, 2.5), around_world=True)
        for offset in (-0.0325, 0.0325)
    )
    assert_same(*both(passes_of(scene, SIZE), one, other))


@pytest.mark.parametrize("size", [(2, 1), (6, 3), (34, 17), (33, 40)])
@pytest.mark.parametrize("stereo", ["plain", "spherical"])
@pytest.mark.parametrize("name", ["VR180", "360", "fisheye", "cylinder"])
def test_odd_sizes(name, stereo, size):
    one, other = pair(name, stereo, size)
    assert_same(*both(seen("steps", one), one, other), allowed=0.0)


@pytest.mark.parametrize("stereo", STEREO)
@pytest.mark.parametrize("name", ["360", "cylinder"])
def test_nothing_is_missing_at_the_seam_of_a_whole_turn(name, stereo):
    """Held against the cameras themselves, not against numpy's warp: in what is nearly a sphere, far from the poles."""
    one, other = pair(name, stereo)
    assert goes_round(one)
    source = passes_of("smooth", SIZE)
    # Of cells that are flat none would be subdivided, and a coarse one may bend by a tenth of a pixel.
    source["Depth"] = 2.0 + 1e-4 * (source["Depth"] - 2.0)
    ours = warp_pair(source, one, other, how=gpu_warp.warp_view, grid_threshold=0.0)
    beside = np.s_[30:100, np.r_[-8:8] % SIZE[0]]
    assert not ours.empty[beside].any()
    x, y = (axis[beside] for axis in pixel_centres(other))
    depth = ours.passes["Depth"][..., 0][beside].astype(np.float64)
    back_x, back_y, _ = target_px_from_source_px(other, one, x, y, depth)
    off = ours.warp.x[beside] - back_x
    off -= SIZE[0] * np.round(off / SIZE[0])
    np.testing.assert_allclose(off, 0.0, atol=4e-3)
    np.testing.assert_allclose(ours.warp.y[beside], back_y, atol=4e-3)


@pytest.mark.parametrize("stereo", STEREO)
@pytest.mark.parametrize("name", ["360", "cylinder"])
@pytest.mark.parametrize("columns", [np.r_[:20], np.r_[-20:0], np.r_[-1:1], np.r_[-3:2]])
def test_steps_in_depth_at_the_seam_of_a_whole_turn(name, stereo, columns):
    one, other = pair(name, stereo)
    source = passes_of("smooth", SIZE)
    source["Depth"][:, columns] = 0.4
    assert_same(*both(source, one, other))
    assert_same(*both(source, other, one))


@pytest.mark.parametrize("stereo", STEREO)
@pytest.mark.parametrize("name", PROJECTIONS)
@pytest.mark.parametrize("scene", ["smooth", "steps", "noise"])
def test_things_nearer_than_the_eyes_are_to_each_other(name, stereo, scene):
    """The target's eye stands within them, and sees some from behind: quads reach around half of all angles."""
    one, other = pair(name, stereo)
    source = seen(scene, one)
    source["Depth"] *= np.float32(0.02)
    assert_same(*both(source, one, other, grid_threshold=1000.0))


def test_pairs_are_warped_along_rows_or_quad_by_quad():
    along_rows = {
        (name, stereo): row_law_of(*pair(name, stereo)) is not None for name in PROJECTIONS for stereo in STEREO
    }
    assert {key for key, found in along_rows.items() if found} == {
        (name, stereo) for name in ("VR180", "360") for stereo in ("spherical", "parallel", "merged")
    }
