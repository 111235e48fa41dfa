"""The portal of a packed render: it is in no plain render, nothing of it stays, and it says what it cannot trace."""

from dataclasses import replace

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.commands.frame import InSequence, render_pair
from stereo_reproject.blender.engines.eevee import renderer_of
from stereo_reproject.blender.engines.packed_trace import CAMERAS, packed_blocker
from stereo_reproject.blender.engines.portal_sheet import SHEET_NAME
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.devices import devices_in_use, use_devices
from stereo_reproject.blender.scene.missing import missing_files
from stereo_reproject.blender.scene.working import WorkingScenes, working_scene
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.pipeline.shared_findings import SharedFindings
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from stereo_reproject.trace.costs import TraceCosts
from stereo_reproject.trace.requests import TraceRequest
from tests.blender.toolbox import EYES, Material, add, add_cube, add_plane, keyframes, render_plain, rms
from tests.render.every_pass import every_pass
from tests.render.test_eevee import EEVEE
from tests.render.test_fill import ANIMATED_NOISE, NOISE, blocker, defocus, moving_camera, moving_object, studio

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
    sharp = [render_plain(scene, tmp_path, seed=seed) for seed in (1, 2)]
    defocus(scene)
    blurred = [render_plain(scene, tmp_path, seed=seed) for seed in (1, 2)]
    with working_scene(scene, SceneOverrides()) as working:
        renderer = portal_renderer(working, tmp_path)
        for views in (("right",), ("left",), EYES, ("right",), EYES):
            for lens in (False, True):
                working.camera.data.dof.use_dof = lens
                for view, passes in zip(views, trace(renderer, *views), strict=True):
                    one, other = (plain[view][COLOUR_PASS].reshape(-1, 4) for plain in (blurred if lens else sharp))
                    assert rms(passes[COLOUR_PASS] - one) < NOISE * rms(other - one), (views, view, lens)


def moving_box(scene):
    """Blurred, and in another place in each frame; the camera moves too."""
    moving_object(scene)
    keyframes(scene.objects["Box"], "location", {0: (-1.5, -0.3, -5), 1: (-1.0, -0.3, -5), 2: (0.8, 0.2, -4)})
    keyframes(scene.camera, "location", {0: (0.0, 0.0, 0.0), 2: (0.3, 0.1, -0.2)})


def test_frames_of_an_animation_are_as_the_osl_camera_traces_them(tmp_path):
    """One frame after the other in one working scene, in which the sheet stays. Draft has no probes: the same pixels
    are traced by both.
    """
    scene = studio(tmp_path, lit=False)
    moving_box(scene)
    frames = (1, 2)
    pairs = {}
    for packed_by in CAMERAS:
        settings = StereoSettings(accuracy="draft", fill="packed", packed_by=packed_by)
        with WorkingScenes(scene) as scenes:
            together = InSequence(scenes, lambda _: SharedFindings(), learns=False)
            for number in frames:
                one = replace(settings, scene=SceneOverrides(frame=number, seed=3, interocular_distance=0.3))
                pair, report = render_pair(scene, one, tmp_path, sequence=together)
                assert report.fill.camera == packed_by
                pairs[packed_by, number] = pair.main_frame
    scene.camera.data.stereo.interocular_distance = 0.3
    shown = []
    for number in frames:
        scene.frame_set(number)
        a, b = (render_plain(scene, tmp_path, seed=seed, views=("right",))["right"][COLOUR_PASS] for seed in (1, 2))
        osl, portal = (pairs[packed_by, number] for packed_by in ("osl", "portal"))
        traced = osl.traced
        np.testing.assert_array_equal(portal.traced, traced)
        assert traced.mean() > 0.05
        noise = rms((b - a)[traced])
        ours, theirs = (pair.eyes["right"][COLOUR_PASS][traced] for pair in (portal, osl))
        assert rms(ours - a[traced]) < ANIMATED_NOISE * noise, number
        assert rms(ours - theirs) < ANIMATED_NOISE * noise, number
        shown.append(a)
    assert rms(shown[1] - shown[0]) > 2.0 * rms(b - a), "another frame would be seen"


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


def something_far_away_to_the_side(scene):
    add_cube(scene, Material("far"), size=10.0, location=(4000, 0, -2000)).name = "Far"


