"""The performance analysis without a render: exponents, the plan, what is kept of runs, and the tables."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("scipy")
pytest.importorskip("matplotlib")

from stereo_reproject.jobs.work_folder import work_folder
from tests.bench.performance import __main__ as bench
from tests.bench.performance import fits, paper, running, stage_tables, tables
from tests.bench.performance.__main__ import main
from tests.bench.performance.fits import fitted, power_law, power_law_with_constant
from tests.bench.performance.keeping import DONE, FAILED, LEFT_OUT, Kept, have_run
from tests.bench.performance.options import QUICK_SECONDS, parse, plan_of
from tests.bench.performance.pictures import animation_of, draw_all, prices_of
from tests.bench.performance.plan import (
    EYES,
    HOLES,
    METHODS,
    MULTIVIEW,
    PATH,
    QUICK,
    SAMPLES,
    SCENES,
    SERIES,
    STAGE,
    TRIANGLES,
    Case,
    Plan,
    Scene,
    cases,
    scenes_in,
)
from tests.bench.performance.results import analysed, write_csv
from tests.bench.performance.running import ROOT, Ended, last_json, record_of, run_process
from tests.bench.warp import __main__ as program
from tests.bench.warp.measure import LEFT_TO_NUMPY
from tests.bench.warp.profile import STEPS
from tests.bench.warp.settings import CARRIERS, MODES

SECONDS = 60.0
EXACT = 1e-6
SEARCHED = 1e-3
"""What a search for three numbers leaves open of an exponent."""

X = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0])
SURROUNDINGS = {"machine": "this one", "versions": {"numpy": "2"}}

TINY = replace(
    QUICK,
    sizes=((32, 18), (64, 36)),
    path_sizes=None,
    frames=(1, 2),
    study_sizes=((16, 9), (32, 18)),
    study_counts=(1, 2),
    subdivisions=(0, 1),
    interoculars=(1.0, 2.0),
    stage_sizes=((16, 9), (32, 18)),
    stage_size=(32, 18),
    study_size=(32, 18),
)


# Exponents


@pytest.mark.parametrize("exponent", [-1.0, 0.5, 1.0, 2.0])
def test_an_exact_power_is_found_with_no_doubt(exponent):
    fit = power_law(X, 3.0 * X**exponent)
    assert fit.exponent == pytest.approx(exponent, abs=EXACT)
    assert fit.factor == pytest.approx(3.0)
    assert (fit.low, fit.high) == (pytest.approx(exponent, abs=EXACT), pytest.approx(exponent, abs=EXACT))
    assert fit.spread == pytest.approx(1.0)
    assert fitted(X, 3.0 * X**exponent).constant == 0.0


def test_what_does_not_grow_is_told_from_what_does():
    fit = fitted(X, 5.0 + 0.2 * X**1.5)
    assert fit.exponent == pytest.approx(1.5, abs=SEARCHED)
    assert fit.constant == pytest.approx(5.0, rel=SEARCHED)
    assert fit.at(100.0) == pytest.approx(5.0 + 0.2 * 1000.0, rel=SEARCHED)
    assert power_law(X, 5.0 + 0.2 * X**1.5).exponent < 1.0, "without a constant it would be taken for less"


def test_of_a_few_points_no_constant_is_told():
    assert fitted(X[:4], 5.0 + 0.2 * X[:4] ** 1.5).constant == 0.0


@pytest.mark.parametrize("constant", [0.0, 2.0])
def test_the_interval_holds_the_truth_as_often_as_it_says(constant):
    """95 % of 200 are 190; fewer than 180 or all of them would be a wrong interval."""
    rng = np.random.default_rng(3)
    x = np.tile(X, 3)
    inside, repeats = 0, 200
    for _ in range(repeats):
        y = (constant + 0.5 * x**1.2) * np.exp(0.05 * rng.standard_normal(len(x)))
        fit = power_law_with_constant(x, y) if constant else power_law(x, y)
        inside += fit.low <= 1.2 <= fit.high
    assert 180 <= inside < repeats


@pytest.mark.parametrize(
    ("x", "y"),
    [([], []), ([3.0], [1.0]), ([3.0, 3.0], [1.0, 2.0]), ([3.0, 3.1], [1.0, 2.0]), ([0.0, 5.0], [1.0, 1.0])],
)
def test_without_different_places_there_is_no_exponent(x, y):
    assert fitted(x, y) is None


def test_two_points_have_an_exponent_without_an_interval():
    fit = fitted([1.0, 10.0], [1.0, 100.0])
    assert (fit.exponent, fit.low, fit.high) == (pytest.approx(2.0), None, None)


def test_what_took_no_time_is_left_out_of_a_fit():
    assert fitted([1.0, 2.0, 4.0], [0.0, 2.0, 4.0]).points == 2
    assert fits.LEAST_POINTS > fits.LEAST_PLACES


# Plan


@pytest.fixture
def room(tmp_path):
    """A scene whose file is there."""
    blend = tmp_path / "room.blend"
    blend.write_bytes(b"BLENDER-v502")
    return Scene("room", blend, 0.065, 3.0)


def planned(room, plan=TINY):
    subdivided = [replace(room, name=f"room-{level}", triangles=100 * 4**level) for level in plan.subdivisions]
    return cases(plan, [room], room, replace(room, name="room-path"), subdivided)


def test_the_plan_has_every_part_and_method(room):
    parts = {(case.part, case.run.method) for case in planned(room)}
    assert parts >= {(part, method) for part in (SCENES, PATH, *SERIES) for method in METHODS}
    for part in (SCENES, PATH):
        assert {method for one, method in parts if one == part} == {*METHODS, MULTIVIEW}


def test_what_is_compared_has_its_peer_next_to_it(room):
    runs = [case.run for case in planned(room, replace(TINY, turns=2, parts=(SCENES, PATH)))]
    for place, run in enumerate(runs):
        assert abs(runs.index(run.peer) - place) <= 1


def test_the_options_are_those_of_the_command_line(room):
    from stereo_reproject.programs.cli import _parser
    from stereo_reproject.programs.shared_options import settings_of

    case = next(case for case in planned(room) if case.part == PATH and case.run.method == "card")
    arguments = _parser("test").parse_args(["render", str(room.blend), "--output", "out", *case.run.options()])
    settings = settings_of(arguments)
    assert (settings.fill, settings.accuracy, settings.compare) == ("card", "balanced", False)
    scene = settings.scene
    assert (scene.size, scene.frame, scene.denoise) == (case.run.size, 1, False)
    assert (scene.interocular_distance, scene.convergence_distance) == (0.065, 3.0)


def test_only_one_thing_is_varied_at_a_time(room):
    for series in SERIES:
        runs = [case.run for case in planned(room) if case.part == series and case.run.method == "packed"]
        differing = [
            name
            for name, values in {
                "pixels": {run.size for run in runs},
                "samples": {run.samples for run in runs},
                TRIANGLES: {run.scene.name for run in runs},
                HOLES: {run.scene.interocular for run in runs},
            }.items()
            if len(values) > 1
        ]
        assert differing == [series]


def test_repeats_have_seeds_of_their_own(room):
    seeds = {
        option
        for case in planned(room, replace(TINY, turns=2))
        for option in case.run.options()
        if option.startswith("--seed")
    }
    assert seeds == {"--seed=1", "--seed=2"}


def test_parts_can_be_chosen(room):
    assert {case.part for case in planned(room, replace(TINY, parts=(SAMPLES,)))} == {SAMPLES}


def test_the_scenes_of_a_folder_are_found_with_their_eyes(tmp_path):
    for name in ("zebra", "classroom", "bathroom"):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"{name}.blend").touch()
    (tmp_path / "classroom" / "other.blend").touch()
    (tmp_path / "alone.blend").touch()
    found = scenes_in(tmp_path)
    assert [scene.name for scene in found] == ["classroom", "bathroom", "alone", "zebra"]
    assert (found[0].interocular, found[0].convergence) == EYES["classroom"]
    assert found[3].interocular is None
    assert [scene.name for scene in scenes_in(tmp_path, ["zebra"])] == ["zebra"]


# What is kept of runs


def report_of(run, **changes):
    """Figures that are the run's own, as `render` reports them."""
    pixels = run.size[0] * run.size[1]
    source, fill = 1e-4 * pixels * run.samples, 1e-5 * pixels * run.samples
    total = source + fill + 0.25
    if run.method in CARRIERS:
        agreement = {"holes": 0.0, "colour": 1e-4, "why_none": None}
        native = run.picture.grid_threshold == 0.0
        figures = {"seconds": 1e-6 * pixels**1.1, "lookup_ratio": 2.5, "peak_bytes_per_pixel": 75.0}
        by_step = {"map_seconds": 0.5 if native else 0.2, "profile": dict.fromkeys(STEPS, 0.003)}
        by_step = by_step if run.method == "numpy" else dict.fromkeys(by_step)
        shares = {"holes": 0.1, "subdivided": 1.0 if native else 0.25}
        stage = {**figures, **by_step, **shares, "device": "Some CPU", "agreement": agreement}
        return {"seconds": {"total": stage["seconds"]}, "stage": stage}
    if run.method == MULTIVIEW:
        return {"seconds": {"total": 2.0 * total}, "memory": {"peak_mb": 250.0}}
    report = {
        "size": list(run.size),
        "samples": run.samples,
        "blender": "5.2.3 LTS",
        "seconds": {"load": 0.5, "source": source, "warp": 0.25, "fill": fill, "composite": 0.0, "total": total},
        "fractions": {"disoccluded": 0.03, "outside": 0.01, "silhouette": 0.02, "rerendered": 0.06},
        "grid": {"cells": 8, "subdivided": 2, "triangles": 44},
        "memory": {"peak_mb": 300.0},
    }
    return {**report, **changes}


