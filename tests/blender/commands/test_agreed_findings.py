"""What decides how an animation's frames are made: measured by whichever run comes first, and kept to by all."""

from dataclasses import replace

import pytest

from stereo_reproject.blender.commands.frame_maker import AgreedFindings, FrameContext
from stereo_reproject.pipeline.view_plan import ViewCosts
from stereo_reproject.sequence.journal import Fingerprints, Journal
from stereo_reproject.settings.animation import AnimationSettings
from stereo_reproject.settings.frame import StereoSettings
from stereo_reproject.trace.costs import AGREED, MEASURED, TraceCosts
from stereo_reproject.trace.fill import SourceCost

ASSUMED_COSTS = TraceCosts()

WANTED = Fingerprints("settings", {"Object": "1"})


def never():
    raise AssertionError("it has been measured already")


def agreed_costs(findings, known, measure, packed_by="osl"):
    return findings.trace_costs(known, measure, packed_by=packed_by)


@pytest.fixture
def findings(tmp_path):
    """As a run has it that has just started on the frames in the folder."""

    def of(run, *, wanted=WANTED, layer="ViewLayer"):
        journal = Journal(tmp_path, "shot_")
        journal.place.make()
        context = FrameContext(StereoSettings(), AnimationSettings(), journal, wanted, run, half_floats=True)
        return AgreedFindings(context, layer)

    return of


@pytest.mark.parametrize("faster", [True, False])
def test_what_one_run_has_measured_the_others_keep_to(findings, faster):
    assert findings("first").gpu_is_faster(lambda: faster) is faster
    assert findings("second").gpu_is_faster(never) is faster
    assert findings("third").gpu_is_faster(never) is faster


def test_by_what_one_run_has_decided_which_views_are_rendered_the_others_do(findings):
    assert findings("first").view_costs(ViewCosts(1.25, 0.05)) == ViewCosts(1.25, 0.05)
    assert findings("second").view_costs(ViewCosts(2.0, 0.5)) == ViewCosts(1.25, 0.05)
    assert findings("third", layer="Another").view_costs(ViewCosts(2.0, 0.5)) == ViewCosts(2.0, 0.5)


def test_of_two_that_measure_at_once_one_is_heard(findings):
    def meanwhile():
        assert findings("second").gpu_is_faster(lambda: True) is True
        return False

    assert findings("first").gpu_is_faster(meanwhile) is True


@pytest.mark.parametrize(
    "other",
    [{"layer": "Another"}, {"wanted": Fingerprints("others", WANTED.scene)}, {"wanted": Fingerprints("settings", {})}],
)
def test_what_is_another_picture_is_measured_anew(findings, other):
    assert findings("first").gpu_is_faster(lambda: True) is True
    assert findings("second", **other).gpu_is_faster(lambda: False) is False


def test_it_is_kept_apart_from_what_else_is_found(findings):
    assert findings("first").view_costs(ViewCosts(1.25, 0.05)) == ViewCosts(1.25, 0.05)
    assert findings("first").gpu_is_faster(lambda: False) is False
    assert findings("second").view_costs(ViewCosts(2.0, 0.5)) == ViewCosts(1.25, 0.05)


def test_all_choose_by_the_costs_of_the_first(findings):
    first, other = TraceCosts(1.5, 0.25, 0.5, 0.125, MEASURED), TraceCosts(source=MEASURED)
    agreed = replace(first, source=AGREED)
    assert agreed_costs(findings("first"), first, never) == agreed
    assert agreed_costs(findings("second"), other, never) == agreed
    assert agreed_costs(findings("third"), ASSUMED_COSTS, never) == agreed
    assert agreed_costs(findings("first", layer="Another"), other, never) == replace(other, source=AGREED)


def test_each_packed_camera_has_agreed_costs_of_its_own(findings):
    """One frame of an animation may be traced by another camera than the next, where its scene is deeper, say."""
    of_osl, of_portal = TraceCosts(1.5, 0.25, 0.5, 0.125, MEASURED), TraceCosts(3.0, 0.25, 0.5, 0.125, MEASURED)
    for _ in range(2):
        assert agreed_costs(findings("first"), of_osl, never, "osl").packed_pixel_cost == 1.5
        assert agreed_costs(findings("second"), of_portal, never, "portal").packed_pixel_cost == 3.0


def test_costs_that_nobody_knows_are_measured_by_the_first(findings):
    first = TraceCosts(1.5, 0.25, 0.5, 0.125, MEASURED)
    agreed = replace(first, source=AGREED)
    assert agreed_costs(findings("first"), ASSUMED_COSTS, lambda: first) == agreed
    assert agreed_costs(findings("second"), ASSUMED_COSTS, never) == agreed


def test_of_two_that_measure_costs_at_once_one_is_heard(findings):
    first, other = TraceCosts(1.5, 0.25, 0.5, 0.125, MEASURED), TraceCosts(source=MEASURED)

    def meanwhile():
        agreed_costs(findings("second"), first, never)
        return other

    assert agreed_costs(findings("first"), ASSUMED_COSTS, meanwhile) == replace(first, source=AGREED)


def test_agreed_costs_are_kept_apart_from_the_source_s(findings):
    cost = SourceCost(20.0, 1.0)
    assert findings("first").cost(cost) == cost
    assert agreed_costs(findings("first"), ASSUMED_COSTS, lambda: ASSUMED_COSTS).numbers == ASSUMED_COSTS.numbers
    assert findings("second").cost(SourceCost(30.0, 2.0)) == cost