def something_far_away_that_moves(scene):
    """Now it is out of view, and before the shutter closes it is in the middle."""
    something_far_away_to_the_side(scene)
    moving_object(scene)
    keyframes(scene.objects["Far"], "location", {0: (8000, 0, -2000), 2: (0, 0, -2000)})
    scene.render.motion_blur_shutter = 2.0


def a_camera_that_turns_to_something_far_away(scene):
    something_far_away_to_the_side(scene)
    scene.render.use_motion_blur = True
    keyframes(scene.camera, "rotation_euler", {1: (0, 0, 0), 2: (0, -2.0, 0)})


def something_that_comes_near(scene):
    """It is in view all the time, and beyond the clip end before and after the frame's own time."""
    moving_object(scene)
    scene.camera.data.clip_end = 20.0
    far = add_cube(scene, Material("far"), size=1.0, location=(0, 0, -15))
    keyframes(far, "location", {0: (0, 0, -40), 1: (0, 0, -15), 2: (0, 0, -40)})
    scene.frame_set(1)


def something_that_the_viewport_does_not_show(scene):
    add_cube(scene, Material("far"), size=1.0, location=(0, 0, -2000)).hide_viewport = True


def something_that_nobody_shows(scene):
    something_that_the_viewport_does_not_show(scene)
    scene.objects[-1].hide_render = True


def just_before_the_clip_end(scene):
    """It is flat, so that nothing of its own size tells how long its hair is."""
    scene.camera.data.clip_end = 20.0
    return add_plane(scene, Material("near"), size=(0.5, 0.5), location=(0, 0, -18))


def hair(scene):
    just_before_the_clip_end(scene).modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = scene.objects[-1].particle_systems[0].settings
    settings.type, settings.hair_length, settings.count = "HAIR", 3.0, 10


def hair_that_renders_alone_show(scene):
    hair(scene)
    scene.objects[-1].modifiers[0].show_viewport = False


def an_array_of_renders_alone(scene):
    just_before_the_clip_end(scene).modifiers.new("Array", "ARRAY").show_viewport = False


def a_finer_surface_of_renders_alone(scene):
    just_before_the_clip_end(scene).modifiers.new("Subdivision", "SUBSURF").show_viewport = False


def displaced(scene):
    just_before_the_clip_end(scene)
    material = scene.objects[-1].data.materials[0]
    nodes = material.node_tree.nodes
    output = next(node for node in nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    displacement = nodes.new("ShaderNodeDisplacement")
    displacement.inputs["Scale"].default_value = 2.0
    material.node_tree.links.new(displacement.outputs[0], output.inputs["Displacement"])
    material.displacement_method = "DISPLACEMENT"
    scene.objects[-1].scale = (3.0, 3.0, 3.0)


def lamp(kind, size):
    def change(scene):
        scene.camera.data.clip_end = 20.0
        light = bpy.data.lights.new("Lamp", kind)
        setattr(light, "size" if kind == "AREA" else "shadow_soft_size", size)
        item = add(scene, bpy.data.objects.new("Lamp", light))
        item.location, item.visible_camera = (0, 0, -18), True

    change.__name__ = f"{kind.lower()}_lamp_of_{size}"
    return change


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
        (something_far_away_to_the_side, None),
        (something_far_away_that_moves, "clip end"),
        (a_camera_that_turns_to_something_far_away, "clip end"),
        (something_that_comes_near, "clip end"),
        (moving_object, None),
        (moving_camera, None),
        (something_that_the_viewport_does_not_show, "clip end"),
        (something_that_nobody_shows, None),
        (just_before_the_clip_end, None),
        (hair, "clip end"),
        (hair_that_renders_alone_show, "clip end"),
        (an_array_of_renders_alone, "clip end"),
        (a_finer_surface_of_renders_alone, None),
        (displaced, "clip end"),
        (lamp("AREA", 6.0), "clip end"),
        (lamp("AREA", 0.5), None),
        (lamp("SPOT", 6.0), "clip end"),
        (lamp("POINT", 0.5), None),
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


def chosen(scene, folder, deepest=10.0, *, packed_by="auto"):
    """The name of the packed camera of a scene, and why pixels cannot be packed."""
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, folder, packed_by=packed_by)
        reason = renderer.fill_blockers(deepest)["packed"]
        return renderer.packed.name, reason


@pytest.fixture
def devices():
    """Devices may be switched in the test; afterwards they are as they were."""
    kept = devices_in_use()
    yield
    use_devices(kept)


