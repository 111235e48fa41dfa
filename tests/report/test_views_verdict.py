"""The verdict on many views in plain words, from their report."""

import pytest

from stereo_reproject.report.views_verdict import saved_by_views, verdicts_on_views


def view(name, how="made", honest_ratio=1.02, interval=(1.0, 1.05)):
    made = how == "made"
    return {
        "name": name,
        "how": how,
        "from": ["view_00"] if made else [],
        "traced": 0.1 if made else 1.0,
        "honest_ratio": honest_ratio if made else None,
        "interval": list(interval) if made and interval else None,
    }


def report(*views, accuracy="balanced", **more):
    seconds = {"load": 2.0, "source": 20.0, "total": 30.0, "write": 3.0, "compare": 50.0}
    ends = [view("view_00", "rendered"), view("view_09", "rendered")]
    return {"views": [*ends, *views], "accuracy": accuracy, "seconds": seconds, "predicted_speedup": 4.0, **more}


def quality(found):
    verdict = verdicts_on_views(found)[1]
    return str(verdict.words), verdict.good


def counts(found):
    return str(verdicts_on_views(found)[0].words)


def test_it_counts_what_was_rendered_and_made():
    assert counts(report(view("view_01"), view("view_02"), view("view_03"))) == "2 views rendered, 3 made from them"
    assert counts(report()) == "2 views rendered"
    pair = report(view("view_01"))
    del pair["views"][1]
    assert counts(pair) == "1 view rendered, 1 made from it"


def test_the_worst_view_decides():
    good = view("view_01")
    assert quality(report(good)) == ("As good as rendering every view", True)
    nearly = view("view_02", honest_ratio=1.15, interval=(1.1, 1.2))
    assert quality(report(good, nearly, accuracy="preview")) == ("Nearly as good as rendering every view", True)
    bad = view("view_03", honest_ratio=1.4, interval=(1.3, 1.5))
    assert quality(report(good, bad)) == ("Not as good as rendering every view: view_03 least", False)


@pytest.mark.parametrize("interval", [(1.05, 1.6), None])
def test_the_worst_of_many_estimates_decides_only_by_its_whole_range(interval):
    found = report(view("view_01"), view("view_02", honest_ratio=1.3, interval=interval))
    assert quality(found) == ("Too close to tell if all are as good as rendered: view_02 least", None)


def test_what_was_not_checked_is_said():
    unpromised = report(view("view_01"), accuracy="draft")
    assert quality(unpromised) == ("Not checked: reflections and glass stay as the rendered views show them", None)
    assert quality(report(accuracy="draft")) == ("As good as rendering every view", True)


def test_a_view_without_an_estimate_shows_nothing_that_could_differ():
    unprobed = view("view_01", honest_ratio=None, interval=None)
    assert quality(report(unprobed)) == ("As good as rendering every view", True)
    bad = view("view_03", honest_ratio=1.4, interval=(1.3, 1.5))
    assert quality(report(unprobed, bad)) == ("Not as good as rendering every view: view_03 least", False)


def test_a_comparison_decides():
    compare = {"honest_ratio": 1.3, "plain_seconds": 100.0}
    assert quality(report(view("view_01"), compare=compare)) == (
        "Not as good as rendering every view (measured)",
        False,
    )
    compare["honest_ratio"] = 1.04
    assert quality(report(view("view_01"), compare=compare)) == ("As good as rendering every view (measured)", True)


def test_the_time_saved_is_less_what_a_plain_render_has_not():
    assert saved_by_views(report()) == pytest.approx(4.0 * 30.0 - 30.0 - 2.0 - 3.0)
    measured = report(compare={"honest_ratio": 1.0, "plain_seconds": 100.0})
    assert saved_by_views(measured) == pytest.approx(100.0 - 30.0 - 2.0 - 3.0)
    assert str(verdicts_on_views(measured)[2].words) == "1 min 5 s saved of 1 min 40 s (65 %)"
    slow = verdicts_on_views({**report(), "predicted_speedup": 1.0})[2]
    assert (str(slow.words), slow.good) == ("No time saved: 5.0 s longer", None)