class FakeRunner:
    """Notes what it is to run, and fails or is interrupted where it is told to."""

    def __init__(self, *, fails=lambda _: False, interrupted_after=None):
        self.ran, self._fails, self._after = [], fails, interrupted_after

    def __call__(self, run):
        if self._after is not None and len(self.ran) >= self._after:
            raise KeyboardInterrupt
        self.ran.append(run)
        if self._fails(run):
            return {"status": FAILED, "message": "out of | memory"}
        return {"status": DONE, "wall_seconds": 1.0, "process_peak_mb": 400.0, "report": report_of(run)}


def have(cases, folder, runner, **options):
    surroundings = options.pop("surroundings", SURROUNDINGS)
    return have_run(cases, Kept(folder / "runs", surroundings), runner, tell=lambda _: None, **options)


def test_what_several_parts_need_is_run_once(room, tmp_path):
    runner = FakeRunner()
    wanted = planned(room)
    records = have(wanted, tmp_path, runner)
    assert len(runner.ran) == len(set(runner.ran)) == len(records)
    assert {case.run for case in wanted} == set(records)
    assert len(runner.ran) < len(wanted)


def test_an_interrupted_analysis_goes_on_where_it_ended(room, tmp_path):
    wanted, first, second = planned(room), FakeRunner(interrupted_after=5), FakeRunner()
    with pytest.raises(KeyboardInterrupt):
        have(wanted, tmp_path, first)
    records = have(wanted, tmp_path, second)
    assert len(first.ran) == 5
    assert not set(first.ran) & set(second.ran)
    assert all(record["status"] == DONE for record in records.values())
    assert records == have(wanted, tmp_path, FakeRunner(interrupted_after=0)), "all are there, and as they were"


