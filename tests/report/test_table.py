"""The table of a report, and how JSON is written."""

import copy
import json
import math

import numpy as np
import pytest

from stereo_reproject.files import write_json
from stereo_reproject.report.table import format_report_table

COMPARE = {
    "multiview_seconds": 20.0,
    "speedup": 1.786,
    "rmse": 0.021,
    "noise_rmse": 0.0209,
    "noise_ratio": 1.005,
    "bias": 0.6,
    "honest_ratio": 1.0863,
    "worst_tiles": 1.12,
    "wrong_tiles": 0.0125,
    "flip": 0.0312,
    "noise_flip": 0.0309,
    "flip_ratio": 1.0097,
}


@pytest.fixture
def report():
    return {
        "schema": 1,
        "scene": "room.blend",
        "frame": 7,
        "size": [960, 540],
        "samples": 64,
        "blender": "5.2.3",
        "accuracy": "balanced",
        "fill": {"method": "packed", "reason": "6 % of the pixels are holes"},
        "grid": {"cells": 2040, "subdivided": 210, "triangles": 30000},
        "fractions": {"disoccluded": 0.03, "outside": 0.0, "silhouette": 0.0456, "invalid": 0.0, "rerendered": 0.0712},
        "seconds": {
            "load": 1.25,
            "source": 10.0,
            "warp": 0.125,
            "fill": 1.0,
            "composite": 0.1,
            "write": 0.5,
            "total": 11.2,
        },
        "memory": {"peak_mb": 812.4},
    }


def change(report, key, value):
    """A copy of the report with the value at the dotted key replaced, or taken out where value is `...`."""
    changed = copy.deepcopy(report)
    *path, last = key.split(".")
    place = changed
    for name in path:
        place = place[name]
    if value is ...:
        del place[last]
    else:
        place[last] = value
    return changed


def test_json_is_strict(tmp_path):
    values = {
        "nan": math.nan,
        "deep": [{"inf": np.float32(np.inf)}, (-math.inf, np.float64(0.5), np.int32(3), np.bool_(True))],
        "text": "Küche \udcff",
    }
    write_json(tmp_path / "report.json", values)

    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    text = (tmp_path / "report.json").read_text(encoding="utf-8")
    assert json.loads(text, parse_constant=refuse) == {
        "nan": None,
        "deep": [{"inf": None}, [None, 0.5, 3, True]],
        "text": "Küche \udcff",
    }


def test_failed_write_leaves_the_old_file_alone(tmp_path):
    path = tmp_path / "report.json"
    write_json(path, {"a": 1})
    with pytest.raises(TypeError, match="object"):
        write_json(path, {"a": object()})
    assert json.loads(path.read_text(encoding="utf-8")) == {"a": 1}
    assert list(tmp_path.iterdir()) == [path]


def test_a_rename_that_fails_leaves_nothing_beside(tmp_path):
    (tmp_path / "report.json").mkdir()
    with pytest.raises(OSError, match=r"report\.json"):
        write_json(tmp_path / "report.json", {"a": 1})
    assert [path.name for path in tmp_path.iterdir()] == ["report.json"]


def test_table_of_a_measured_run(report):
    table = format_report_table({**report, "compare": COMPARE, "predicted_speedup": 9.9})
    assert table.splitlines() == [
        "room.blend, frame 7, 960x540, 64 samples, balanced",
        "took              seconds",
        "  load                1.25   not in the total",
        "  source             10.00",
        "  warp                0.12",
        "  fill                1.00",
        "  composite           0.10",
        "  write               0.50   not in the total",
        "  total              11.20   from the look at the scene to the finished pair",
        "traced        of the target eye's pixels (one pixel may have several reasons)",
        "  disoccluded       3.00 %",
        "  silhouette        4.56 %",
        "  rerendered        7.12 %",
        "fill          packed: 6 % of the pixels are holes",
        "gained        1.79 x over Blender's multiview (20.00 s), measured",
        "  honest ratio 1.086    1 = as good as rendering it again",
        "  noise ratio  1.005    bias 0.600 of a render's noise",
        "  worst tiles  1.120    1.2 % of all tiles are wrong",
        "  FLIP         0.0312   of noise alone 0.0309: 1.010 times that",
        "memory        812 MB at its peak",
    ]


