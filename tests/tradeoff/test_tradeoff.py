"""The price list: which runs no other beats, the files that say so, and charts whose labels can be read."""

import csv
import itertools
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from stereo_reproject.errors import BadInputError
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.images.reflected_light import glossy_mask
from stereo_reproject.report.label_places import nearest, place_labels
from stereo_reproject.settings.frame import ACCURACIES, SceneOverrides, StereoSettings
from stereo_reproject.tradeoff.cases import (
    MULTIVIEW,
    NOISE_RATIO_STEP,
    Row,
    format_price_table,
    pareto_front,
    price_list,
    split_probes,
    tradeoff_cases,
    write_csv,
)

ROOT = Path(__file__).resolve().parents[2]
PNG_START = b"\x89PNG\r\n\x1a\n"
SVG = "{http://www.w3.org/2000/svg}"
CLEAR = 1.0
"""Pixels by which two labels stay apart at least: they are placed with a margin of two each."""


def estimate(ratio):
    honest = {"honest_ratio": 1.1 * ratio, "honest_low": 1.1 * ratio - 0.02, "honest_high": 1.1 * ratio + 0.02}
    return {"noise_ratio": ratio, "low": ratio - 0.02, "high": ratio + 0.02, **honest, "promise": 1.1}


def row(name, kind="setting", *, total, ratio, probes=0, traced=0.1):
    seconds = split_probes({"source": 10.0, "warp": 0.2, "fill": total - 10.2}, 9000, probes)
    return Row(
        name=name,
        kind=kind,
        accuracy=name if kind == "setting" else None,
        seconds=seconds,
        speedup=20.0 / total,
        rmse=0.01 * ratio,
        noise_ratio=ratio,
        bias=0.1,
        honest_ratio=1.1 * ratio,
        worst_tiles=2.0 * ratio,
        wrong_tiles=0.01,
        traced=traced,
        fill="packed",
        fractions={"disoccluded": 0.03},
        estimate=estimate(ratio) if probes else None,
    )


ROWS = (
    row("draft", total=11.5, ratio=2.05),
    row("preview", total=12.8, ratio=1.22, probes=800),
    row("balanced", total=13.7, ratio=1.08, probes=2000),
    row("high", total=15.1, ratio=1.03, probes=2000),
    row("exact", total=16.9, ratio=0.99, probes=2000),
    row("holes alone", "paper", total=11.2, ratio=2.4),
    row("heuristic mask", "heuristic", total=15.3, ratio=1.45, traced=0.42),
    row("card", "card", total=16.3, ratio=1.09, probes=400),
    row("full", "full", total=19.9, ratio=1.002, traced=1.0),
)
CROWDED = tuple(
    row(r.name, r.kind, total=12.0 + 0.02 * k, ratio=0.95 + 0.003 * (k % 4), traced=r.traced)
    for k, r in enumerate(ROWS)
)
FACTS = {
    "scene": "bathroom",
    "frame": 1,
    "size": [480, 270],
    "samples": 32,
    "blender": "5.2.3",
    "source": {"seconds": 10.0, "sync_seconds": 2.0},
}
MEASURED = {"seconds": 20.0, "noise_rmse": 0.01}


def prices(rows=ROWS, left_out=()):
    return price_list(FACTS, MEASURED, rows, left_out)


# Which runs there are


def test_every_setting_and_every_other_way_is_a_run():
    names = [run.name for run in tradeoff_cases()]
    assert names == [*ACCURACIES, "holes alone", "heuristic mask", "card", "full"]
    assert len({run.kind for run in tradeoff_cases()}) == 5


def test_holes_alone_trace_no_silhouette_and_promise_nothing():
    run = next(run for run in tradeoff_cases() if run.kind == "paper")
    assert (run.accuracy.silhouette_radius, run.accuracy.promise) == (0, None)


def test_a_run_keeps_what_was_asked_of_the_scene():
    asked = StereoSettings(source="right", compare=True, tolerance=1.3, scene=SceneOverrides(samples=3, seed=7))
    for run in tradeoff_cases():
        settings = run.settings(asked)
        assert (settings.source, settings.scene, settings.compare) == ("right", asked.scene, False)
        assert (settings.fill, settings.tolerance) == (run.fill, None)


# The Pareto front


def test_no_point_of_the_front_is_beaten_and_every_other_is():
    rng = np.random.default_rng(3)
    points = [tuple(point) for point in rng.uniform(1.0, 20.0, (60, 2))]
    front = [point for point, on_front in zip(points, pareto_front(points), strict=True) if on_front]
    for point in points:
        better = [(s, e) for s, e in front if s <= point[0] and e <= point[1] + NOISE_RATIO_STEP and (s, e) != point]
        assert bool(better) == (point not in front)


