"""Times of scenes without a render: the runs, what their reports come to, the order, the table and the chart."""

import json
import re
from dataclasses import asdict, replace
from pathlib import Path

import pytest

pytest.importorskip("matplotlib")

from stereo_reproject.programs.cli import _parser
from tests.bench.performance.keeping import DONE, FAILED
from tests.bench.performance.plan import MULTIVIEW, Scene
from tests.bench.scene_times import METHOD, SceneTime, as_markdown, by_gain, cases_of, main, parse, read_data, times_of

ROOM, VASE = Scene("room", Path("room.blend"), 0.065, 2.5), Scene("vase", Path("vase.blend"))
PNG_START = b"\x89PNG\r\n\x1a\n"


def options(*more):
    return parse(["--scenes", "anywhere", "--size", "64x36", "--samples", "2", *more])


def done(ours, multiview, traced=0.1, noise_ratio=1.1):
    compared = {"multiview_seconds": multiview, "noise_ratio": noise_ratio}
    report = {"seconds": {"total": ours}, "fractions": {"rerendered": traced}, "compare": compared}
    return {"status": DONE, "report": report}


def time(scene, denoised, share):
    return SceneTime(scene, denoised, 10.0 * share, 10.0, share, 0.1, 1.1)


MEASURED = (
    time("slow", True, 0.9),
    time("slow", False, 0.8),
    time("fast", True, 0.5625),
    time("fast", False, 0.75),
    time("half known", True, 0.7),
    SceneTime("half known", False, message="out of | memory"),
    SceneTime("gone", True, message="no camera"),
)


def test_each_turn_has_every_scene_denoised_and_not_with_a_seed_of_its_own():
    cases = cases_of([ROOM, VASE], options("--turns", "2"))
    assert len({case.run for case in cases}) == len(cases) == 8
    read = [_parser("test").parse_args(["render", "a.blend", "--output", "b", *case.run.options()]) for case in cases]
    assert [arguments.denoise for arguments in read] == [True, False] * 4
    assert [arguments.seed for arguments in read] == [1] * 4 + [2] * 4
    assert [arguments.interocular for arguments in read] == [0.065, 0.065, None, None] * 2
    assert all(arguments.compare and arguments.size == (64, 36) and arguments.samples == 2 for arguments in read)
    assert {arguments.fill for arguments in read} == {METHOD}


def test_multiview_of_the_same_run_is_denoised_alike_and_compared_with_nothing():
    run = cases_of([ROOM], options())[0].run
    assert run.peer.method == MULTIVIEW
    assert "--denoise" in run.peer.options()
    assert "--compare" not in run.peer.options()


def test_medians_are_told_and_of_shares_those_of_each_process():
    first, second, third = (case.run for case in cases_of([ROOM], options("--turns", "3")) if case.run.denoise)
    records = {first: done(6.0, 10.0, 0.1, 1.0), second: done(8.0, 16.0, 0.2, None), third: done(7.0, 8.0, 0.3, 1.2)}
    (told,) = times_of(records)
    assert told == SceneTime("room", True, 7.0, 10.0, 0.6, 0.2, pytest.approx(1.1))


def test_a_failed_turn_is_left_out_and_a_failed_scene_says_why():
    one, again = (case.run for case in cases_of([ROOM], options("--turns", "2")) if not case.run.denoise)
    failed = {"status": FAILED, "message": "no camera"}
    assert times_of({one: failed, again: done(5.0, 10.0)})[0].share == 0.5
    assert times_of({one: failed, again: failed}) == [SceneTime("room", False, message="no camera")]


def test_the_greatest_gain_is_first_and_what_is_not_known_is_left_out():
    assert [name for name, _ in by_gain(MEASURED)] == ["fast", "half known", "slow"]
    assert [len(own) for _, own in by_gain(MEASURED)] == [2, 1, 2]


