"""The source eye as it is warped: cleaned of what would mislead those who read it."""

import numpy as np

from stereo_reproject.images.passes import COLOUR_PASS, VIEW_DEPENDENT_PASS
from stereo_reproject.pipeline.shared_findings import SharedFindings
from stereo_reproject.pipeline.source import render_source
from stereo_reproject.pipeline.stopwatch import Stopwatch
from stereo_reproject.pipeline.task import FrameTask
from stereo_reproject.settings.accuracy import accuracy_of
from stereo_reproject.trace.costs import TraceCosts
from tests.pipeline.test_pipeline import caster, settings

PLACE = 40, 60


def test_a_spark_in_reflected_light_is_gone_and_the_colour_stays():
    colours = []

    def spoil(passes):
        passes[COLOUR_PASS][PLACE][:3] = 1e4
        passes[VIEW_DEPENDENT_PASS] = passes[COLOUR_PASS][..., :3].copy()
        colours.append(passes[COLOUR_PASS].copy())

    renderer, asked = caster(spoil=spoil), settings()
    task = FrameTask.of_pair(renderer, asked, SharedFindings(), TraceCosts, Stopwatch())
    source = render_source(task, accuracy_of(asked))
    rendered = source.rendered
    np.testing.assert_array_equal(rendered[COLOUR_PASS], colours[0])
    assert rendered[VIEW_DEPENDENT_PASS][PLACE].max() < 10.0
