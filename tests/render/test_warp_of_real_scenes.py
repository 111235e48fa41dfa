"""Scenes that other people made, rendered once: the GPU and numpy make the same of them."""

from dataclasses import replace

import bpy  # noqa: F401 - there is no gpu before it
import numpy as np
import pytest

from stereo_reproject.blender.api import StereoSettings, render_frame
from stereo_reproject.blender.gpu import warp as gpu_warp
from stereo_reproject.blender.scene.working import open_blend
from stereo_reproject.holes.reprojection import reproject
from stereo_reproject.pipeline import warping
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.settings.frame import SceneOverrides
from stereo_reproject.views.view import View
from stereo_reproject.warp.warper import NUMPY, Warper
from tests.bench.performance.plan import EYES
from tests.blender.gpu.gpu_cases import HAS_GPU, assert_keeps_its_promise
from tests.warp.analytic import pose

pytestmark = pytest.mark.slow

SCENES = (
    "living-room",
    "classroom",
    "bathroom",
    "veach-mis",
    "cornell-box",
    "meadow",
    "glass-vase",
    "broken-window",
    "fur-ball",
)

TOLD = 0.3
"""Of a target, the least share that is warped and so compared."""


class WarpedError(Exception):
    """The source is rendered, and nothing else is wanted."""


def rendered(blend, folder, **overrides):
    """What is handed to the warp: the sources, the target, the accuracy and the options."""
    handed = []

    def taken(*arguments, **options):
        handed.append((*arguments, options))
        raise WarpedError

    scene = open_blend(blend)
    small = SceneOverrides(samples=2, denoise=False, **overrides)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(warping, "reproject", taken)
        with pytest.raises(WarpedError):
            render_frame(folder, StereoSettings(warp="numpy", scene=small), scene=scene)
    return handed[0]


def assert_agreement(sources, target, options):
    """Of the eye itself, and of one that is turned, so that rows are not enough."""
    assert np.isfinite(sources[0].depth).mean() > 0.2, "there is something in it"
    eye = target.camera
    turned = eye.world_from_camera @ pose((0.0, 0.0, 0.0), yaw=0.02, pitch=0.01, roll=0.01)
    others = View("turned", replace(eye, world_from_camera=turned))
    for other in (target, others):
        for accuracy in ("balanced", "exact"):
            ours, numpys = (
                reproject(sources, other, SETTINGS[accuracy], **options | {"warper": warper})
                for warper in (Warper(gpu_warp.warp_view), NUMPY)
            )
            assert ours.warped_by == ("gpu" if HAS_GPU else "numpy")
            assert assert_keeps_its_promise(ours, numpys) > TOLD


@pytest.mark.parametrize("name", SCENES)
def test_the_gpu_and_numpy_agree(shared_scenes, tmp_path, name):
    blend, (interocular, convergence) = shared_scenes / name / f"{name}.blend", EYES[name]
    eyes = {"interocular_distance": interocular, "convergence_distance": convergence}
    sources, target, _, options = rendered(blend, tmp_path / "pair", size=(160, 90), **eyes)
    assert_agreement(sources, target, options)


@pytest.mark.parametrize(
    ("name", "panorama", "size"),
    [
        ("living-room", "vr180", (144, 144)),
        ("classroom", "vr180", (144, 144)),
        ("bathroom", "vr360", (192, 96)),
        ("meadow", "vr360", (192, 96)),
    ],
)
def test_they_agree_on_panoramas(shared_scenes, tmp_path, name, panorama, size):
    blend, interocular = shared_scenes / name / f"{name}.blend", EYES[name][0]
    sources, target, _, options = rendered(
        blend, tmp_path / "pair", size=size, panorama=panorama, interocular_distance=interocular
    )
    assert_agreement(sources, target, options)
