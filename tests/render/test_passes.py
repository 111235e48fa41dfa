"""Every pass that Blender's own multiview has for an eye, ours has too, and means the same by it."""

import numpy as np
import pytest

from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.holes.tuning import TUNING as HOLE_TUNING
from stereo_reproject.images.passes import DEPTH_PASS, cryptomatte_of, filtered
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from tests.blender.toolbox import keyframes, render_plain, rms
from tests.render.every_pass import AOVS, LAYER, LIGHT_GROUP, every_pass
from tests.render.test_fill import fill_method

SAMPLES = 16

TIMES = {"Render Time"}
"""Passes that are another in every render."""

TOLERANCES = {
    "Depth": 2e-3,
    "Position": 2e-3,
    # Of the nearest sample, which lies up to half a pixel away: on the ball that many radians, on the box that much UV.
    "Normal": 0.06,
    "UV": 0.04,
    # Pixels, of some seven.
    "Vector": 0.06,
    # Of the whole range: it is a distance from the eye.
    "Mist": 5e-3,
}
"""Greatest difference from multiview's own pass, but for FEW pixels. What may not be mixed has to be the same, and
what light makes may differ by as much as 95 % of the pixels do between two seeds."""

FEW = 0.06
"""Share of the pixels, more than differ as much between two seeds: those whose nearest sample is another's, those of a
coverage so small that no edge of the colour is there, and those of an edge whose two sides have colours that are alike
for their noise, and so are not traced, though the pass tells them apart."""

AT_THE_SKY = 0.06
"""The same of traced vectors, besides FEW: under the packed camera, the mean over a pixel that an edge shares with the
sky is taken of directions, and Cycles counts the sky's otherwise."""

GLOSS_COLOURS = {"Glossy Color", "GlossCol"}
ON_GLASS = 0.03
"""The same of these passes of a panorama, besides FEW: they change towards the rim of the glass ball, 13 % of the
picture, which is traced for what is seen through it in a perspective picture alone."""

ROUNDING = 2e-7
"""Relative. A panorama's Depth is counted from the camera's own place: it is made a distance from the eye, and back."""

SILENT = 1e-6
"""A pass in which there is nothing, or nothing but rounding."""


def camera_moves(scene):
    keyframes(scene.camera, "location", {0: (-0.2, 0.0, 0.1), 1: (0.0, 0.0, 0.0), 2: (0.3, 0.1, -0.1)})
    keyframes(scene.camera, "rotation_euler", {0: (0.0, 0.05, 0.0), 1: (0.0, 0.0, 0.0), 2: (0.02, -0.03, 0.0)})
    scene.frame_set(1)


def camera_zooms(scene):
    keyframes(scene.camera.data, "lens", {0: 30.0, 1: 35.0, 2: 42.0})
    scene.frame_set(1)


def camera_turns_in(scene):
    camera_moves(scene)
    scene.camera.data.stereo.convergence_mode = "TOE"


def camera_stands_still(scene):
    pass


def panorama(scene):
    """A part of the sphere that the scene fills as it fills the picture otherwise, with eyes on a circle."""
    data = scene.camera.data
    data.type, data.panorama_type = "PANO", "EQUIRECTANGULAR"
    data.longitude_min, data.longitude_max, data.latitude_min, data.latitude_max = -0.48, 0.48, -0.27, 0.27
    data.stereo.use_spherical_stereo = True
    # With the scene's own, a loud probe has most of so small a picture traced.
    scene.cycles.seed = 2


def panorama_without_vectors(scene):
    """Cycles' custom cameras have none of a panorama."""
    panorama(scene)
    scene.view_layers[0].use_pass_vector = False


def panorama_moves(scene):
    camera_moves(scene)
    panorama(scene)


VARIANTS = {
    "packed": ("osl", camera_stands_still),
    "packed, moving": ("osl", camera_moves),
    "portal, moving": ("portal", camera_moves),
    "card, moving": ("card", camera_moves),
    "card, zooming": ("card", camera_zooms),
    "packed, toe-in": ("osl", camera_turns_in),
    "portal, toe-in": ("portal", camera_turns_in),
    "packed, panorama": ("osl", panorama_without_vectors),
    "portal, panorama, moving": ("portal", panorama_moves),
}
"""How pixels are traced, as `fill_method` has it, and what moves."""


class Pair:
    """Ours, and plain multiview's with two seeds."""

    def __init__(self, folder, method, change):
        fill, packed_by = fill_method(method)
        scene = every_pass(folder, samples=SAMPLES)
        change(scene)
        if fill == "card":
            # With the scene's own, a loud one of the card's few probes has all of so small a picture traced.
            scene.cycles.seed = 1
        with working_scene(scene, SceneOverrides()) as working:
            renderer = BlenderRenderer(working, folder, user_scene=scene, packed_by=packed_by)
            # A card's probes are few: in so small a picture they are sure of little, and the default traces nearly all.
            accuracy = "preview" if fill == "card" else "balanced"
            self.frame = render_stereo_frame(renderer, StereoSettings(fill=fill, accuracy=accuracy))
        self.is_panorama = scene.camera.data.type == "PANO"
        self.has_vectors = scene.view_layers[0].use_pass_vector
        self.after = (scene.frame_current, scene.camera.location.copy())
        self.plain = render_plain(scene, folder, seed=scene.cycles.seed)
        self.again = render_plain(scene, folder, seed=77)
        self.traced = self.frame.traced

    @property
    def where_is(self):
        """TOLERANCES of the passes that this pair has."""
        return {name: each for name, each in TOLERANCES.items() if name != "Vector" or self.has_vectors}

    def differences(self, name):
        """(H, W) of the target eye: ours from multiview, and multiview's from another with another seed."""
        ours, a, b = (one["right"][name] for one in (self.frame.eyes, self.plain, self.again))
        return distance(ours, a), distance(b, a)