def test_table_calls_a_prediction_predicted(report):
    table = format_report_table({**report, "predicted_speedup": 1.76})
    assert "about 1.76 x over Blender's multiview, predicted" in table
    assert "measured" not in table


def test_table_claims_no_gain_without_figures(report):
    assert "gained" not in format_report_table(report)


def test_table_shows_what_has_no_value(report):
    table = format_report_table({**report, "compare": {**COMPARE, "noise_ratio": None, "flip": math.nan}})
    assert "noise ratio  n/a" in table
    assert "FLIP         n/a" in table


def test_table_says_why_there_is_no_ratio_to_noise(report):
    compare = {**COMPARE, "noise_ratio": None, "worst_tiles": None, "no_noise": "two renders are the same"}
    lines = format_report_table({**report, "compare": compare}).splitlines()
    assert "  honest ratio n/a      two renders are the same" in lines
    assert "  error        0.021    root mean square, tone-mapped" in lines
    assert not [line for line in lines if "worst tiles" in line]


def test_table_keeps_further_stages(report):
    assert "  refine              2.00\n" in format_report_table(change(report, "seconds.refine", 2.0))


ESTIMATE = {
    "noise_ratio": 1.0123,
    "low": 0.98,
    "high": 1.04,
    "excess": 0.0247,
    "bias": 0.156,
    "honest_ratio": 1.0061,
    "honest_low": 0.975,
    "honest_high": 1.036,
    "promise": 1.02,
    "worst_tiles": 1.15,
    "worst_tiles_promise": 1.2,
    "wrong_tiles": 0.004,
    "kept": True,
    "from": "probes",
}
PRICE = {"accuracy": "full", "seconds": 21.0, "more_seconds": 9.8, "traced": 1.0, "complete": True}
EFFECTS = [
    {"effect": "glossy", "called_for": True, "handling": "probed", "fraction": 0.0312, "seconds": 1.5, "excess": 0.01},
    {"effect": "hair", "called_for": False, "handling": "nothing", "fraction": 0.0, "seconds": 0.0, "excess": None},
]


def test_table_says_whether_the_promise_is_kept_and_what_more_would_cost(report):
    report.update(estimate=ESTIMATE, price=PRICE, effects=EFFECTS)
    table = format_report_table(report)
    assert "honest ratio 1.006 (0.975 to 1.036), from probes; at most 1.02 promised: kept" in table
    assert "bias 0.16 of a render's noise, noise ratio 1.012 (0.980 to 1.040)\n" in table
    assert "worst tiles 1.15, 0.4 % of all are wrong, see estimate.png; at most 1.2 promised: kept" in table
    assert "full: 9.8 s more, 100.0 % traced, predicted" in table
    assert "glossy                3.12 %    1.50 s" in table
    assert "hair" not in table
    report["estimate"] = {**ESTIMATE, "kept": False, "worst_tiles": 1.25}
    report["price"] = {**PRICE, "complete": False}
    table = format_report_table(report)
    assert "at most 1.02 promised: kept" in table
    assert "worst tiles 1.25, 0.4 % of all are wrong, see estimate.png; at most 1.2 promised: not kept" in table
    assert "full: at least 9.8 s more" in table
    report["estimate"] = {
        **ESTIMATE,
        "honest_ratio": 1.03,
        "kept": False,
        "worst_tiles": 1.0,
        "worst_tiles_promise": None,
    }
    table = format_report_table(report)
    assert "at most 1.02 promised: not kept" in table
    assert "worst tiles" not in table


