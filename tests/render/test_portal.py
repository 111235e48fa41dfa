"""The portal of a packed render: it is in no plain render, nothing of it stays, and it says what it cannot trace."""

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.engines.packed_trace import packed_camera
from stereo_reproject.blender.engines.portal_sheet import SHEET_NAME
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.devices import devices_in_use, use_devices
from stereo_reproject.blender.scene.missing import missing_files
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.settings.frame import SceneOverrides
from stereo_reproject.trace.requests import TraceRequest
from tests.blender.toolbox import EYES, Material, add_cube, render_plain, rms
from tests.render.every_pass import every_pass
from tests.render.test_fill import NOISE, blocker, defocus, studio

KINDS = ("objects", "meshes", "materials", "images", "cameras", "scenes")

TIMES = {"Render Time"}
"""Passes that are another in every render."""


def portal_renderer(working, folder):
    return BlenderRenderer(working, folder, packed_by="portal")


def trace(renderer, *views):
    """The passes (N, C) of whole views, traced together."""
    cameras = [renderer.cameras[view] for view in views]
    sizes = [np.ones((camera.height, camera.width), bool) for camera in cameras]
    return renderer.trace("packed", [TraceRequest(*pair) for pair in zip(views, sizes, strict=True)])


def test_a_plain_render_shows_nothing_of_it(tmp_path):
    """Nor does its header: the source of an animation's next frame is as if nothing had been traced."""
    scene = every_pass(tmp_path, 48, 27)
    texts = []
    with working_scene(scene, SceneOverrides()) as working:
        renderer = portal_renderer(working, tmp_path)
        before, _ = renderer.render_source("left")
        texts.append(dict(renderer.metadata))
        trace(renderer, "right")
        assert any(item.name.startswith(SHEET_NAME) for item in working.objects)
        again = portal_renderer(working, tmp_path)
        after, _ = again.render_source("left")
        texts.append(dict(again.metadata))
        assert again.plan == renderer.plan
        assert missing_files(scene) == []
        assert blocker(scene, tmp_path, "portal") is None
    assert set(before) == set(after)
    for name in set(before) - TIMES:
        np.testing.assert_array_equal(after[name], before[name], err_msg=name)
    first, second = ({key: text for key, text in one.items() if "cryptomatte" in key} for one in texts)
    assert any(key.endswith("manifest") for key in first)
    assert SHEET_NAME not in str(second)
    own = [text for key, text in first.items() if "manifest" in key and '"ball"' in text]
    assert [text for key, text in second.items() if "manifest" in key and '"ball"' in text] == own


def test_nothing_of_it_stays(tmp_path):
    scene = studio(tmp_path, lit=False)
    render_plain(scene, tmp_path, views=("left",))
    before = {kind: set(getattr(bpy.data, kind).keys()) for kind in KINDS}
    with working_scene(scene, SceneOverrides()) as working:
        trace(portal_renderer(working, tmp_path), *EYES)
        assert len(bpy.data.images) > len(before["images"])
    assert {kind: set(getattr(bpy.data, kind).keys()) for kind in KINDS} == before


def test_traces_of_all_kinds_one_after_the_other(tmp_path):
    """Of one view and of both, with a lens and without: each finds the nodes that it needs, and its own tables."""
    scene = studio(tmp_path, lit=False)
    a, b = (render_plain(scene, tmp_path, seed=seed) for seed in (1, 2))
    with working_scene(scene, SceneOverrides()) as working:
        renderer = portal_renderer(working, tmp_path)
        for views in (("right",), ("left",), EYES, ("right",), EYES):
            for view, passes in zip(views, trace(renderer, *views), strict=True):
                one, other = (passes_of[view][COLOUR_PASS].reshape(-1, 4) for passes_of in (a, b))
                assert rms(passes[COLOUR_PASS] - one) < NOISE * rms(other - one), (views, view)
            defocus(working)
            trace(renderer, "right")
            working.camera.data.dof.use_dof = False


def test_it_is_taken_away_where_a_plain_render_might_show_it(tmp_path):
    """A near clip that is animated may come closer than the sheet of the last frame stands."""
    scene = studio(tmp_path, lit=False)
    scene.camera.data.clip_start = 2.0
    with working_scene(scene, SceneOverrides()) as working:
        trace(portal_renderer(working, tmp_path), "left")
        working.camera.data.clip_start = scene.camera.data.clip_start = 0.01
        ours, _ = portal_renderer(working, tmp_path).render_source("left")
    plain = render_plain(scene, tmp_path, views=("left",))["left"]
    np.testing.assert_array_equal(ours[COLOUR_PASS], plain[COLOUR_PASS])


# What it cannot trace


def world_volume(scene):
    nodes, links = scene.world.node_tree.nodes, scene.world.node_tree.links
    output = next(node for node in nodes if node.bl_idname == "ShaderNodeOutputWorld")
    links.new(nodes.new("ShaderNodeVolumeScatter").outputs[0], output.inputs["Volume"])


def something_far_away(scene):
    add_cube(scene, Material("far"), size=10.0, location=(0, 0, -2000))


def something_far_away_behind(scene):
    add_cube(scene, Material("far"), size=10.0, location=(0, 0, 2000))


def no_surfaces(scene):
    scene.view_layers[0].use_solid = False


def texture_limit(scene):
    scene.render.use_simplify, scene.cycles.texture_limit_render = True, "1024"


def path_guiding(scene):
    scene.cycles.use_guiding = True


def shaders_in_osl(scene):
    scene.cycles.shading_system = True


def hardly_any_near_clip(scene):
    scene.camera.location.x, scene.camera.data.clip_start = 1000.0, 1e-4


def alpha_threshold_of_0(scene):
    scene.view_layers[0].pass_alpha_threshold = 0.0


def as_it_is(scene):
    pass


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (as_it_is, None),
        (world_volume, "volume"),
        (something_far_away, "clip end"),
        (something_far_away_behind, None),
        (no_surfaces, "surfaces"),
        (texture_limit, "texture limit"),
        (shaders_in_osl, "OSL"),
        (path_guiding, "guiding"),
        (hardly_any_near_clip, "near clip"),
        (alpha_threshold_of_0, None),
    ],
)
def test_what_it_cannot_trace_is_said(tmp_path, change, words):
    scene = studio(tmp_path, lit=False)
    change(scene)
    reason = blocker(scene, tmp_path, "portal")
    assert (words in reason) if words else reason is None


@pytest.mark.parametrize(("device", "kind", "taken"), [("CPU", "NONE", "osl"), ("GPU", "HIP", "portal")])
def test_it_is_taken_where_there_are_no_osl_cameras(tmp_path, device, kind, taken):
    scene = studio(tmp_path, lit=False)
    kept = devices_in_use()
    try:
        use_devices({"type": kind, "ids": [], "options": {}})
        scene.cycles.device = device
        assert packed_camera(scene).name == taken
        assert packed_camera(scene, "portal").name == "portal"
        if taken == "portal":
            with pytest.raises(BadInputError, match="--packed-by osl is not possible: the device has no OSL cameras"):
                packed_camera(scene, "osl")
        scene.camera.data.type = "ORTHO"
        assert packed_camera(scene).name == "portal"
    finally:
        use_devices(kept)
