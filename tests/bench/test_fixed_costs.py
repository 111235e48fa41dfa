"""What a run pays besides tracing: parts that add up, a prediction by hand, and a small run that is measured."""

from __future__ import annotations

import json

import pytest

from stereo_reproject.trace.costs import TraceCosts
from tests.bench.fixed_costs.__main__ import (
    BEFORE,
    NOW,
    OUTSIDE,
    SIZES,
    SYNCS,
    as_markdown,
    break_even,
    in_total,
    measured,
    parse,
    parts_of,
    predicted,
)
from tests.bench.performance.plan import Scene

STAGES = {"load": 0.5, "plan": 0.1, "source": 8.2, "warp": 1.0, "fill": 0.9, "refine": 0.4, "composite": 0.05}
RUN = {
    "start": 1.0,
    "end": 0.1,
    "copy": 0.2,
    "stages": {**STAGES, "account": 0.3, "write": 2.0},
    "syncs": [2.0, 0.02, 0.01],
    "functions": {
        "source": {"call": 7.9, "read": 0.1, "cycles": 7.75},
        "fill": {"call": 0.48, "read": 0.02, "cycles": 0.4},
        "refine": {"call": 0.29, "read": 0.01, "cycles": 0.25},
        "warp": {"sharpness": 0.3, "edges": 0.1, "reasons": 0.1, "estimator": 0.2},
        "account": {"edges": 0.1, "reasons": 0.1},
        "write": {"eye files": 0.6, "stereo.exr": 0.5, "stereo.png": 0.3, "holes.png": 0.2, "grid.png": 0.1},
    },
    "traced": 0.1,
}
CYCLES_SECONDS, TOTAL_SECONDS = 8.4, 10.65
"""Seconds of Cycles' own in `RUN`, and of its pair."""


def test_the_parts_of_a_pair_and_cycles_own_seconds_are_its_total():
    parts = parts_of(RUN)
    assert in_total(parts) + CYCLES_SECONDS == pytest.approx(TOTAL_SECONDS)
    assert parts["render calls beside Cycles: EXR written and read"] == pytest.approx(0.4)
    assert parts["warp: map and lookups"] == pytest.approx(0.3)
    assert parts["fill and refine, beside their render calls"] == pytest.approx(0.5)
    assert [parts[name] for name in SYNCS] == pytest.approx([2.0, 0.03])


def test_a_gain_is_predicted_from_what_is_no_tracing():
    parts, costs = parts_of(RUN), TraceCosts()
    told = predicted(parts, 0.1, 2, 20.0)
    pair = 20.0 * (1.0 + 0.1 * costs.packed_pixel_cost) + 2 * costs.render_call_seconds + in_total(parts)
    assert told.gain == pytest.approx(40.0 / pair)
    assert told.run_gain == pytest.approx(40.0 / (pair + sum(parts[name] for name in OUTSIDE)))


@pytest.mark.parametrize("whole_run", [False, True])
def test_at_the_break_even_a_pair_takes_as_long_as_multiview(whole_run):
    parts = parts_of(RUN)
    told = predicted(parts, 0.1, 2, break_even(parts, 0.1, 2, whole_run=whole_run))
    assert (told.run_gain if whole_run else told.gain) == pytest.approx(1.0)


def test_the_tables_have_a_column_and_a_row_for_each_version():
    slower = {**RUN, "start": 3.0}
    text = as_markdown({("room", "1920x1080", BEFORE): [slower] * 3, ("room", "1920x1080", NOW): [RUN, RUN, slower]})
    parts, gains = text.split("\n\n")
    assert "| start of the second Blender | 3.00 s | 1.00 s |" in parts
    assert [line.count("|") for line in parts.splitlines()] == [4] * len(parts.splitlines())
    told_of = [line.split(" | ")[0] for line in gains.splitlines()[2:]]
    assert told_of == [f"| room, 1920x1080, {version}" for version in (BEFORE, NOW)]


def test_what_is_left_out_has_the_sizes_of_the_page():
    options = parse(["--scenes", "anywhere", "a"])
    assert (options.sizes, options.turns, options.names) == (SIZES, 3, ["a"])


@pytest.mark.parametrize("clock", ["wall", "processor"])
def test_a_run_is_measured_from_its_start_to_its_end(tmp_path, clock):
    bpy = pytest.importorskip("bpy")
    from tests.bench.fixed_costs.__main__ import ROOT

    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.context.scene.render.engine = "CYCLES"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "cube.blend"), copy=True)
    run = measured(Scene("cube", tmp_path / "cube.blend"), (64, 36), 1, clock, ROOT)
    parts = parts_of(run)
    assert json.dumps(run)
    assert all(seconds >= 0.0 for seconds in parts.values()), parts
    written = ("left.exr, right.exr, estimate.exr", "stereo.exr", "stereo.png", "holes.png, estimate.png, grid.png")
    assert all(parts[name] > 0.0 for name in written)
    assert parts["render calls beside Cycles: EXR written and read"] > 0.0
    assert run["functions"]["source"]["cycles"] <= run["stages"]["source"]
