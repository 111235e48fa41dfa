"""The table of a report on many views."""

import copy
import json

import pytest

from stereo_reproject.report.views_table import format_views_table


def made(name, traced, ratio, interval, sources):
    return {"name": name, "how": "made", "from": sources, "traced": traced, "honest_ratio": ratio, "interval": interval}


def rendered(name):
    return {"name": name, "how": "rendered", "from": [], "traced": 1.0, "honest_ratio": None, "interval": None}


@pytest.fixture
def report():
    return {
        "scene": "room",
        "frame": 7,
        "size": [420, 560],
        "samples": 32,
        "accuracy": "balanced",
        "views": [
            rendered("view_00"),
            made("view_01", 0.1, 1.02, [1.0, 1.04], ["view_00", "view_03"]),
            made("view_02", 0.2, 1.085, [1.05, 1.12], ["view_00", "view_03"]),
            rendered("view_03"),
        ],
        "plan": ["render view_00: the leftmost", "render view_03: the rightmost"],
        "seconds": {"write": 1.5, "source": 20.25, "total": 40.5},
        "predicted_speedup": 3.5,
        "warnings": [],
    }


def test_it_says_what_was_made_and_how_good_the_worst_is(report):
    lines = format_views_table(report).splitlines()
    assert lines[0] == "room, frame 7, 4 views of 420x560, 32 samples, balanced"
    assert lines[2] == "  source             20.25"
    assert lines[4].startswith("  total              40.50")
    assert lines[5:7] == ["plan          render view_00: the leftmost", "              render view_03: the rightmost"]
    assert lines[7:11] == [
        "views         2 rendered, 2 made from others",
        "  rendered    view_00, view_03",
        "  traced      15.0 % of a made view's pixels in the mean, from 10.0 % (view_01) to 20.0 % (view_02)",
        "estimate      honest ratio 1.085 (1.050 to 1.120) in the worst view, view_02, made from view_00 and view_03",
    ]
    assert lines[11] == "gained        about 3.50 x over 4 plain renders, predicted (--compare measures it)"
    assert len(lines) == 12


def test_what_was_measured_stands_in_the_place_of_what_was_predicted(report):
    report["compare"] = {"speedup": 3.25, "honest_ratio": 1.043, "views": ["view_00", "view_02", "view_03"]}
    lines = format_views_table(report).splitlines()
    assert lines[11:] == [
        "gained        3.25 x over 4 plain renders, measured",
        "  honest ratio 1.043    1 = as good as rendering it again",
        "  compared     view_00, view_02, view_03",
    ]


def test_flicker_of_denoised_views(report):
    report["compare"] = {"speedup": 3.25, "honest_ratio": 1.043, "flicker_ratio": 0.512}
    assert format_views_table(report).splitlines()[-1] == (
        "  flicker      0.51 x that of plain renders, between neighbouring views"
    )


def test_noise_of_neighbours_and_what_was_traced_anew(report):
    names = ["view_01", "view_02", "view_03"]
    report["neighbours"] = {"count": 3, "noise_ratio": 1.146, "worst_noise_ratio": 1.332, "worst_views": names}
    noise = "noise of the mean of 3 neighbouring views: 1.15 x that of plain ones, 1.33 x in the worst"
    assert format_views_table(report).splitlines()[11] == f"neighbours    {noise}, view_01 to view_03"
    report["fresh"] = {"share": 0.25, "seconds": 12.04, "predicted_seconds": 10.0, "noise_ratio_without": 1.3}
    told = "25 % of a made view traced anew: 12.0 s, predicted 10.0 s; without it 1.30 x"
    assert format_views_table(report).splitlines()[12] == f"  fresh       {told}"
    report["neighbours"] = report["fresh"]["noise_ratio_without"] = None
    assert format_views_table(report).splitlines()[11].endswith("predicted 10.0 s")


def test_views_without_an_estimate_are_counted(report):
    report["views"][1]["honest_ratio"] = None
    assert "made from view_00 and view_03; 1 without an estimate" in format_views_table(report)
    report["views"][2]["honest_ratio"] = None
    assert "\nestimate      none\n" in format_views_table(report)


def test_views_that_were_all_rendered(report):
    report["views"] = [rendered("view_00"), rendered("view_01")]
    text = format_views_table(report)
    assert "views         2 rendered, 0 made from others" in text
    assert "estimate" not in text
    assert "traced" not in text


def test_what_a_report_lacks_is_left_out(report):
    least = {name: report[name] for name in ("views", "seconds")}
    lines = format_views_table(least).splitlines()
    assert lines[0] == "4 views"
    assert "gained" not in lines[-1]


def test_the_report_is_read_as_json_has_it_and_left_as_it_is(report):
    before = copy.deepcopy(report)
    assert format_views_table(json.loads(json.dumps(report))) == format_views_table(report)
    assert report == before
