"""The chart of an animation: it shows what the report says, leaves gaps where it says nothing, and can be read."""

import itertools
import os
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from stereo_reproject.files import whole_file, write_json
from stereo_reproject.report.label_places import spread
from stereo_reproject.sequence.report import totals
from stereo_reproject.sequence.series import PLAIN, REFERENCE, REST, series_of

pytest.importorskip("matplotlib")

from stereo_reproject.sequence.chart import MAX_MARKERS, OURS, draw_animation, draw_animation_chart

PNG_START = b"\x89PNG\r\n\x1a\n"
SVG = "{http://www.w3.org/2000/svg}"
SVG_BYTES = 1 << 20
"""What is more, browsers and editors are slow with."""
ROUNDING = 1e-9


def row(frame, **changes):
    """A frame whose figures are its own: none of them is another frame's."""
    own = 0.01 * (frame % 97)
    seconds = {
        "source": 4.0 + own,
        "denoise_source": 0.2,
        "warp": 0.03,
        "pilot": 0.1,
        "fill": 0.5 + own,
        "refine": 0.2,
        "composite": 0.01,
        "denoise_target": 0.15,
        "account": 0.02,
    }
    return {
        "frame": frame,
        "size": [480, 270],
        "samples": 32,
        "accuracy": "balanced",
        "seconds": {**seconds, "total": sum(seconds.values()) - 0.02},
        "fractions": {"disoccluded": 0.03, "rerendered": 0.06 + own / 10.0},
        "wall_seconds": 5.4 + 2.0 * own,
        "beside_seconds": 0.25,
        "multiview_seconds": 8.4 + 2.0 * own,
        "warnings": [],
        **changes,
    }


def compared(frame, **changes):
    own = 8.5 + 0.02 * (frame % 97)
    return row(frame, compare={"multiview_seconds": own, "speedup": 1.5, "noise_ratio": None}, **changes)


def report(rows, asked_for=(), failed=None):
    return {"frames": rows, "asked_for": list(asked_for), "failed": failed or {}, "totals": totals(rows)}


def every(step, frames):
    return [compared(frame) if frame % step == 0 else row(frame) for frame in frames]


CASES = {
    "one": report([row(7)]),
    "one compared": report([compared(7)]),
    "two": report([row(-1), compared(0)]),
    "five": report([row(frame) for frame in range(-2, 3)]),
    "usual": report(every(6, range(1, 25))),
    "gaps": report(every(4, [*range(1, 9), 11, *range(14, 25)]), range(1, 31), {"12": "no camera"}),
    "thousands": report(every(25, range(1, 2001))),
    "predicted thousands": report([row(frame) for frame in range(1, 2001)]),
    "views": report([row(frame, views=48, rendered_views=3) for frame in range(1, 4)]),
    "huge": report([row(1, wall_seconds=4321.0, multiview_seconds=7654.0)]),
}


def of(axes, label):
    """The one artist of this name."""
    (found,) = (artist for artist in (*axes.patches, *axes.lines) if artist.get_label() == label)
    return found


def shown(steps):
    """Frames and values of what is drawn as stairs."""
    values, edges, _ = steps.get_data()
    return dict(zip((0.5 * (edges[1:] + edges[:-1])).tolist(), np.asarray(values).tolist(), strict=True))


def known(values):
    return {frame: value for frame, value in values.items() if np.isfinite(value)}


def texts_in(figure):
    return [
        text.get_text().replace("\n", " ") for text in (*figure.texts, *figure.axes[0].texts, *figure.axes[1].texts)
    ]


# What is drawn


@pytest.mark.parametrize("name", CASES)
def test_the_seconds_and_the_share_of_every_frame_are_drawn(name):
    upper, lower = reversed(draw_animation(CASES[name]).axes)
    rows = CASES[name]["frames"]
    assert known(shown(of(upper, OURS))) == {row["frame"]: row["wall_seconds"] for row in rows}
    shares = known(shown(of(lower, "traced")))
    assert shares == pytest.approx({row["frame"]: 100.0 * row["fractions"]["rerendered"] for row in rows})


def test_the_stages_lie_on_each_other_and_end_where_the_seconds_do():
    upper = draw_animation(CASES["gaps"]).axes[1]
    below = {}
    for name in ("source", "tracing", "denoising", REST):
        steps = of(upper, name)
        baseline = dict(zip(shown(steps), np.asarray(steps.get_data().baseline).tolist(), strict=True))
        assert {frame: baseline[frame] for frame in below} == below, name
        below = known(shown(steps))
    assert below == pytest.approx(known(shown(of(upper, OURS))), abs=ROUNDING)


def test_stages_are_sorted_into_their_kinds():
    series = series_of(report([row(0)]))
    assert {name: seconds[0] for name, seconds in series.stages.items()} == pytest.approx(
        {"source": 4.0, "tracing": 0.8, "denoising": 0.35, REST: 0.25}
    )


