"""The part of a denoised picture that looks different from each eye: rendered with the source and with every trace, and
gone from what users get."""

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.engines.ray_passes import LIGHT_SWITCHES
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.working import rendered_layer, working_scene
from stereo_reproject.images.passes import COLOUR_PASS, VIEW_DEPENDENT_PASS
from stereo_reproject.images.reflected_light import LIGHT_PASS_PREFIXES, LIGHT_PASS_SUFFIXES, light_pass_names
from stereo_reproject.settings.frame import SceneOverrides
from stereo_reproject.trace.requests import TraceRequest
from tests.blender.toolbox import add_plane, diffuse, mirror_before_wall

SIZE = (48, 27)
NEWER = bpy.app.version >= (5, 0, 0)
LIGHT_PASSES = {light_pass_names(kind, part)[NEWER] for kind in LIGHT_PASS_PREFIXES for part in LIGHT_PASS_SUFFIXES}
ONE_PASS = light_pass_names("glossy", "direct")[NEWER]


@pytest.fixture
def scene():
    scene = mirror_before_wall(*SIZE, samples=4)
    add_plane(scene, diffuse("floor"), size=(4, 4), location=(0, -1.5, -4))
    scene.cycles.use_denoising = True
    return scene


def rendered(scene, folder, *, method="packed", probed=True):
    """The passes of the source, and those of all pixels of the target as they are traced by a method."""
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, folder)
        source, _ = renderer.render_source("left", probed=probed)
        everything = TraceRequest("right", np.ones(SIZE[::-1], bool))
        [traced] = renderer.trace(method, [everything])
        switched_on = [switch for switch in LIGHT_SWITCHES if getattr(rendered_layer(working), switch)]
        assert bool(switched_on) == (probed and renderer.plan.differs_in_reflected_light and bool(renderer.denoise))
    return source, {name: image.reshape(*SIZE[::-1], -1) for name, image in traced.items()}


@pytest.mark.parametrize("method", ["packed", "card", "full"])
def test_it_is_all_of_a_mirror_and_nothing_of_a_wall(scene, tmp_path, method):
    for passes in rendered(scene, tmp_path, method=method):
        colour, light = passes[COLOUR_PASS][..., :3], passes[VIEW_DEPENDENT_PASS]
        share = light.mean(axis=-1) / np.maximum(colour.mean(axis=-1), 1e-6)
        assert np.mean(share > 0.99) > 0.05
        assert np.mean(share < 0.01) > 0.2
        assert np.mean((share >= 0.01) & (share <= 0.99)) < 0.25
        assert light.min() >= 0.0


def test_light_passes_that_nobody_asked_for_are_gone(scene, tmp_path):
    for passes in rendered(scene, tmp_path):
        assert LIGHT_PASSES.isdisjoint(passes)
    assert not rendered_layer(scene).use_pass_glossy_direct


def test_a_light_pass_that_the_user_asked_for_stays(scene, tmp_path):
    rendered_layer(scene).use_pass_glossy_direct = True
    for passes in rendered(scene, tmp_path):
        assert {ONE_PASS} == LIGHT_PASSES & set(passes)
        assert VIEW_DEPENDENT_PASS in passes


def noisy(scene):
    scene.cycles.use_denoising = False


def out_of_focus(scene):
    scene.camera.data.dof.use_dof = True
    scene.camera.data.dof.aperture_fstop = 0.5


def moving(scene):
    scene.render.use_motion_blur = True
    for frame, x in ((1, 0.0), (2, 1.0)):
        scene.objects[-1].location.x = x
        scene.objects[-1].keyframe_insert("location", frame=frame)


def test_where_nothing_is_probed_it_is_not_rendered(scene, tmp_path):
    for passes in rendered(scene, tmp_path, probed=False):
        assert VIEW_DEPENDENT_PASS not in passes
        assert LIGHT_PASSES.isdisjoint(passes)


def test_a_frame_without_probes_after_one_with_them_has_none_of_their_light(scene, tmp_path):
    """An animation keeps its working scene, and its passes stay on."""
    with working_scene(scene, SceneOverrides()) as working:
        for probed in (True, False):
            source, _ = BlenderRenderer(working, tmp_path).render_source("left", probed=probed)
            assert (VIEW_DEPENDENT_PASS in source) == probed
            assert LIGHT_PASSES.isdisjoint(source)


@pytest.mark.parametrize("change", [noisy, out_of_focus, moving])
def test_where_all_light_may_look_different_it_is_not_told_apart(scene, tmp_path, change):
    change(scene)
    for passes in rendered(scene, tmp_path):
        assert VIEW_DEPENDENT_PASS not in passes