def test_what_has_failed_does_not_stop_the_others_and_is_tried_again(room, tmp_path):
    wanted = planned(room)
    records = have(wanted, tmp_path, FakeRunner(fails=lambda run: run.method == "card"))
    assert {record["status"] for record in records.values()} == {DONE, FAILED}
    again = FakeRunner()
    have(wanted, tmp_path, again)
    assert {run.method for run in again.ran} == {"card"}


def test_a_damaged_file_is_no_finished_run(room, tmp_path):
    wanted = planned(room)[:1]
    have(wanted, tmp_path, FakeRunner())
    (file,) = (tmp_path / "runs").iterdir()
    file.write_text('{"status": "do', encoding="utf-8")
    again = FakeRunner()
    have(wanted, tmp_path, again)
    assert len(again.ran) == 1


def test_runs_of_another_scene_or_program_are_not_taken_for_these(room, tmp_path):
    wanted = planned(room, replace(TINY, parts=(SCENES,)))[:1]
    have(wanted, tmp_path, FakeRunner())
    newer = FakeRunner()
    have(wanted, tmp_path, newer, surroundings={**SURROUNDINGS, "versions": {"numpy": "3"}})
    room.blend.write_bytes(b"BLENDER-v502, changed")
    changed = FakeRunner()
    have(wanted, tmp_path, changed)
    assert (len(newer.ran), len(changed.ran)) == (1, 1)