def test_without_denoising_it_is_not_named():
    plain = row(1, seconds={"source": 4.0, "fill": 1.0})
    assert "denoising" not in texts_in(draw_animation(report([plain])))
    assert "denoising" in texts_in(draw_animation(CASES["one"]))


# Blender's multiview


def test_what_was_measured_is_drawn_as_points_with_a_line():
    upper = draw_animation(CASES["usual"]).axes[1]
    line = of(upper, REFERENCE)
    rows = [row for row in CASES["usual"]["frames"] if "compare" in row]
    assert line.get_xdata().tolist() == [6, 12, 18, 24]
    assert line.get_ydata().tolist() == [row["compare"]["multiview_seconds"] for row in rows]
    assert (line.get_marker(), line.get_linestyle()) == ("o", "-")
    assert line.get_markevery() == [0, 1, 2, 3]


def test_without_a_measure_it_is_predicted_and_called_so():
    figure = draw_animation(CASES["five"])
    steps = of(figure.axes[1], REFERENCE)
    assert known(shown(steps)) == {row["frame"]: row["multiview_seconds"] for row in CASES["five"]["frames"]}
    assert steps.get_linestyle() not in ("-", "solid")
    assert f"{REFERENCE}, predicted" in texts_in(figure)
    assert f"{REFERENCE}, measured" in texts_in(draw_animation(CASES["usual"]))


def test_the_title_says_how_the_gain_is_known():
    usual, five, one = (texts_in(draw_animation(CASES[name]))[0] for name in ("usual", "five", "one compared"))
    speedup = CASES["usual"]["totals"]["speedup"]
    assert usual == f"24 frames, {speedup:.2f} × as fast as Blender's multiview (measured on 4 frames)"
    assert five.endswith("(predicted)")
    assert one.startswith("1 frame, ")
    assert one.endswith("(measured on 1 frame)")


def test_one_view_is_held_against_plain_renders():
    texts = texts_in(draw_animation(report([compared(1, views=1), row(2, views=1)])))
    assert "as fast as plain renders (measured on 1 frame)" in texts[0]
    assert f"{PLAIN}, measured" in texts
    assert not any("multiview" in text or "target eye" in text for text in texts)


def test_many_points_have_no_markers_but_for_one_that_is_in_no_line():
    frames = [*range(1, 101), 200]
    many = draw_animation(report([compared(frame) for frame in frames], range(1, 201)))
    line = of(many.axes[1], REFERENCE)
    assert len(frames) > MAX_MARKERS
    assert [line.get_xdata()[k] for k in line.get_markevery()] == [200]


# Gaps


def test_frames_that_are_not_there_are_gaps():
    upper, lower = reversed(draw_animation(CASES["gaps"]).axes)
    missing = {9, 10, 12, 13, *range(25, 31)}
    for steps in (of(upper, OURS), of(upper, "source"), of(lower, "traced")):
        drawn = shown(steps)
        assert set(drawn) == set(range(1, 31))
        assert {frame for frame, value in drawn.items() if np.isnan(value)} == missing


def test_the_line_of_multiview_breaks_where_frames_are_missing():
    line = of(draw_animation(CASES["gaps"]).axes[1], REFERENCE)
    at = dict(zip(line.get_xdata().tolist(), line.get_ydata().tolist(), strict=True))
    assert set(known(at)) == {4, 8, 16, 20, 24}
    assert {9, 10, 12, 13} <= set(at), "they part 8 and 16"


def test_what_is_missing_is_named():
    notes = " ".join(texts_in(draw_animation(CASES["gaps"])))
    assert "Not rendered: frames 9-10, 13, 25-30 Failed: frame 12" in notes
    assert "Not rendered" not in " ".join(texts_in(draw_animation(CASES["usual"])))


def test_of_many_views_it_says_what_the_share_is_of():
    words = " ".join(texts_in(draw_animation(CASES["views"])))
    assert "of all 48 views rendered or traced on average" in words
    assert "the share of the pixels of all 48 views that was rendered or traced" in words
    assert "target eye" not in words


def test_frames_in_steps_have_no_gaps():
    series = series_of(report([row(frame) for frame in (-5, 0, 5, 15)]))
    assert (series.step, series.frames.tolist()) == (5, [-5, 0, 5, 10, 15])
    assert series.there.tolist() == [True, True, True, False, True]


@pytest.mark.parametrize(
    "changes",
    [
        {"wall_seconds": None},
        {"seconds": None},
        {"seconds": {"source": None, "fill": 1.0}},
        {"fractions": {}},
        {"multiview_seconds": None},
        {"compare": None},
        {"compare": {"multiview_seconds": None}},
        {"size": None, "samples": 7},
    ],
    ids=repr,
)
@pytest.mark.parametrize("others", [0, 3])
def test_figures_that_are_missing_are_left_out(changes, others, tmp_path):
    rows = [row(frame) for frame in range(others)]
    incomplete = {**report(rows), "frames": [*rows, row(others, **changes)]}
    draw_animation_chart(incomplete, tmp_path / "animation")
    assert len(list(tmp_path.iterdir())) == 2