def test_table_of_a_report_before_the_honest_ratio_has_the_noise_ratio(report):
    named = {"bias", "honest_ratio", "honest_low", "honest_high", "wrong_tiles", "flip_ratio"}
    older, compared = ({name: part[name] for name in part if name not in named} for part in (ESTIMATE, COMPARE))
    table = format_report_table({**report, "estimate": older, "compare": compared})
    assert "estimate      noise ratio 1.012 (0.980 to 1.040), from probes; at most 1.02 promised: kept" in table
    assert "noise ratio  1.005    bias n/a" in table


@pytest.mark.parametrize(
    ("price", "words"),
    [
        ({"more_seconds": 0.05}, "price         full: 0.1 s more, 100.0 % traced, predicted"),
        ({"more_seconds": 0.049}, "price         full: less than 0.1 s more, 100.0 % traced, predicted"),
        (
            {"accuracy": "high", "more_seconds": 0.0, "traced": 0.08, "complete": False},
            "price         high: less than 0.1 s more, but for what its probes ask for, 8.0 % traced, predicted",
        ),
        ({"more_seconds": None}, "price         nothing better can be had: the target was rendered whole"),
    ],
)
def test_the_price_is_told_where_it_is_next_to_nothing_and_where_there_is_none(report, price, words):
    report["price"] = {**PRICE, **price}
    assert words in format_report_table(report).splitlines()


def test_table_says_why_there_is_no_estimate(report):
    unknown = dict.fromkeys(name for name in ESTIMATE if name != "promise")
    report["estimate"] = {**unknown, "promise": 1.1, "from": "nothing looks different"}
    assert "estimate      none: nothing looks different" in format_report_table(report)


LAYERS = [
    {"name": "Beauty", "rerendered": 0.25, "fill": "packed", "noise_ratio": 1.125, "seconds": 8.0},
    {"name": "Front", "rerendered": 0.0, "fill": "packed", "noise_ratio": None, "seconds": 3.25},
]


def test_the_view_layers_have_a_line_each(report):
    told = {**report, "layers": LAYERS}
    lines = format_report_table(told).splitlines()
    (beauty,) = [line for line in lines if line.startswith("  Beauty ")]
    (front,) = [line for line in lines if line.startswith("  Front ")]
    assert ("25.00 %" in beauty, "8.00 s" in beauty, "noise ratio 1.125" in beauty) == (True, True, True)
    assert ("3.25 s" in front, "noise ratio" in front) == (True, False)
    assert "view layers" not in format_report_table(report)


@pytest.mark.parametrize(
    ("rendered", "words"), [(37, "37 of 64 samples in 2.5 s"), (None, "an unknown number of 64 samples in 2.5 s")]
)
def test_table_says_what_a_time_limit_left(report, rendered, words):
    limited = {**report, "time_limit": 2.5, "samples_rendered": rendered}
    assert words in format_report_table(limited).splitlines()[0]


def cutout(name, left, up, **more):
    of_all = {"honest_ratio": 1.0123, "noise_ratio": 0.95, "flip": 0.02, "noise_flip": 0.01, "flip_ratio": 2.0}
    return {"name": name, "left_degrees": left, "up_degrees": up, "size": 326, **of_all, **more}


def test_the_cutouts_of_a_panorama_have_a_line_each(report):
    without = dict.fromkeys(("flip", "noise_flip", "flip_ratio"))
    cutouts = [cutout("front", 0.0, 0.0), cutout("right", -45.0, 0.0), cutout("up", 0.0, 90.0, **without)]
    lines = format_report_table({**report, "compare": {**COMPARE, "cutouts": cutouts}}).splitlines()
    found = [line.split() for line in lines if line.split()[:1] in (["front"], ["right"], ["up"])]
    assert found == [
        ["front", "1.012", "0.950", "2.000"],
        ["right", "45", "1.012", "0.950", "2.000"],
        ["up", "90", "1.012", "0.950", "n/a"],
    ]
    assert all(line.isascii() and line == line.rstrip() for line in lines)
    assert "headset" not in format_report_table({**report, "compare": COMPARE})
