"""The pure parts of the spending script: knobs that go back to where they stood, stored traces, and the table."""

import ast
from pathlib import Path

import numpy as np
import pytest

from stereo_reproject.estimate import tracing
from stereo_reproject.holes import classifier
from stereo_reproject.holes.reprojection import reproject
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.trace.requests import TraceRequest
from stereo_reproject.views.view import View
from stereo_reproject.warp.rendered_view import RenderedView
from tests.bench.spending import (
    KNOBS,
    SHIPPED,
    TUNINGS,
    Knob,
    Outcome,
    Scene,
    StoredTracer,
    load_pictures,
    parse,
    save_pictures,
    table,
)
from tests.bench.warp.scenes import eyes, room

ROOT = Path(__file__).resolve().parents[2]
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)


class TurnedTooFarError(Exception):
    """Raised by the test itself."""


@pytest.mark.parametrize("knob", KNOBS, ids=lambda knob: knob.name)
def test_a_knob_turns_what_the_engine_reads_and_goes_back(knob):
    for value in knob.values:
        with knob.turned(value) as accuracy:
            in_use = next((one for one in (tracing.TUNING, classifier.TUNING) if hasattr(one, knob.name)), accuracy)
            assert getattr(in_use, knob.name) == value
            assert (knob.tuning is None) == (accuracy is not SHIPPED)
            assert knob.shipped() in knob.values, "what ships is not touched"
        assert (tracing.TUNING, classifier.TUNING) == TUNINGS


@pytest.mark.parametrize("knob", KNOBS, ids=lambda knob: knob.name)
def test_a_knob_goes_back_after_an_error_too(knob):
    with pytest.raises(TurnedTooFarError), knob.turned(knob.values[0]):
        raise TurnedTooFarError
    assert (tracing.TUNING, classifier.TUNING) == TUNINGS


READ_ON_LOADING = {"stereo_reproject/blender/gpu/warp_source.py"}
"""Modules that read tuned numbers when they are loaded: the text of the GPU's shaders holds them."""


def test_tuned_numbers_are_read_when_they_are_used():
    """Or to vary them would change nothing."""
    found = set()
    for file in ROOT.glob("stereo_reproject/**/*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        bodies = [part for node in ast.walk(tree) if isinstance(node, FUNCTIONS) for part in body_of(node)]
        inside = {id(node) for part in bodies for node in ast.walk(part)}
        reads = (node for node in ast.walk(tree) if isinstance(node, ast.Attribute) and id(node) not in inside)
        if any(isinstance(node.value, ast.Name) and node.value.id.endswith("TUNING") for node in reads):
            found.add(file.relative_to(ROOT).as_posix())
    assert found == READ_ON_LOADING


def body_of(function):
    return function.body if isinstance(function.body, list) else [function.body]


@pytest.mark.parametrize("knob", KNOBS, ids=lambda knob: knob.name)
def test_what_ships_is_among_what_is_tried(knob):
    assert knob.values.count(knob.shipped()) == 1
    assert len(knob.values) > 1


def test_the_table_has_means_over_scenes_and_seeds_and_marks_what_ships():
    knob = Knob("tile_limit", (1, 1.5))
    outcomes = [
        Outcome("a", "tile_limit", 1, 1, traced=0.1, honest=1.0, noise=0.9, worst=1.2, wrong=0.0, estimate=0.9),
        Outcome("b", "tile_limit", 1, 2, traced=0.3, honest=1.1, noise=1.0, worst=1.4, wrong=0.01, estimate=1.1),
        Outcome("a", "tile_limit", 1.5, 1, traced=1.0, honest=1.0, noise=1.0, worst=1.1, wrong=0.0, estimate=1.0),
        Outcome("a", "WIDTH", 1, 1, traced=9.0, honest=9.0, noise=9.0, worst=9.0, wrong=0.9, estimate=9.0),
    ]
    head, rule, *rows = table(outcomes, [knob]).splitlines()
    assert {line.count("|") for line in (head, rule, *rows)} == {12}
    assert rows == [
        "| `tile_limit` | 1 | 20.0 % | 0 of 2 | 1.050 | 1.100 | 0.950 | 1.30 | 0.50 % | 1.000 | 0.071 |",
        "| `tile_limit` | **1.5** | 100.0 % | 1 of 1 | 1.000 | 1.000 | 1.000 | 1.10 | 0.00 % | 1.000 | 0.000 |",
    ]


def test_a_stored_trace_is_what_the_renders_have_at_its_pixels_in_the_masks_order():
    once, again = np.arange(24.0).reshape(2, 3, 4), 100.0 + np.arange(24.0).reshape(2, 3, 4)
    pixels = np.array([[True, False, True], [False, True, False]])
    twins = np.array([[False, False, True], [False, False, False]])
    tracer = StoredTracer(once, again)
    (traced,) = tracer.trace("packed", [TraceRequest("right", pixels)])
    np.testing.assert_array_equal(traced[COLOUR_PASS][:, 0], [0.0, 8.0, 16.0])
    traced = tracer.trace("packed", [TraceRequest("right", pixels, twins)])[0][COLOUR_PASS]
    np.testing.assert_array_equal(traced[:, 0], [0.0, 8.0, 16.0, 108.0])


def room_of_noise():
    """A scene whose target's renders are noise alone."""
    left, right = eyes(96, 64)
    source = RenderedView(View("left", left), room(96, 64))
    rng = np.random.default_rng(1)
    targets = [rng.random((64, 96, 4), np.float32) for _ in range(4)]
    return Scene("room", reproject([source], View("right", right), SHIPPED), targets, 1.0, needs_probes=True)


def test_a_scene_is_the_same_after_a_target_was_made_of_it():
    """Pixels are traced into a target in place."""
    scene = room_of_noise()
    (first, _), (other, _), (again, _) = (scene.finished(SHIPPED, seed) for seed in (1, 2, 1))
    assert first.traced.any()
    assert not np.array_equal(first.colour, other.colour), "it is made of other renders"
    np.testing.assert_array_equal(first.colour, again.colour)


def test_pictures_come_back_from_a_file_as_they_were(tmp_path):
    rng = np.random.default_rng(1)
    source = {COLOUR_PASS: rng.random((3, 4, 4), np.float32), "Denoising Normal": rng.random((3, 4, 3), np.float32)}
    targets = [rng.random((3, 4, 4), np.float32) for _ in range(4)]
    save_pictures(tmp_path / "stored.npz", source, targets)
    stored, again = load_pictures(tmp_path / "stored.npz")
    assert list(stored) == list(source)
    for expected, image in zip([*source.values(), *targets], [*stored.values(), *again], strict=True):
        np.testing.assert_array_equal(image, expected)
    assert [path.name for path in tmp_path.iterdir()] == ["stored.npz"]


def test_all_scenes_are_taken_where_none_is_named(capsys):
    assert len(parse(["--scenes", "anywhere"]).names) > 1
    with pytest.raises(SystemExit) as ended:
        parse(["--scenes", "anywhere", "no-such-scene"])
    assert ended.value.code == 2
    assert "unknown scene 'no-such-scene'" in capsys.readouterr().err