def test_when_the_time_is_up_no_run_is_begun(room, tmp_path):
    ticks = iter(range(1000))
    runner = FakeRunner()
    records = have(planned(room), tmp_path, runner, seconds=3.0, clock=lambda: float(next(ticks)))
    assert len(runner.ran) == 3
    assert sum(record["status"] == LEFT_OUT for record in records.values()) == len(records) - 3


# Processes


def test_a_process_tells_of_its_end(tmp_path):
    ended = run_process(["-c", "print('{\"a\": 1}'); print('Blender quits')"], tmp_path / "run")
    assert (ended.status, last_json(ended.output)) == (0, {"a": 1})
    assert ended.seconds > 0.0
    assert list((tmp_path / "run").iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "wait4"), reason="the system does not tell of memory")
def test_the_peak_is_that_of_the_process_and_of_its_own(tmp_path):
    grandchild = "b = bytearray(300 << 20)"
    code = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {grandchild!r}], check=True)"
    assert run_process(["-c", code], tmp_path / "run").peak_mb > 300.0
    assert run_process(["-c", grandchild], tmp_path / "run").peak_mb > 300.0


def test_the_message_of_a_failed_run_is_its_last_error():
    errors = "stereo_reproject: warning: x\nstereo_reproject: error: no camera; add one\n"
    assert Ended(2, 1.0, None, "", errors).message() == "no camera; add one"
    assert Ended(-9, 1.0, None, "", "").message() == "exit status -9"
    assert record_of(Ended(2, 1.0, None, "", errors), None)["message"] == "no camera; add one"
    assert record_of(Ended(0, 1.0, None, "", ""), None)["status"] == FAILED


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_analysis_ends_its_run(tmp_path, signum):
    program = f"""
import sys
from pathlib import Path
from tests.bench.performance import __main__ as bench
from tests.bench.performance.running import run_process
bench.be_interruptible()
child = "import os, time; open({str(tmp_path / "pid")!r}, 'w').write(str(os.getpid())); time.sleep(600)"
try:
    run_process(["-c", child], Path({str(tmp_path / "run")!r}))
except KeyboardInterrupt:
    sys.exit(7)
"""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    # As a script starts what it leaves in the background.
    command = ["sh", "-c", "trap '' INT; exec \"$@\"", "sh", sys.executable, "-c", program]
    with subprocess.Popen(command, env=environment, cwd=ROOT) as process:
        deadline = time.monotonic() + SECONDS
        pid = ""
        while not pid and time.monotonic() < deadline:
            pid = (tmp_path / "pid").read_text() if (tmp_path / "pid").exists() else ""
            time.sleep(0.01)
        process.send_signal(signum)
        assert process.wait(SECONDS) == 7
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid), 0)


# Results


@pytest.fixture
def results(room, tmp_path):
    wanted = planned(room)
    found = analysed(wanted, have(wanted, tmp_path, FakeRunner()))
    found["facts"] = {
        "machine": {"cpu": "Some CPU", "cores": 2, "system": "Linux"},
        "versions": {"numpy": "2", "bpy": None},
        "command": "the command",
        "quick": True,
        "commit": "abc123",
        "turns": 3,
        "blender": "5.2.3 LTS",
        "runs": {DONE: len(found["runs"]), FAILED: 0, LEFT_OUT: 0},
        "ended": "today",
    }
    return found


def test_each_scene_size_and_method_has_its_row(results):
    rows = results["scenes"]
    assert [(row["size"], row["method"]) for row in rows] == [
        ([width, height], method) for width, height in TINY.sizes for method in (MULTIVIEW, *METHODS)
    ]
    peer, card, _ = rows[:3]
    assert peer["seconds"]["total"] == pytest.approx(2.0 * card["seconds"]["total"])
    assert card["multiview_seconds"] == pytest.approx(2.0 * card["seconds"]["total"])
    assert peer["peak_mb"] == 250.0, "of a process of its own"
    assert (card["speedup"], card["holes"], card["traced"]) == (2.0, pytest.approx(0.04), 0.06)


def test_repeats_come_to_their_median(room, tmp_path):
    wanted = planned(room, replace(TINY, turns=3, parts=(SCENES,)))
    records = have(wanted, tmp_path, FakeRunner())
    for run, record in records.items():
        if run.method == "packed":
            record["report"] = report_of(run, seconds={**report_of(run)["seconds"], "warp": (9.0, 1.0, 2.0)[run.turn]})
    row = analysed(wanted, records)["scenes"][2]
    assert (row["seconds"]["warp"], row["turns"]) == (2.0, 3)