def test_a_frame_of_which_nothing_is_known_can_be_drawn():
    draw_animation({"frames": [{"frame": 3}]}).draw_without_rendering()


# Names


def test_names_keep_their_distance_and_their_order():
    rng = np.random.default_rng(5)
    for _ in range(50):
        places = sorted(rng.uniform(0.0, 3.0, 6).tolist())
        found = spread(places, 0.3, 3.0)
        assert np.diff(found).min() >= 0.3 - ROUNDING
        assert found.min() >= 0.0
        assert found.max() <= 3.0 + ROUNDING


def test_names_with_room_stay_where_they_are():
    assert spread([2.0, 0.5, 1.0], 0.3, 3.0) == pytest.approx([2.0, 0.5, 1.0])
    assert spread([1.0, 1.0], 0.2, 3.0) == pytest.approx([0.9, 1.1]), "neither has the better place"
    assert spread([], 0.2, 3.0).size == 0


@pytest.mark.parametrize("name", CASES)
def test_no_text_covers_another_or_is_cut_off(name):
    figure = draw_animation(CASES[name])
    figure.draw_without_rendering()
    lower, upper = figure.axes
    labels = [axes.yaxis.label for axes in figure.axes] + [lower.xaxis.label]
    ticks = [*ticks_of(lower), *ticks_of(upper)]
    texts = [text for text in (*figure.texts, *upper.texts, *labels, *ticks) if text.get_text()]
    boxes = [text.get_window_extent() for text in texts]
    for (a, box), (b, other) in itertools.combinations(zip(texts, boxes, strict=True), 2):
        assert not box.overlaps(other), f"{a.get_text()} and {b.get_text()}"
    for text, box in zip(texts, boxes, strict=True):
        assert min(box.x0, box.y0) >= 0.0, text.get_text()
        assert box.x1 <= figure.bbox.width, text.get_text()
        assert box.y1 <= figure.bbox.height, text.get_text()


def ticks_of(axes):
    """The seconds and shares that are written beside the axes; there are others beyond their ends, not drawn."""
    low, high = axes.get_ylim()
    return [tick.label1 for tick in axes.yaxis.get_major_ticks() if low <= tick.get_loc() <= high]


# Files


def test_two_files_are_made_beside_the_report(tmp_path):
    draw_animation_chart(CASES["usual"], tmp_path / "shot.v1animation")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["shot.v1animation.png", "shot.v1animation.svg"]
    assert (tmp_path / "shot.v1animation.png").read_bytes().startswith(PNG_START)
    svg = ET.parse(tmp_path / "shot.v1animation.svg")
    texts = {"".join(element.itertext()).strip() for element in svg.iter(f"{SVG}text")}
    assert {OURS, "source", "tracing", "denoising", REST, f"{REFERENCE}, measured", "frame"} <= texts


@pytest.mark.parametrize("name", ["usual", "thousands"])
def test_the_same_report_makes_the_same_files(name, tmp_path):
    for folder in ("once", "again"):
        (tmp_path / folder).mkdir()
        draw_animation_chart(CASES[name], tmp_path / folder / "animation")
    for path in (tmp_path / "once").iterdir():
        assert path.read_bytes() == (tmp_path / "again" / path.name).read_bytes()


@pytest.mark.parametrize("name", ["thousands", "predicted thousands"])
def test_thousands_of_frames_make_no_huge_file(name, tmp_path):
    draw_animation_chart(CASES[name], tmp_path / "animation")
    assert (tmp_path / "animation.svg").stat().st_size < SVG_BYTES


def test_a_file_appears_whole_or_not_at_all(tmp_path):
    path = tmp_path / "animation.png"
    path.write_bytes(b"old")

    def fail():
        with whole_file(path) as beside:
            beside.write_bytes(b"new")
            assert path.read_bytes() == b"old"
            raise OSError("the disk is full")

    with pytest.raises(OSError, match="the disk is full"):
        fail()
    assert [(made.name, made.read_bytes()) for made in tmp_path.iterdir()] == [("animation.png", b"old")]


def test_processes_of_one_number_do_not_meet(tmp_path, monkeypatch):
    """On a shared drive two machines may have a process of the same number."""
    monkeypatch.setattr(os, "getpid", lambda: 42)
    with whole_file(tmp_path / "a") as one, whole_file(tmp_path / "a") as other:
        assert one != other
        for beside in (one, other):
            Path(beside).write_bytes(b"")
    write_json(tmp_path / "a", {"frames": 1})
    assert (tmp_path / "a").read_bytes() == b'{\n  "frames": 1\n}\n'
