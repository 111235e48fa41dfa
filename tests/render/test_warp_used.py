"""Who has warped a frame, as its report says it."""

import bpy
import pytest

from stereo_reproject.blender.api import StereoSettings, render_frame
from stereo_reproject.blender.gpu import warp as gpu_warp
from stereo_reproject.settings.frame import SceneOverrides
from tests.blender.toolbox import add_camera, add_plane, add_sun, diffuse, empty_scene

HAS_GPU = bpy.app.version >= (5, 2)


@pytest.fixture
def warp_of(tmp_path):
    """What the report of a small frame says of the warp, with what was asked for; also as a panorama."""
    scene = empty_scene(96, 54, samples=2)
    add_plane(scene, diffuse("wall"), size=(30, 20), location=(0, 0, -8))
    add_plane(scene, diffuse("card", colour=(0.9, 0.2, 0.1)), size=(1, 2), location=(0.3, 0.2, -4))
    add_sun(scene, strength=1.5)
    add_camera(scene)

    def rendered(asked, **overrides):
        settings = StereoSettings(accuracy="draft", warp=asked, scene=SceneOverrides(**overrides))
        return render_frame(tmp_path / "pair", settings, scene=scene)["warp"]

    return rendered


def test_who_was_asked_for_has_warped(warp_of):
    name = gpu_warp.usable()
    assert (name is not None) == HAS_GPU
    assert warp_of("gpu") == {"asked": "gpu", "used": "gpu" if name else "numpy", "gpu": name}
    assert warp_of("numpy") == {"asked": "numpy", "used": "numpy", "gpu": None}
    assert warp_of("auto") == {"asked": "auto", "used": "numpy", "gpu": None}, "a small picture on its own"


@pytest.mark.parametrize(("panorama", "size"), [("vr180", (64, 64)), ("vr360", (96, 48))])
def test_the_gpu_warps_panoramas(warp_of, panorama, size):
    assert warp_of("gpu", panorama=panorama, size=size)["used"] == ("gpu" if HAS_GPU else "numpy")


def test_a_frame_that_the_gpu_has_left_to_numpy_is_numpy_s(warp_of, monkeypatch):
    monkeypatch.setattr(gpu_warp, "_fits", lambda *_: False)
    assert warp_of("gpu") == {"asked": "gpu", "used": "numpy", "gpu": None}


def test_nothing_is_said_of_what_is_not_there(warp_of, monkeypatch, capfd):
    monkeypatch.setattr(gpu_warp, "_tried", lambda: None)
    assert warp_of("gpu") == {"asked": "gpu", "used": "numpy", "gpu": None}
    printed = capfd.readouterr()
    assert "gpu" not in f"{printed.out}{printed.err}".lower()