def test_a_speed_up_is_that_of_two_runs_of_one_repeat(room, tmp_path):
    """Each has its own machine's mood: the ratio of the medians would be 3 here."""
    wanted = planned(room, replace(TINY, turns=3, parts=(SCENES,)))
    records = have(wanted, tmp_path, FakeRunner())
    for run, record in records.items():
        total = {MULTIVIEW: (12.0, 6.0, 60.0), "card": (6.0, 4.0, 30.0), "packed": (3.0, 4.0, 30.0)}[run.method][
            run.turn
        ]
        record["report"] = report_of(run, seconds={"total": total})
        if run.method == MULTIVIEW:
            record["report"]["seconds"] = {"total": total}
    card, packed = analysed(wanted, records)["scenes"][1:3]
    assert (card["speedup"], packed["speedup"], packed["multiview_seconds"]) == (2.0, 2.0, 12.0)


def test_without_its_peer_a_run_has_no_speed_up(room, tmp_path):
    wanted = planned(room)
    found = analysed(wanted, have(wanted, tmp_path, FakeRunner(fails=lambda run: run.method == MULTIVIEW)))
    rows = [*found["scenes"][1:3], *found["path"]]
    assert {(row["speedup"], row["multiview_seconds"], row["message"]) for row in rows} == {(None, None, None)}
    assert prices_of(found["scenes"][:3], "5.2") is None


def test_the_warp_stage_has_a_row_for_each_size_and_carrier(results):
    rows = results["stage"]
    of_room = [row for row in rows if (row["scene"], row["mode"]) == ("room", "off-axis")]
    assert [(row["size"], row["method"]) for row in of_room] == [
        ([width, height], carrier) for width, height in TINY.stage_sizes for carrier in CARRIERS
    ]
    assert [row["growth"] for row in of_room] == pytest.approx([1.0, 1.0, 4.0**0.1, 4.0**0.1])
    lines = stage_tables.stage_table(rows).splitlines()
    figures = "numpy (Some CPU) | 1.09 ms | 2.50 | 1.15 | 75.0 B/px | 0.0000%, 0.0001 |"
    assert f"| room, off-axis | 32x18 | {figures}" in lines
    assert "RTX 2080 Ti) | 0.25 ms" in lines[-2]
    assert "smooth, toe-in, native" in "".join(lines)


def test_the_warp_stage_is_measured_toed_in_and_on_smooth_surfaces_natively_and_not(room):
    runs = [case.run for case in planned(room) if case.part == STAGE]
    pictures = {(run.picture.scene, run.picture.mode, run.picture.grid_threshold) for run in runs}
    smooth = {("smooth", mode, threshold) for mode in MODES for threshold in (0.0, 0.25)}
    assert pictures == {("room", mode, 0.25) for mode in MODES} | smooth
    assert {run.size for run in runs if run.picture.scene == "smooth"} == {TINY.stage_size}


def test_a_picture_of_the_warp_stage_is_asked_for_in_words_that_its_program_knows(room):
    for run in (case.run for case in planned(room) if case.part == STAGE):
        told = program.parse(run.options())
        assert (told.scene, told.mode, told.grid_threshold) == tuple(asdict(run.picture).values())


def test_the_adaptive_grid_is_compared_with_the_native_one_of_the_same_picture(results):
    rows = results["grid"]
    assert [(row["scene"], row["mode"]) for row in rows] == [("smooth", mode) for mode in MODES]
    assert [row["map_speedup"] for row in rows] == pytest.approx([2.5, 2.5])
    assert [row["stage_speedup"] for row in rows] == pytest.approx([1.0, 1.0])
    line = stage_tables.grid_table(rows).splitlines()[2]
    assert "0.25 arc minutes | 25.0%, native 100.0% | 500 ms | 200 ms | 2.50 ×" in line


def test_without_its_native_run_an_adaptive_one_is_not_compared(room, tmp_path):
    wanted = planned(room, replace(TINY, parts=(STAGE,)))
    found = analysed(wanted, have(wanted, tmp_path, FakeRunner(fails=lambda run: run.picture.grid_threshold == 0.0)))
    assert found["grid"] == []


def test_the_steps_of_the_stage_are_told_with_their_shares(results):
    lines = stage_tables.profile_table(results["stage"]).splitlines()
    by_numpy = [row for row in results["stage"] if row["method"] == "numpy"]
    assert len(lines) == 2 + len(by_numpy)
    assert all(line.count(f"3.00 ms ({1 / len(STEPS):.0%})") == len(STEPS) for line in lines[2:])
    assert len({line.count("|") for line in lines}) == 1