def test_error_falls_along_the_front_by_what_tells():
    rng = np.random.default_rng(4)
    points = [tuple(point) for point in rng.uniform(1.0, 1.1, (200, 2))]
    front = sorted(point for point, on_front in zip(points, pareto_front(points), strict=True) if on_front)
    assert len(front) > 3
    assert all(before[1] - after[1] > NOISE_RATIO_STEP for before, after in itertools.pairwise(front))


def test_the_fastest_is_on_the_front_and_an_unknown_error_never_is():
    assert pareto_front([(1.0, 5.0), (2.0, float("inf")), (3.0, 5.0)]) == [True, False, False]
    assert pareto_front([(1.0, 1.0), (1.0, 1.0)]) == [True, True]
    assert pareto_front([]) == []


def test_the_peer_beats_what_is_slower_and_no_better():
    slow = row("full", "full", total=25.0, ratio=1.0)
    listed = prices([*ROWS, slow])
    assert not listed["rows"][-1]["pareto"]
    assert not listed["peer"]["pareto"], "exact is both faster and better"
    assert price_list(FACTS, MEASURED, [slow], [])["peer"]["pareto"]


# Stages


def test_probes_and_holes_share_the_seconds_of_the_fill():
    seconds = {"source": 5.0, "fill": 3.0, "composite": 0.1}
    split = split_probes(seconds, holes=1000, probes=250)
    assert split == pytest.approx({"source": 5.0, "fill": 2.0, "probes": 1.0, "composite": 0.1})
    assert list(split) == ["source", "fill", "probes", "composite"]
    assert split_probes(seconds, holes=1000, probes=0) == seconds


def test_a_pilot_is_a_stage_of_its_own():
    seconds = {"source": 5.0, "pilot": 1.0, "fill": 3.0}
    split = {"source": 5.0, "pilot": 1.0, "fill": 2.0, "probes": 1.0}
    assert split_probes(seconds, holes=1000, probes=250) == split


# Files


def test_json_holds_every_row_in_order():
    listed = json.loads(json.dumps(prices(left_out=[("card", "no card")]), allow_nan=False))
    assert [entry["name"] for entry in listed["rows"]] == [r.name for r in ROWS]
    balanced = listed["rows"][2]
    assert balanced["seconds"]["total"] == pytest.approx(13.7)
    assert balanced["seconds"]["total"] == pytest.approx(
        sum(value for name, value in balanced["seconds"].items() if name != "total")
    )
    assert balanced["excess"] == pytest.approx(1.08**2 - 1.0)
    assert listed["left_out"] == [{"name": "card", "reason": "no card"}]
    assert (listed["schema"], listed["scene"]) == (1, "bathroom")


def test_csv_holds_what_json_holds(tmp_path):
    listed = prices()
    write_csv(tmp_path / "t.csv", listed)
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    assert [line["name"] for line in lines] == [*(r.name for r in ROWS), MULTIVIEW]
    for line, entry in zip(lines, listed["rows"], strict=False):
        assert float(line["seconds"]) == entry["seconds"]["total"]
        assert float(line["fill_seconds"]) == entry["seconds"]["fill"]
        assert float(line["noise_ratio"]) == entry["noise_ratio"]
        assert float(line["honest_ratio"]) == entry["honest_ratio"] == 1.1 * entry["noise_ratio"]
        assert (float(line["bias"]), float(line["wrong_tiles"])) == (0.1, 0.01)
        assert line["pareto"] == str(entry["pareto"]).lower()
        assert line["estimate"] == ("" if entry["estimate"] is None else str(entry["estimate"]["noise_ratio"]))
        honest = "" if entry["estimate"] is None else str(entry["estimate"]["honest_ratio"])
        assert line["estimate_honest_ratio"] == honest
    assert (lines[-1]["seconds"], lines[-1]["noise_ratio"], lines[-1]["accuracy"]) == ("20.0", "1.0", "")


def test_what_is_not_known_is_left_empty_in_csv(tmp_path):
    whole = {"noise_ratio": 1.0, "low": float("nan"), "high": float("nan"), "promise": 1.1}
    write_csv(tmp_path / "t.csv", prices([replace(row("balanced", total=11.0, ratio=1.0), estimate=whole)]))
    line = next(csv.DictReader((tmp_path / "t.csv").read_text(encoding="utf-8").splitlines()))
    assert (line["estimate"], line["estimate_low"], line["estimate_high"]) == ("1.0", "", "")


