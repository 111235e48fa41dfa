"""animation.json: a row for each frame of the journal, and what they all come to."""

import json
import math
from pathlib import Path

import pytest

from stereo_reproject.sequence.figures import figures_of
from stereo_reproject.sequence.fingerprints import Fingerprints
from stereo_reproject.sequence.frame_record import Record
from stereo_reproject.sequence.frames import FramePlan
from stereo_reproject.sequence.journal import Journal
from stereo_reproject.sequence.journal_folder import JOURNAL
from stereo_reproject.sequence.progress import AnimationProgress, Listener
from stereo_reproject.sequence.report import format_animation, report_path, totals, write_animation_report
from stereo_reproject.settings.animation import AnimationSettings


def row(frame=1, *, wall=2.0, multiview=5.0, traced=0.1, beside=0.5, compare=None, **more):
    figures = {
        "wall_seconds": wall,
        "beside_seconds": beside,
        "multiview_seconds": multiview,
        "fractions": {"rerendered": traced},
        "warnings": [],
        **more,
    }
    return {"frame": frame, **figures, **({} if compare is None else {"compare": compare})}


def test_without_a_comparison_the_speed_up_is_predicted():
    whole = totals([row(1, wall=1.0, multiview=4.0, traced=0.1), row(2, wall=3.0, multiview=6.0, traced=0.3)])
    assert whole["frames"] == 2
    assert whole["seconds"] == pytest.approx(4.0)
    assert whole["seconds_per_frame"] == pytest.approx(2.0)
    assert whole["traced"] == pytest.approx(0.2)
    assert whole["multiview_seconds"] == pytest.approx(10.0)
    assert whole["speedup"] == pytest.approx(2.5)
    assert (whole["speedup_from"], whole["compared"]) == ("predicted", 0)


def test_what_was_measured_of_some_frames_counts_for_all():
    rows = [row(1, wall=2.0, multiview=4.0, compare={"multiview_seconds": 3.0}), row(2, wall=2.0, multiview=8.0)]
    whole = totals(rows)
    assert whole["multiview_seconds"] == pytest.approx(9.0), "the frame that was not compared is a dearer one"
    assert whole["speedup"] == pytest.approx(2.25)
    assert (whole["speedup_from"], whole["compared"]) == ("measured", 1)


def test_what_one_frame_takes_beside_is_the_median_which_a_slow_first_frame_does_not_move():
    assert totals([row(1, beside=9.0), row(2, beside=0.4), row(3, beside=0.2)])["beside_seconds_per_frame"] == 0.4


def test_no_frames_are_no_figures():
    whole = totals([])
    assert (whole["frames"], whole["seconds"], whole["speedup"], whole["traced"]) == (0, 0, None, None)
    assert format_animation({"totals": whole, "frames": []}) == "no frames"


def test_the_table_tells_how_the_speed_up_is_known_and_the_worst_noise():
    rows = [
        row(1, compare={"multiview_seconds": 6.0, "noise_ratio": 1.02}),
        row(2, compare={"multiview_seconds": 6.0, "noise_ratio": 1.0777}),
        row(3, compare={"multiview_seconds": 6.0, "noise_ratio": None}),
    ]
    lines = format_animation({"totals": totals(rows), "frames": rows}).splitlines()
    assert [line.split()[0] for line in lines] == ["frames", "per", "traced", "speed-up", "noise"]
    assert "2.00 s, 0.50 s not for rendering" in lines[1]
    assert "10.0 % of the target eye" in lines[2]
    assert "3.00 x over Blender's multiview, measured" in lines[3]
    assert "1.078 in the worst of 3 compared frames" in lines[4]
    assert "noise" not in format_animation({"totals": totals([row()]), "frames": [row()]})


def test_the_table_of_many_views_tells_how_many_were_rendered_and_the_worst_of_all():
    rows = [
        row(1, views=48, rendered_views=3, honest_ratio=1.031),
        row(2, views=48, rendered_views=5, honest_ratio=1.052),
        row(3, views=48, rendered_views=4, honest_ratio=None),
    ]
    lines = format_animation({"totals": totals(rows), "frames": rows}).splitlines()
    assert "10.0 % of all pixels of 48 views" in lines[2]
    assert "2.50 x over 48 plain renders, predicted" in lines[3]
    assert lines[4] == "rendered      3 to 5 of 48 views of a frame"
    assert lines[5] == "estimate      honest ratio 1.052 in the worst view of all, in frame 2"
    assert len(lines) == 6
    rows = [row(1, views=4, rendered_views=4, honest_ratio=None)]
    lines = format_animation({"totals": totals(rows), "frames": rows}).splitlines()
    assert lines[4:] == ["rendered      4 of 4 views of a frame"]