@pytest.mark.parametrize("why", ["no usable GPU (none); --warp numpy needs none", f"Grand 9000 {LEFT_TO_NUMPY}; take"])
def test_where_there_is_no_gpu_its_row_says_so_and_nothing_has_failed(room, tmp_path, monkeypatch, why):
    errors = f"stereo_reproject: error: --warp gpu: {why}\n"
    monkeypatch.setattr(running, "run_process", lambda *_: Ended(2, 1.0, None, "", errors))
    run = next(case.run for case in planned(room) if case.run.method == "gpu")
    record = running.Runner(tmp_path)(run)
    assert record["status"] == LEFT_OUT
    rows = analysed([Case(STAGE, run)], {run: record})["stage"]
    assert f"--warp gpu: {why}" in stage_tables.stage_table(rows).splitlines()[2]


def test_the_growth_of_each_stage_is_told(results):
    by_series = {(row["series"], row["method"]): row["stages"] for row in results["scaling"]}
    assert set(by_series) == {(series, method) for series in SERIES for method in METHODS}
    exponents = {stage["stage"]: stage["fit"] for stage in by_series[SAMPLES, "packed"]}
    assert exponents["source"]["exponent"] == pytest.approx(1.0)
    assert exponents["warp"]["exponent"] == pytest.approx(0.0)
    assert exponents["composite"] is None, "what takes no time has no exponent"
    assert all(stage["fit"] is None for stage in by_series[HOLES, "card"]), "the same share each time"


def test_the_growth_of_stages_that_are_in_every_run_alone_is_told(room, tmp_path):
    wanted = planned(room, replace(TINY, parts=(SAMPLES,)))
    records = have(wanted, tmp_path, FakeRunner())
    for run, record in records.items():
        record["report"]["seconds"] |= {"pilot": 2.0 * run.samples}
        if run.samples > 1:
            record["report"]["seconds"] |= {"refine": 1.0}
    row = analysed(wanted, records)["scaling"][1]
    fits_of = {stage["stage"]: stage["fit"] for stage in row["stages"]}
    assert list(fits_of) == ["source", "warp", "pilot", "fill", "composite", "total"]
    assert fits_of["pilot"]["exponent"] == pytest.approx(1.0)
    assert row["not_in_all"] == ["refine"]
    assert "* Not in every run, and not fitted: refine (samples a pixel, packed)" in tables.scaling_table([row])


@pytest.mark.parametrize(
    ("size", "frames"), [((960, 540), 24), ((1920, 1080), 6), ((3840, 2160), 3), ((1920, 540), 12)]
)
def test_the_path_has_fewer_frames_where_they_are_larger(size, frames):
    found = Plan(path_sizes=((960, 540), size)).frames_at(size)
    assert len(found) == len(set(found)) == frames
    assert (found[0], found[-1]) == (1, 24)


def test_the_path_has_the_sizes_of_the_scenes_unless_it_is_told_others(room):
    def sizes(plan):
        return {case.run.size for case in planned(room, plan) if case.part == PATH}

    assert sizes(TINY) == set(TINY.sizes)
    assert sizes(replace(TINY, path_sizes=((8, 8),))) == {(8, 8)}
    assert replace(TINY, frames=(3,)).frames_at(TINY.sizes[1]) == [3]


def test_the_path_comes_to_totals_by_size_and_method(results):
    rows = results["path_totals"]
    assert [(row["size"], row["method"]) for row in rows] == [
        (list(size), method) for size in TINY.sizes for method in METHODS
    ]
    assert {(row["frames"], row["speedup"], row["traced"], row["peak_mb"]) for row in rows} == {(2, 2.0, 0.06, 300.0)}
    small, large = rows[0], rows[2]
    assert small["seconds"] < large["seconds"] == pytest.approx(0.5 * large["multiview_seconds"])


def test_the_speed_up_of_the_path_is_that_of_all_its_frames_together(room, tmp_path):
    wanted = planned(room, replace(TINY, parts=(PATH,), sizes=((32, 18),)))
    records = have(wanted, tmp_path, FakeRunner())
    for run, record in records.items():
        total = {MULTIVIEW: (2.0, 30.0), "card": (1.0, 10.0), "packed": (1.0, 10.0)}[run.method][run.frame - 1]
        record["report"]["seconds"]["total"] = total
    row = analysed(wanted, records)["path_totals"][0]
    assert (row["speedup"], row["speedups"]) == (pytest.approx(32.0 / 11.0), [2.0, 3.0])


