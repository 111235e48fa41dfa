import json

import pytest

from stereo_reproject.pipeline.onlooker import Onlooker
from stereo_reproject.pipeline.stages import Stage, in_order, label_of, words_of
from stereo_reproject.pipeline.stopwatch import Stopwatch


def test_stages_are_listed_in_the_order_of_a_run():
    assert in_order(["novel", "fill", "source", "fill"]) == ["source", "fill", "novel"]
    assert in_order([Stage.WRITE, "plan", "full render"]) == ["plan", "write", "full render"]


def test_a_stage_is_its_name_in_json_and_in_text():
    assert json.dumps({Stage.DENOISE_SOURCE: Stage.FILL}) == '{"denoise_source": "fill"}'
    assert f"{Stage.WARP} {Stage.WARP!s}" == "warp warp"
    assert {"warp": 1}[Stage.WARP] == 1


@pytest.mark.parametrize(
    ("name", "words", "label"),
    [
        ("denoise_target", "Denoising the second eye", "denoise target"),
        ("account", "Measuring", "account"),
        ("own_run", "own_run", "own run"),
    ],
)
def test_a_stage_in_words(name, words, label):
    assert (words_of(name), label_of(name)) == (words, label)


def test_every_stage_has_words_of_its_own():
    assert len({stage.words for stage in Stage}) == len(Stage)


def test_a_stopwatch_hands_out_plain_names():
    told = []
    watch = Stopwatch(Onlooker(told.append))
    watch.lap(Stage.WARP)
    watch.lap(Stage.FILL)
    watch.lap()
    assert told == ["warp", "fill"]
    assert [type(name) for name in watch.seconds] == [str, str]