def test_a_ratio_without_noise_is_null_and_shown_as_such():
    listed = prices([row("draft", total=11.0, ratio=float("inf"))])
    assert listed["rows"][0]["noise_ratio"] is None
    assert not listed["rows"][0]["pareto"]
    assert re.search(r"draft +11\.00 +1\.82 +n/a +n/a", format_price_table(listed))


def test_table_has_a_line_for_each_run_and_marks_the_front():
    lines = format_price_table(prices()).splitlines()
    assert lines[0] == "bathroom, frame 1, 480x270, 32 samples: error against time"
    shown = {line[2:18].strip(): line.startswith("*") for line in lines[2:-1]}
    assert shown == {**{entry["name"]: entry["pareto"] for entry in prices()["rows"]}, MULTIVIEW: False}


# The heuristic mask


def source(**changes):
    """Three pixels: almost dull, a mirror, glass. The names are Blender 4.5's."""
    colour = np.zeros((1, 3, 4), np.float32)
    colour[..., :3], colour[..., 3] = 1.0, 1.0
    passes = {COLOUR_PASS: colour}
    for name in ("GlossDir", "GlossInd", "GlossCol", "TransDir", "TransInd", "TransCol"):
        passes[name] = np.zeros((1, 3, 3), np.float32)
    passes["GlossCol"][:] = passes["TransCol"][:] = 0.5
    passes["GlossInd"][0, 0] = 0.1
    passes["GlossInd"][0, 1] = 1.8
    passes["TransDir"][0, 2] = 0.4
    return {**passes, **changes}


def test_glossy_and_transmitting_pixels_are_masked():
    assert glossy_mask(source()).tolist() == [[[0.0], [1.0], [1.0]]]


def test_names_of_either_blender_are_known():
    new = {
        "GlossDir": "Glossy Direct",
        "GlossInd": "Glossy Indirect",
        "GlossCol": "Glossy Color",
        "TransDir": "Transmission Direct",
        "TransInd": "Transmission Indirect",
        "TransCol": "Transmission Color",
    }
    renamed = {new.get(name, name): image for name, image in source().items()}
    np.testing.assert_array_equal(glossy_mask(renamed), glossy_mask(source()))


def test_partial_alpha_is_masked_and_an_empty_pixel_is_not():
    colour = np.ones((1, 3, 4), np.float32)
    colour[0, :, 3] = (0.5, 0.0, 1.0)
    dull = {name: np.zeros_like(image) for name, image in source().items() if name != COLOUR_PASS}
    assert glossy_mask({COLOUR_PASS: colour, **dull}).ravel().tolist() == [1.0, 0.0, 0.0]


# Places of labels


def test_labels_of_a_crowd_overlap_neither_each_other_nor_a_point():
    rng = np.random.default_rng(8)
    points = rng.normal((400.0, 300.0), 25.0, (10, 2))
    sizes = np.tile((120.0, 16.0), (10, 1))
    obstacles = np.concatenate([points - 6.0, points + 6.0], axis=1)
    corners = place_labels(points, sizes, obstacles=obstacles, lines=np.zeros((0, 4)), frame=(0, 0, 800, 600))
    boxes = np.concatenate([corners, corners + sizes], axis=1)
    for a, b in itertools.combinations(boxes, 2):
        assert apart(a, b) >= CLEAR
    for a, b in itertools.product(boxes, obstacles):
        assert apart(a, b) >= 0.0
    assert (corners >= 0.0).all()
    assert (corners + sizes <= (800.0, 600.0)).all()


def test_a_label_on_its_own_is_beside_its_point():
    point, size = np.array([[100.0, 100.0]]), np.array([[50.0, 10.0]])
    corner = place_labels(point, size, obstacles=np.zeros((0, 4)), lines=np.zeros((0, 4)), frame=(0, 0, 200, 200))
    assert np.hypot(*(nearest(point, corner, size) - point)[0]) == pytest.approx(7.0)


def apart(a, b):
    """Distance of two boxes (left, bottom, right, top) along the axis that parts them; negative: they overlap."""
    return max(a[0] - b[2], b[0] - a[2], a[1] - b[3], b[1] - a[3])


# Charts


@pytest.fixture
def charts():
    pytest.importorskip("matplotlib")
    from stereo_reproject.tradeoff import charts

    return charts