@pytest.mark.parametrize(("device", "kind", "taken"), [("CPU", "NONE", "osl"), ("GPU", "HIP", "portal")])
def test_it_is_taken_where_there_are_no_osl_cameras(tmp_path, devices, device, kind, taken):
    scene = studio(tmp_path, lit=False)
    use_devices({"type": kind, "ids": [], "options": {}})
    scene.cycles.device = device
    assert chosen(scene, tmp_path) == (taken, None)
    assert chosen(scene, tmp_path, packed_by="portal") == ("portal", None)
    if taken == "portal":
        with pytest.raises(BadInputError, match="--packed-by osl is not possible: the device has no OSL cameras"):
            chosen(scene, tmp_path, packed_by="osl")


def orthographic(scene):
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 5.0


@pytest.mark.parametrize("change", [orthographic, None])
def test_it_is_taken_where_the_osl_camera_is_blocked(tmp_path, change):
    """By an orthographic camera, or by what the source shows: rays to the corners that end before the clip end."""
    scene = studio(tmp_path, lit=False)
    scene.camera.data.clip_end = 25.0
    deepest = 24.0
    assert chosen(scene, tmp_path) == ("osl", None)
    if change is not None:
        change(scene)
        deepest = 10.0
    assert chosen(scene, tmp_path, deepest) == ("portal", None)
    name, reason = chosen(scene, tmp_path, deepest, packed_by="osl")
    assert name == "osl"
    assert reason
    path_guiding(scene)
    name, reason = chosen(scene, tmp_path, deepest)
    assert "OSL camera: " in reason
    assert "Ray Portal: path guiding" in reason
    assert "\n" not in reason


def test_what_blocks_both_is_said_once(tmp_path):
    scene = studio(tmp_path, lit=False)
    scene.render.use_motion_blur, scene.cycles.rolling_shutter_type = True, "TOP"
    _, reason = chosen(scene, tmp_path)
    assert reason == "rolling shutter needs the frame's own rows"


def test_a_pair_is_traced_by_it_where_the_osl_camera_clips(tmp_path):
    """It shows only after the source is rendered; the costs that are known are those of the portal then."""
    scene = studio(tmp_path, lit=True)
    scene.render.resolution_x, scene.render.resolution_y, scene.cycles.samples = 64, 36, 1
    # What is seen is 10 deep, and in the corners half as far away again.
    scene.camera.data.lens, scene.camera.data.clip_end = 18.0, 13.5
    asked = []
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path)

        def known():
            asked.append(renderer.packed.name)
            return TraceCosts()

        assert renderer.packed.name == "osl"
        frame = render_stereo_frame(renderer, StereoSettings(fill="packed", accuracy="draft"), known_costs=known)
    assert frame.fill.method == "packed"
    assert frame.traced.any()
    assert asked == ["portal"]


def displaced_by_cycles_alone(scene):
    """What EEVEE shows of it has no displacement: only Cycles may show it beyond the clip end."""
    displaced(scene)
    nodes = scene.objects[-1].data.materials[0].node_tree.nodes
    next(node for node in nodes if node.bl_idname == "ShaderNodeOutputMaterial").target = "CYCLES"
    nodes.new("ShaderNodeOutputMaterial").target = "EEVEE"


def denoising_passes_without_reflections(scene):
    """Cycles renders these passes for the matching of the light, and the source has none."""
    scene.view_layers[0].cycles.denoising_pass_follow_reflections = False


OF_THE_TRACER = [(displaced_by_cycles_alone, "clip end")]
if hasattr(bpy.context.scene.view_layers[0].cycles, "denoising_pass_follow_reflections"):
    OF_THE_TRACER.append((denoising_passes_without_reflections, "follow reflections"))


@pytest.mark.parametrize(("change", "words"), OF_THE_TRACER)
def test_of_an_eevee_source_the_scene_that_traces_is_asked(tmp_path, change, words):
    scene = studio(tmp_path, lit=True)
    change(scene)
    scene.render.engine = EEVEE
    with (
        working_scene(scene, SceneOverrides()) as working,
        renderer_of(working, tmp_path, packed_by="portal") as renderer,
    ):
        assert packed_blocker(working, renderer.cameras.values(), 10.0, CAMERAS["portal"]) is None
        assert words in renderer.fill_blockers()["packed"]