def test_the_tables_have_a_line_for_each_row(results):
    text = tables.as_markdown(results)
    lines = text.splitlines()
    assert sum(line.startswith("| room | 32x18 |") for line in lines) == 3
    assert sum(line.startswith(("| 1 |", "| 2 |")) for line in lines) == 8
    assert f"{paper.TITLE}, over two full renders | 1.28 to 1.55 × | 6%" in text
    assert "its table 2 could not be had" in text
    assert "do not quote its seconds" in text
    for fact in ("* Commit: abc123", "* Turns: 3 of each run", "Some CPU, 2 cores", "`the command`"):
        assert fact in text
    for table in (
        tables.scenes_table(results["scenes"]),
        tables.path_totals_table(results["path_totals"]),
        tables.scaling_table(results["scaling"]),
    ):
        assert len({line.count("|") for line in table.splitlines()}) == 1, "every line has as many cells"


def test_the_paper_stands_beside_the_rows_that_have_a_speed_up(results):
    for table in (tables.scenes_table(results["scenes"]), tables.path_totals_table(results["path_totals"])):
        last = table.splitlines()[-1]
        assert last.startswith(f"| {paper.TITLE} |")
        assert "| 1.28 to 1.55 × |" in last
        assert "6% on average" in last


def test_a_failed_run_says_so_in_its_cell_and_the_table_stays_whole(room, tmp_path):
    wanted = planned(room)
    records = have(wanted, tmp_path, FakeRunner(fails=lambda run: run.method == "card" and run.size == (32, 18)))
    found = analysed(wanted, records)
    table = tables.scenes_table(found["scenes"])
    failed = [line for line in table.splitlines() if "failed" in line]
    assert len(failed) == 1
    assert r"failed: out of \| memory" in failed[0]
    assert len({line.replace(r"\|", "").count("|") for line in table.splitlines()}) == 1
    assert "Not measured: room" in tables.scaling_table(found["scaling"])
    assert found["scenes"][0]["message"] is None, "multiview is known from the other"


def test_where_all_has_failed_there_still_are_tables_and_no_charts(room, tmp_path):
    wanted = planned(room)
    found = analysed(wanted, have(wanted, tmp_path, FakeRunner(fails=lambda _: True)))
    found["facts"] = {"blender": None}
    assert draw_all(found, tmp_path) == []
    for table in (tables.scenes_table(found["scenes"]), tables.path_table(found["path"])):
        assert "failed: out of" in table
    write_csv(tmp_path / "results.csv", found["runs"])