def distance(one, other):
    """(H, W): the greatest difference of any channel; infinite depths are the same."""
    same = one == other
    return np.where(same, 0.0, np.abs(np.where(same, 0.0, one) - np.where(same, 0.0, other))).max(axis=-1)


@pytest.fixture(scope="module", params=VARIANTS)
def pair(request, tmp_path_factory):
    method, change = VARIANTS[request.param]
    return Pair(tmp_path_factory.mktemp("pair"), method, change)


def test_both_eyes_have_all_passes_and_no_other(pair):
    for view in ("left", "right"):
        ours, plain = pair.frame.eyes[view], pair.plain[view]
        assert set(ours) == set(plain)
        for name, image in plain.items():
            assert ours[name].shape == image.shape, name
            assert ours[name].dtype == np.float32
    assert {*AOVS, f"Combined_{LIGHT_GROUP.replace('.', '_')}", "CryptoAsset02", *pair.where_is} <= set(ours)
    assert 0.05 < pair.traced.mean() < 0.85


def test_the_source_eye_is_multiview_s_own_to_the_bit(pair):
    for name, image in pair.plain["left"].items():
        if name not in TIMES:
            rounding = ROUNDING if pair.is_panorama and name == DEPTH_PASS else 0.0
            np.testing.assert_allclose(pair.frame.eyes["left"][name], image, rtol=rounding, err_msg=name)


def test_what_is_where_is_right_in_the_target(pair):
    for name, tolerance in pair.where_is.items():
        ours, seeds = pair.differences(name)
        for where in (pair.traced, ~pair.traced):
            few = FEW + AT_THE_SKY * (name == "Vector" and where is pair.traced)
            assert np.mean(ours[where] <= tolerance) > np.mean(seeds[where] <= tolerance) - few, name
        # It is not as it was in the other eye, or the test would say nothing.
        if name not in ("Normal", "Mist"):
            unconverted = distance(pair.frame.eyes["left"][name], pair.plain["right"][name])
            assert np.mean(unconverted <= tolerance) < np.mean(ours <= tolerance) - 0.08, name


def test_what_must_not_be_mixed_is_not(pair):
    names = [name for name in pair.plain["right"] if not filtered(name) and name not in {*TOLERANCES, *TIMES}]
    assert len(names) >= 11
    for name in names:
        ours, seeds = (difference == 0.0 for difference in pair.differences(name))
        assert ours.mean() > seeds.mean() - FEW, name
        if cryptomatte_of(name) is None:
            values = np.unique(pair.plain["right"][name])
            assert set(np.unique(pair.frame.eyes["right"][name])) <= set(values), name


def test_what_light_makes_differs_no_more_than_between_two_seeds(pair):
    names = [name for name in pair.plain["right"] if filtered(name) and name not in TOLERANCES]
    assert len(names) >= 20
    alive = 0
    for name in names:
        ours, seeds = pair.differences(name)
        # A pass that is all but free of noise may be off by what nobody sees.
        usual = max(float(np.quantile(seeds, 0.95)), HOLE_TUNING.unseen_difference)
        few = FEW + ON_GLASS * (pair.is_panorama and name in GLOSS_COLOURS)
        assert np.mean(ours <= usual) > np.mean(seeds <= usual) - few, name
        assert not rms(ours) or rms(seeds), name
        alive += rms(seeds) > SILENT
    assert alive >= 15, "most of them show something"


def test_what_cryptomattes_hold_is_passed_on(pair):
    told = {key.partition("/")[2]: text for key, text in pair.frame.metadata.items() if key.startswith("cryptomatte/")}
    assert {text for key, text in told.items() if key.endswith("name")} == {
        f"{LAYER}.{kind}" for kind in ("CryptoObject", "CryptoMaterial", "CryptoAsset")
    }
    assert any('"ball":' in text for key, text in told.items() if key.endswith("manifest"))


def test_the_scene_is_in_its_own_frame_again(pair):
    frame, place = pair.after
    assert frame == 1
    assert tuple(place) == (0.0, 0.0, 0.0)


def test_vectors_of_an_animated_lens_are_not_traced_packed(tmp_path):
    """A custom camera's vectors know nothing of a lens."""
    scene = every_pass(tmp_path)
    camera_zooms(scene)
    for wanted in (True, False):
        scene.view_layers[0].use_pass_vector = wanted
        with working_scene(scene, SceneOverrides()) as working:
            renderer = BlenderRenderer(working, tmp_path, user_scene=scene)
            blocker = renderer.fill_blockers()["packed"]
            assert (blocker or "").startswith("the lens is animated") == wanted
            assert (renderer.motion is not None) == wanted