def test_the_table_of_one_view_holds_it_against_plain_renders():
    rows = [row(1, views=1), row(2, views=1, compare={"multiview_seconds": 6.0, "noise_ratio": 1.0})]
    compare = {"honest_ratio": 1.04, "flicker": 0.5}
    lines = format_animation({"totals": totals(rows), "frames": rows, "compare": compare}).splitlines()
    assert "10.0 % of all pixels, those of rendered frames among them" in lines[2]
    assert "x over plain renders, measured" in lines[3]
    assert lines[4:6] == ["honest ratio  1.040, of the worst frame compared", "flicker       0.500, of plain renders'"]
    assert not any("eye" in line or "views" in line for line in lines)


def test_it_says_that_the_multiview_of_compared_frames_was_synced_anew():
    multiview = {"multiview_seconds": 6.0, "noise_ratio": 1.0}
    for compared, synced, said in (
        ([{**multiview, "synced_anew": True}, None], "anew", True),
        ([{**multiview, "synced_anew": False}, None], None, False),
        ([None, None], None, False),
    ):
        rows = [row(frame, compare=compare) for frame, compare in enumerate(compared)]
        whole = totals(rows)
        assert whole["multiview_synced"] == synced
        text = format_animation({"totals": whole, "frames": rows})
        assert ("measured; it synced the scene anew for each compared frame" in text) is said


@pytest.mark.parametrize(
    ("name", "file"), [("", "animation.json"), ("shot_", "shot_animation.json"), ("shot", "shot_animation.json")]
)
def test_it_lies_beside_the_frames_and_is_called_as_they_are(tmp_path, name, file):
    assert report_path(Journal(tmp_path, name)) == tmp_path / file


WANTED = Fingerprints("s", {"meshes": "cube"})


def recorded(journal, frame, *, settings="s", **figures):
    facts = {name: value for name, value in row(**figures).items() if name != "frame"}
    files = {f"{frame:04d}.png": {"bytes": 1, "sha256": "0"}}
    journal.records.write(Record(frame, files, settings=settings, scene=WANTED.scene, run="r", figures=facts))


def test_it_has_every_frame_of_the_journal_whichever_run_has_rendered_it(tmp_path):
    journal = Journal(tmp_path)
    journal.place.make()
    recorded(journal, 7, warnings=["fireflies"])
    recorded(journal, 2)
    recorded(journal, 10007, warnings=["fireflies", "black"])
    options = AnimationSettings(frames=(7, 8))
    report = write_animation_report(journal, WANTED, options, {8: "no memory"}, ["the scene denoises"])
    assert [line["frame"] for line in report["frames"]] == [2, 7, 10007]
    assert report["frames"][1]["files"] == ["0007.png"]
    assert report["asked_for"] == [7, 8]
    assert report["failed"] == {"8": "no memory"}
    assert report["warnings"] == ["the scene denoises", "fireflies", "black"]
    assert report["totals"]["frames"] == 3
    assert json.loads((tmp_path / "animation.json").read_text(encoding="utf-8")) == report


def test_another_animation_in_the_same_folder_is_left_out(tmp_path):
    for name, frame in (("a_", 1), ("b_", 2)):
        journal = Journal(tmp_path, name)
        journal.place.make()
        recorded(journal, frame)
    report = write_animation_report(Journal(tmp_path, "a_"), WANTED, AnimationSettings(), {}, [])
    assert [line["frame"] for line in report["frames"]] == [1]


def test_frames_of_other_settings_count_for_nothing(tmp_path):
    journal = Journal(tmp_path)
    journal.place.make()
    recorded(journal, 1)
    recorded(journal, 2, settings="others")
    report = write_animation_report(journal, WANTED, AnimationSettings(), {}, [])
    assert [line["frame"] for line in report["frames"]] == [1]


ODD = {
    "wall_seconds": ["2", None, True, 0.0, -1.0, math.nan, math.inf, 10**400, [2.0]],
    "beside_seconds": ["0.5", None, {}, 10**400],
    "multiview_seconds": ["5", None, -5.0, math.inf],
    "fractions": [None, 3, [], {}, {"rerendered": "all"}, {"rerendered": 2.0}, {"rerendered": None}],
    "seconds": [3, [], {"source": "long"}, {"source": math.nan}],
    "compare": [
        7,
        [],
        {"multiview_seconds": "5"},
        {"multiview_seconds": 5.0, "noise_ratio": "1"},
        {"multiview_seconds": 5.0},
        {},
    ],
    "warnings": [5, "warning", [5], {"a": "b"}],
    "size": [640, [640], ["640", "360"], [0, 1]],
    "samples": ["many", -1, 1.5],
    "accuracy": ["superb", ["high"], 5],
    "layers": [5, {}],
    "estimate": ["1.0", [1.0]],
    "others": [10**400, math.nan],
}
REQUIRED = ("wall_seconds", "beside_seconds", "multiview_seconds", "fractions")


def deep(levels):
    value = []
    for _ in range(levels):
        value = [value]
    return value