def test_the_csv_has_a_line_for_each_run_of_a_part(results, tmp_path):
    write_csv(tmp_path / "results.csv", results["runs"])
    with (tmp_path / "results.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(results["runs"])
    row = next(row for row in rows if row["part"] == SCENES)
    assert (row["size"], row["method"], row["rerendered"]) == ("32x18", "card", "0.06")
    assert float(row["total_seconds"]) > float(row["source_seconds"]) > 0.0


def test_the_charts_are_drawn_of_what_was_measured(results, tmp_path):
    names = draw_all(results, tmp_path)
    assert names == [
        *("stages-room-32x18", "stages-room-64x36"),
        *(f"path-{method}-{size}" for size in ("32x18", "64x36") for method in METHODS),
    ]
    for name in names:
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        drawn = (tmp_path / f"{name}.svg").read_text(encoding="utf-8")
        assert f"{paper.TITLE}, over two full renders" in drawn
        assert "the paper, " in drawn
    prices = prices_of(results["scenes"][:3], "5.2")
    assert [row["name"] for row in prices["rows"]] == list(METHODS)
    assert animation_of(results["path"][:2])["totals"]["speedup"] == pytest.approx(2.0)


# The command line


def test_quick_needs_no_folder_and_has_a_time():
    options = parse(["--quick"])
    assert (options.seconds, plan_of(options)) == (QUICK_SECONDS, QUICK)
    assert plan_of(parse(["--scenes", "x"])) == Plan()


def test_what_is_said_replaces_what_is_planned():
    assert plan_of(parse(["--quick", "--sizes", "64x36"])).path_sizes is None, "the path has the scenes' own"
    lengths = ["--path-sizes", "16x9", "--path-samples", "3", "--study-samples", "5"]
    told = plan_of(parse(["--quick", *lengths]))
    assert (told.path_sizes, told.path_samples, told.study_samples) == (((16, 9),), 3, 5)
    plan = plan_of(parse(["--quick", "--sizes", "64x36", "--frames", "2-6:2", "--parts", "path", "--turns", "2"]))
    assert (plan.sizes, plan.frames, plan.parts, plan.turns) == (((64, 36),), (2, 4, 6), (PATH,), 2)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "name a folder of scenes"),
        (["--quick", "--sizes", "wide"], "must be of the form WIDTHxHEIGHT"),
        (["--quick", "--frames", "6-1"], "must be of the form A-B"),
        (["--quick", "--turns", "0"], "must be a whole number from 1"),
        (["--quick", "--parts", "all"], "invalid choice: 'all'"),
        (["--quick", "--sizes", "1x1"], "must be at least 4x4, not 1x1"),
        (["--quick", "--frames", "1-99999"], "must not go beyond frame 1000"),
        (["--quick", "--seconds", "nan"], "must be a number of seconds, not 'nan'"),
        (["--quick", "--seconds", "-1"], "must be a number of seconds, not '-1'"),
        (["--quick", "--output", ""], "is empty; name a folder"),
    ],
)
def test_a_bad_option_is_told_in_a_line(tmp_path, monkeypatch, capsys, arguments, told):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    assert main(arguments) == 2
    printed = capsys.readouterr()
    assert (printed.out, printed.err.count("\n")) == ("", 1)
    assert told in printed.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--scenes", "nowhere"], "there is no folder nowhere; name one with .blend files (SCENES=folder)"),
        (["--scenes", "."], ". has no .blend file"),
        (["--quick", "--study", "garden"], "--study: no scene garden; known are: cornell-box"),
        (["--quick", "--animated", "x.blend"], "--animated: there is no file x.blend"),
    ],
)
def test_bad_input_is_one_line(tmp_path, monkeypatch, capsys, arguments, told):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    assert main([*arguments, "--output", str(tmp_path / "out")]) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("error: ")
    assert printed.err.count("\n") == 1
    assert told in printed.err
    assert not list(Path(tmp_path).rglob("*.json"))


def test_two_analyses_do_not_share_a_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    with work_folder(tmp_path) as other:
        assert main(["--quick", "--fresh", "--output", str(tmp_path)]) == 2
        assert len(list(tmp_path.iterdir())) == 1
    printed = capsys.readouterr()
    assert printed.err.startswith(f"error: another analysis is writing to {tmp_path}; wait for it")
    assert f"remove {other.name}" in printed.err
    assert printed.err.count("\n") == 1


def test_nothing_to_measure_is_bad_input(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "mine.blend").touch()
    options = ["--scenes", tmp_path / "scenes", "--study", "mine", "--parts", "holes", "--output", tmp_path / "out"]
    assert main([str(option) for option in options]) == 2
    assert capsys.readouterr().err == "error: nothing of holes can be measured of these scenes; name others\n"


def test_to_measure_anew_removes_nothing_else(tmp_path, monkeypatch):
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    for folder in ("runs", "variants"):
        (tmp_path / folder).mkdir()
    ours = [tmp_path / "runs" / f"a-run-{'0' * 16}.json", tmp_path / "variants" / "note.json"]
    theirs = [tmp_path / folder / "mine.json" for folder in ("runs", "variants")]
    for file in (*ours, *theirs):
        file.write_text('{"of": []}' if file == ours[1] else "{}")
    monkeypatch.setattr(bench, "cases", lambda *_: [])
    assert main(["--quick", "--fresh", "--parts", "scenes", "--output", str(tmp_path)]) == 2
    assert [file.exists() for file in (*ours, *theirs)] == [False, False, True, True]


@pytest.mark.parametrize(("signum", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_how_it_was_interrupted_is_in_its_status(monkeypatch, capsys, signum, status):
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(bench, "_analyse", lambda *_: bench._interrupt(signum, None))
    assert main(["--quick"]) == status
    assert "interrupted" in capsys.readouterr().err


def test_a_bench_of_other_figures_is_strict_json(results, tmp_path):
    from stereo_reproject.files import write_json

    write_json(tmp_path / "results.json", results)
    again = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert again["scenes"][0]["method"] == MULTIVIEW
