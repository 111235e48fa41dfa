"""Settings check themselves: what is wrong is bad input, told in one line, before anything is rendered."""

import dataclasses
import itertools
import math

import pytest

from stereo_reproject.errors import BadInputError
from stereo_reproject.settings import accuracy
from stereo_reproject.settings import frame as settings
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings

NO_NUMBERS = [math.nan, math.inf, -math.inf, "0.065", "", [1.0], True]

BAD_OVERRIDES = [
    *[("interocular_distance", value) for value in [*NO_NUMBERS, -1e-9, -0.065]],
    *[("convergence_distance", value) for value in [*NO_NUMBERS, 0, 0.0, -2.0]],
    *[("samples", value) for value in [0, -1, 1.0, 64.5, "64", True, math.nan, 1 << 25]],
    *[("seed", value) for value in [-1, 1 << 31, 1.0, "7", False, math.nan]],
    *[("frame", value) for value in [1.0, "1", math.nan, 10**9, -(10**9), True]],
    *[("size", value) for value in [(0, 540), (960, 0), (-960, 540), (960.0, 540), ("960", "540"), (math.nan, 540)]],
    *[("size", value) for value in [(1 << 20, 540), (960, 1 << 20), (True, 540), (3, 3)]],
    *[("source_engine", value) for value in ["", "CYCLES", "workbench", 1]],
    *[("convergence_mode", value) for value in ["", "OFFAXIS", "toe_in", 1, "left\nright"]],
    *[("panorama", value) for value in ["", "VR180", "360", 180, True]],
]

BAD_SETTINGS = [
    *[("source", value) for value in ["", "Left", "middle", 0, ["left"]]],
    *[("accuracy", value) for value in ["best", "", 1.0]],
    *[("fill", value) for value in ["osl", "", 0, "pack\ned"]],
    *[("packed_by", value) for value in ["cuda", "OSL", ""]],
    *[("interpolation", value) for value in ["nearest", "lanczos", ""]],
    *[("warp", value) for value in ["GPU", "cuda", "", None]],
    *[("grid_threshold", value) for value in [*NO_NUMBERS, -1.0, -1e-12]],
]


def check_message(error, name):
    message = str(error)
    assert "\n" not in message
    assert name.replace("_", " ").split()[-1] in message.replace("-", " "), "it says what is wrong"
    assert "must be" in message
    assert error.exit_status == 2


@pytest.mark.parametrize(("name", "value"), BAD_OVERRIDES)
def test_a_bad_override_is_bad_input_in_one_line(name, value):
    with pytest.raises(BadInputError) as raised:
        SceneOverrides(**{name: value})
    named = {"size": "must", "frame": "frame"}.get(name, name)
    check_message(raised.value, named)


@pytest.mark.parametrize(("name", "value"), BAD_SETTINGS)
def test_a_bad_setting_is_bad_input_in_one_line(name, value):
    with pytest.raises(BadInputError) as raised:
        StereoSettings(**{name: value})
    named = {"source": "eye"}.get(name, name)
    check_message(raised.value, named)


@pytest.mark.parametrize(
    "overrides",
    [
        {},
        {"interocular_distance": 0.0},  # two equal eyes
        {"interocular_distance": 0},
        {"interocular_distance": 1e6, "convergence_distance": 1e-6},
        {"frame": -20, "samples": 1, "seed": 0, "size": (4, 4)},
        {"frame": 1048574, "samples": 1 << 24, "seed": (1 << 31) - 1, "size": (65536, 65536)},
        *({"source_engine": engine} for engine in ("cycles", "eevee")),
        *({"convergence_mode": mode} for mode in ("off-axis", "parallel", "toe-in")),
        {"panorama": "vr180", "size": (64, 64)},
    ],
)
def test_good_overrides_are_taken_as_they_are(overrides):
    taken = SceneOverrides(**overrides)
    for name, value in overrides.items():
        assert getattr(taken, name) == value


@pytest.mark.parametrize(("panorama", "size"), [("vr180", (4096, 4096)), ("vr360", (8192, 4096)), (None, None)])
def test_a_panorama_has_a_size_of_its_own(panorama, size):
    assert SceneOverrides(panorama=panorama).size == size


def test_good_settings_are_taken_as_they_are():
    for source in ("left", "right"):
        for fill in ("auto", "packed", "card", "full"):
            taken = StereoSettings(source=source, fill=fill, grid_threshold=0.0, interpolation="cubic", compare=True)
            assert (taken.source, taken.fill, taken.interpolation) == (source, fill, "cubic")


def test_the_target_is_the_other_eye():
    assert StereoSettings(source="left").target == "right"
    assert StereoSettings(source="right").target == "left"


def test_settings_are_frozen():
    for frozen, name in ((StereoSettings(), "fill"), (SceneOverrides(), "frame")):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(frozen, name, None)


def test_every_accuracy_has_a_meaning_and_higher_ones_trace_no_less():
    assert tuple(accuracy.SETTINGS) == settings.ACCURACIES
    levels = list(accuracy.SETTINGS.values())
    for lower, higher in itertools.pairwise(levels):
        assert higher.silhouette_step <= lower.silhouette_step
        assert higher.silhouette_radius >= lower.silhouette_radius
        assert higher.colour_tolerance <= lower.colour_tolerance


@pytest.mark.parametrize("name", ["source", "accuracy", "fill", "packed_by", "grid_threshold", "interpolation"])
def test_what_a_run_cannot_do_without_must_be_said(name):
    with pytest.raises(BadInputError):
        StereoSettings(**{name: None})


@pytest.mark.parametrize("fields", [{"size": 960}, {"size": (960,)}, {"convergence_distance": 10**400}])
def test_values_of_another_kind_are_bad_input_too(fields):
    with pytest.raises(BadInputError):
        SceneOverrides(**fields)