@pytest.mark.parametrize("rows", [ROWS, CROWDED, ROWS[:1]], ids=["usual", "crowded", "one"])
def test_labels_of_the_chart_do_not_overlap(charts, rows):
    listed = prices(rows)
    from stereo_reproject.tradeoff.chart import extent

    figure = charts.draw_tradeoff(listed)
    figure.draw_without_rendering()
    texts = [text for axes in figure.axes for text in axes.texts if text.get_text()]
    assert len(texts) == len(rows) + 2, "each run, the peer and the noise floor"
    boxes = [extent(text) for text in texts]
    boxes = [(x, y, x + width, y + height) for x, y, width, height in boxes]
    for (a, b), (c, d) in itertools.combinations(zip(boxes, texts, strict=True), 2):
        assert apart(a, c) >= CLEAR, f"{b.get_text()} and {d.get_text()}"
    for left, bottom, right, top in boxes:
        assert left >= figure.axes[0].bbox.x0
        assert right <= figure.bbox.width
        assert bottom >= figure.axes[0].bbox.y0
        assert top <= figure.axes[0].bbox.y1


def test_files_are_whole_and_texts_are_texts(charts, tmp_path):
    charts.draw_charts(prices(), tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "stages.png",
        "stages.svg",
        "tradeoff.png",
        "tradeoff.svg",
    ]
    for name in ("tradeoff", "stages"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(PNG_START)
    tradeoff, stages = (texts_of(tmp_path / f"{name}.svg") for name in ("tradeoff", "stages"))
    for entry in ROWS:
        assert any(text.startswith(f"{entry.name} · ") for text in tradeoff), entry.name
        assert entry.name in stages
    for word in ("Blender's multiview", "Pareto front", "noise floor: a second plain render", "bathroom: error"):
        assert any(text.startswith(word) for text in tradeoff), word
    assert {"source", "warp", "fill", "probes", "13.70 s", "20.00 s", "1.46 ×"} <= set(stages)


def test_a_name_with_dollar_signs_is_no_formula(charts, tmp_path):
    charts.draw_charts({**prices(), "scene": "price_$5_$10"}, tmp_path)
    assert any(text.startswith("price_$5_$10: ") for text in texts_of(tmp_path / "tradeoff.svg"))


def texts_of(path):
    return ["".join(element.itertext()).strip() for element in ET.parse(path).iter(f"{SVG}text")]


def test_the_same_figures_make_the_same_files(charts, tmp_path):
    for name in ("once", "again"):
        (tmp_path / name).mkdir()
        charts.draw_charts(prices(), tmp_path / name)
    for path in (tmp_path / "once").iterdir():
        assert path.read_bytes() == (tmp_path / "again" / path.name).read_bytes()


def test_drawing_leaves_matplotlib_as_it_was(charts, tmp_path):
    """In an interpreter of its own: whoever runs the tests may have loaded pyplot."""
    (tmp_path / "prices.json").write_text(json.dumps(prices()), encoding="utf-8")
    program = f"""
import json, pathlib, sys
sys.path.insert(0, {str(ROOT)!r})
import matplotlib as mpl
from stereo_reproject.tradeoff.charts import draw_charts
folder = pathlib.Path({str(tmp_path)!r})
def kept():
    # Whoever asks for the backend has pyplot choose one.
    return {{name: mpl.rcParams[name] for name in mpl.rcParams if name != "backend"}}
before = kept()
draw_charts(json.loads((folder / "prices.json").read_text(encoding="utf-8")), folder)
print(kept() == before, "matplotlib.pyplot" in sys.modules)
"""
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert result.stdout.split() == ["True", "False"], result.stderr


def test_bars_end_where_the_seconds_do(charts):
    figure = charts.draw_stages(prices())
    axes = figure.axes[0]
    ends = [0.0] * (len(ROWS) + 1)
    for bar in axes.patches:
        place = round(bar.get_y() + 0.5 * bar.get_height())
        ends[place] = max(ends[place], bar.get_x() + bar.get_width())
    assert ends == pytest.approx([*(entry.total for entry in ROWS), MEASURED["seconds"]])


def test_a_great_span_of_errors_is_drawn_on_a_logarithmic_axis(charts):
    far = [*ROWS, row("draft", total=11.0, ratio=12.0)]
    assert charts.draw_tradeoff(prices(far)).axes[0].get_yscale() == "log"
    assert charts.draw_tradeoff(prices()).axes[0].get_yscale() == "linear"


def test_what_has_no_noise_ratio_is_named_below_the_chart(charts):
    rows = [row("draft", total=11.0, ratio=float("inf")), *ROWS[1:]]
    figure = charts.draw_tradeoff(prices(rows, left_out=[("card", "Grease Pencil")]))
    notes = " ".join(text.get_text().replace("\n", " ") for text in figure.texts)
    assert "Not shown: draft; card (Grease Pencil)." in notes


def test_without_matplotlib_one_line_says_what_to_install(monkeypatch):
    from stereo_reproject.report.chart_canvas import check_charts

    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.delitem(sys.modules, "matplotlib.figure", raising=False)
    with pytest.raises(BadInputError, match="pip install matplotlib"):
        check_charts()
