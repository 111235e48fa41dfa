"""The parts of the script for stored pairs that render nothing: its standard error, its rows, and where the camera
goes."""

import bpy
import numpy as np
import pytest

from stereo_reproject.images.metrics import honest_ratio
from tests.bench.stored_pairs import COLUMNS, Pair, Row, honest_error, line, parse, swing

pytestmark = pytest.mark.blender

NOISE = 0.05
SPREAD = 0.3
"""How far the told standard error may be from the one that is found over as few draws."""


def pictures(seed):
    """A picture with an error that differs from place to place, and two renders of it."""
    rng = np.random.default_rng(seed)
    clean = np.full((192, 192, 4), 0.5, np.float32)
    wrong = np.random.default_rng(0).normal(0.0, NOISE, (192, 192, 1)).astype(np.float32)
    a, b, w = (clean + NOISE * rng.normal(size=clean.shape).astype(np.float32) for _ in range(3))
    return w + wrong, a, b


def test_the_standard_error_is_that_of_many_comparisons():
    share = np.ones((192, 192), np.float32)
    drawn = [pictures(seed) for seed in range(1, 61)]
    found = np.std([honest_ratio(*three, share) for three in drawn])
    told = np.mean([honest_error(*three, share) for three in drawn])
    assert told == pytest.approx(found, rel=SPREAD)


def pair(**changed):
    values = {"traced": 0.1, "cost": 0.11, "honest": 1.02, "honest_error": 0.01, "worst": 1.2, "wrong": 0.004}
    return Pair(**{**values, "estimate": 1.03, "low": 1.025, "high": 1.06, **changed})


def test_an_interval_holds_what_the_comparison_is_unsure_of_only_if_it_is_widened():
    assert not pair().holds(widened=False)
    assert pair().holds(widened=True)
    assert not pair(honest_error=0.001).holds(widened=True)


def test_a_row_has_a_cell_for_each_column_and_leaves_out_frames_without_an_estimate():
    told = line(Row("a", [pair(), pair(traced=0.3, honest=1.04), pair(estimate=None)], 1.01))
    assert told.count("|") == len(COLUMNS) + 2
    assert told == (
        "| a | 16.7 % (30.0) | 1.027 (1.040) | 1.010 | 1.20 | 0.40 % | 1 of 2 | 2 of 2 | 0.000 | 0.04 | 1.80 |"
    )
    assert "no probes" in line(Row("a", [pair(estimate=None)], None))


def test_a_camera_that_is_swung_looks_at_the_same_point_from_nearer():
    scene = bpy.data.scenes.new("Swung")
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.location, camera.rotation_euler = (3.0, -4.0, 2.0), (1.2, 0.1, 0.4)
    camera.data.stereo.convergence_distance = 5.0
    scene.view_layers[0].update()

    def seen():
        world = camera.matrix_world
        return np.array(world.translation - camera.data.stereo.convergence_distance * world.col[2].to_3d())

    before, place = seen(), np.array(camera.matrix_world.translation)
    swing(scene, 40.0, 0.8)
    after = np.array(camera.matrix_world.translation)
    try:
        np.testing.assert_allclose(seen(), before, atol=1e-5)
        assert np.linalg.norm(after - before) == pytest.approx(0.8 * np.linalg.norm(place - before))
        turn = np.subtract(*(np.arctan2(*(stood - before)[1::-1]) for stood in (after, place)))
        assert np.degrees(turn) % 360.0 == pytest.approx(40.0, abs=1e-3)
    finally:
        bpy.data.scenes.remove(scene)


def test_every_known_scene_may_be_named(capsys):
    assert parse(["--scenes", "anywhere", "walking-man"]).names == ["walking-man"]
    with pytest.raises(SystemExit):
        parse(["--scenes", "anywhere", "nowhere"])
    assert "unknown scene 'nowhere'" in capsys.readouterr().err