def test_the_table_has_all_times_and_why_others_are_missing():
    head, rule, *rows = as_markdown(MEASURED).splitlines()
    assert len(rows) == len(MEASURED)
    assert rows[0] == "| fast | yes | 5.62 s | 10.00 s | 56 % | 1.78 × | 10 % | 1.100 |"
    assert rows[-2:] == [
        r"| half known | no | out of \| memory | – | – | – | – | – |",
        "| gone | yes | no camera | – | – | – | – | – |",
    ]
    assert {len(re.findall(r"(?<!\\)\|", row)) for row in (head, rule, *rows)} == {9}


def test_no_noise_is_no_figure():
    assert as_markdown([replace(MEASURED[0], noise_ratio=None)]).endswith("| 10 % | – |")


@pytest.fixture
def stored(tmp_path):
    data = {
        "schema": 1,
        "blender": "5.2.3 LTS",
        "size": [960, 540],
        "samples": 48,
        "accuracy": "balanced",
        "turns": 3,
        "machine": {"cpu": "a processor", "cores": 2},
        "rows": [asdict(one) for one in MEASURED],
        "runs": [{"status": DONE}],
    }
    path = tmp_path / "scene_times.json"
    path.write_text(json.dumps(data))
    return path


def test_a_file_is_drawn_again(stored, tmp_path, capsys):
    assert main(["--from", str(stored)]) == 0
    assert capsys.readouterr().out == as_markdown(MEASURED) + "\n"
    assert (tmp_path / "scene_times.png").read_bytes().startswith(PNG_START)
    drawn = (tmp_path / "scene_times.svg").read_text(encoding="utf-8")
    texts = re.findall(r"<text[^>]*>([^<]*)</text>", drawn)
    assert "960 × 540 pixels, 48 samples, accuracy balanced, Blender 5.2.3 LTS, a processor, 2 cores" in texts
    assert {"denoised", "not denoised", "56 %", "5.62 s, multiview 10.00 s"} <= set(texts)
    assert [text for text in texts if text in ("slow", "fast", "half known", "gone")] == ["fast", "half known", "slow"]
    assert any("Medians of 3 turns" in text for text in texts)
    assert "Could not be measured: half known not denoised, gone denoised." in texts
    assert main(["--from", str(stored), "--output", str(tmp_path / "again")]) == 0
    assert (tmp_path / "again" / "scene_times.svg").read_text(encoding="utf-8") == drawn


def test_a_file_of_which_a_run_failed_says_so_again(stored):
    data = read_data(stored)
    stored.write_text(json.dumps({**data, "runs": [*data["runs"], {"status": FAILED}]}))
    assert main(["--from", str(stored)]) == 1


def test_a_chart_of_nothing_but_failures_is_drawn(stored, tmp_path):
    rows = [asdict(one) for one in MEASURED if one.share is None]
    stored.write_text(json.dumps({**read_data(stored), "rows": rows}))
    assert main(["--from", str(stored)]) == 0
    assert (tmp_path / "scene_times.png").read_bytes().startswith(PNG_START)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"schema": 1}', '{"schema": 0, "rows": []}', None])
def test_another_file_is_refused_on_one_line(tmp_path, capsys, text):
    path = tmp_path / "other.json"
    if text is not None:
        path.write_text(text)
    assert main(["--from", str(path)]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ")
    assert str(path) in told
    assert told.count("\n") == 1


@pytest.mark.parametrize(
    "wrong",
    [[], ["--scenes", "a", "--from", "b"], ["--scenes", "a", "--turns", "0"], ["--scenes", "a", "--size", "64"]],
)
def test_wrong_options_end_with_status_2(wrong, capsys):
    with pytest.raises(SystemExit) as ended:
        parse(wrong)
    assert ended.value.code == 2
    assert "error: " in capsys.readouterr().err


def test_an_unknown_scene_is_named(tmp_path, capsys):
    (tmp_path / "room.blend").touch()
    assert main(["--scenes", str(tmp_path), "--output", str(tmp_path / "out"), "vase"]) == 2
    assert "no scene vase; known are: room" in capsys.readouterr().err