@pytest.mark.parametrize("name", ODD)
def test_figures_of_odd_kinds_are_named_and_the_rest_is_told(tmp_path, name):
    journal = Journal(tmp_path)
    journal.place.make()
    for number, value in enumerate([*ODD[name], deep(600)], 2):
        recorded(journal, number)
        path = tmp_path / JOURNAL / f"{number:04d}.json"
        fields = json.loads(path.read_text())
        path.write_text(json.dumps({**fields, "figures": {**fields["figures"], name: value}}))
    recorded(journal, 1)
    report = write_animation_report(journal, WANTED, AnimationSettings(frames=(1, 2)), {}, [])
    odd = range(2, len(ODD[name]) + 3)
    assert [line["frame"] for line in report["frames"]] == ([1] if name in REQUIRED else [1, *odd])
    for frame, line in zip(odd, report["warnings"], strict=True):
        assert f"frame {frame} " in line
        assert f"({name})" in line
    assert all(name not in line or line["frame"] == 1 or line[name] == [] for line in report["frames"])
    assert "per frame     2.00 s" in format_animation(report)


@pytest.mark.parametrize("name", ODD)
def test_a_frame_that_another_run_has_recorded_oddly_is_done_all_the_same(name):
    for value in (*ODD[name], deep(600)):
        events, warnings = [], []
        told = Listener(on_frame=events.append, warn=warnings.append)
        figures = {**row(warnings=["fireflies"]), name: value}
        record = Record(1, {"0001.png": {"bytes": 1, "sha256": "0"}}, "s", {}, "r", figures)
        AnimationProgress(FramePlan({1: None}, {}, {}), 1, told, {}).frame_listener.done(1, record)
        (event,) = events
        assert event["seconds"] == (None if name == "wall_seconds" else 2.0)
        assert event["traced"] == (None if name == "fractions" else 0.1)
        assert (event["saved"] is None) == (name in ("wall_seconds", "multiview_seconds"))
        assert warnings == ([] if name == "warnings" else ["fireflies"])


def test_figures_as_runs_make_them_are_all_usable():
    figures = row(
        compare={"multiview_seconds": 5.0, "noise_ratio": None, "no_noise": "sky alone"}, size=[640, 360], samples=32,
        accuracy="balanced", seconds={"source": 1.0, "total": 2.0}, estimate=None, correction={"mean": 0.1, "p95": 0.2},
        layers=[{"name": "ViewLayer", "rerendered": 0.1}], memory={"peak_mb": None}, write_seconds=0.1,
        fill={"method": "packed", "reason": "few"}, warp={"asked": "auto", "used": "numpy", "gpu": None},
    )  # fmt: skip
    record = Record(1, {"0001.png": {"bytes": 1, "sha256": "0"}}, "s", {}, "r", figures)
    assert figures_of(record) == (figures, [])


def test_a_record_that_cannot_be_read_and_one_too_many_are_named(tmp_path):
    journal = Journal(tmp_path)
    journal.place.make()
    recorded(journal, 1)
    (tmp_path / JOURNAL / "0002.json").write_text("{")
    (tmp_path / JOURNAL / "00001.json").write_bytes((tmp_path / JOURNAL / "0001.json").read_bytes())
    report = write_animation_report(journal, WANTED, AnimationSettings(), {}, [])
    assert [line["frame"] for line in report["frames"]] == [1]
    assert len(report["warnings"]) == 2
    assert "00001.json is passed over" in report["warnings"][0]
    assert "0002.json is no record that can be read (it is not whole)" in report["warnings"][1]


def test_a_frame_beyond_all_that_blender_has_makes_no_chart_of_a_million_gaps(tmp_path):
    journal = Journal(tmp_path)
    journal.place.make()
    recorded(journal, 1)
    recorded(journal, 999_999_999)
    report = write_animation_report(journal, WANTED, AnimationSettings(), {}, [])
    assert [line["frame"] for line in report["frames"]] == [1]


def test_what_a_kill_leaves_of_a_chart_lies_in_the_journal_and_is_cleared_away(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    journal = Journal(tmp_path)
    journal.place.make()
    recorded(journal, 1)
    unlink = Path.unlink

    def killed(path, missing_ok=False):
        if path.suffix != ".tmp":
            unlink(path, missing_ok)

    replace = Path.replace
    monkeypatch.setattr(Path, "unlink", killed)
    monkeypatch.setattr(Path, "replace", lambda path, to: replace(path, to) if to.suffix == ".json" else path.missing)
    with pytest.raises(AttributeError):
        write_animation_report(journal, WANTED, AnimationSettings(), {}, [])
    monkeypatch.undo()
    assert sorted(path.name for path in tmp_path.iterdir()) == [JOURNAL, "animation.json"]
    assert any(path.name.startswith(".animation.svg.") for path in journal.folder.iterdir())
    journal.runs.clear("0123456789abcdef")
    assert [path.name for path in journal.folder.iterdir()] == ["0001.json"]
