"""The view layers of a pair together: what is summed, and what only the user's own cryptomattes say."""

from types import SimpleNamespace

import numpy as np
import pytest

from stereo_reproject.pipeline.stereo_pair import StereoPair
from stereo_reproject.trace.fill import SourceCost


def frame(*, total, source, sync, ratio=None, passes=("Combined",), metadata=None):
    """As much of a stereo frame as a pair looks at."""
    eye = {name: np.zeros((2, 3, 4), np.float32) for name in passes}
    return SimpleNamespace(
        eyes={"left": eye, "right": dict(eye)},
        seconds={"source": source, "total": total},
        source_cost=SourceCost(source, sync),
        traced=np.array([[True, False, False], [False, False, False]]),
        fill=SimpleNamespace(method="packed"),
        refinement=SimpleNamespace(estimate=None if ratio is None else SimpleNamespace(noise_ratio=ratio)),
        invalid_pixels={"left": 1, "right": 2},
        metadata=metadata or {},
        correction=None,
    )


@pytest.fixture
def pair():
    return StereoPair(
        {"Back": frame(total=8.0, source=5.0, sync=1.0, ratio=1.1), "Front": frame(total=4.0, source=3.0, sync=0.0)}
    )


def test_the_first_layer_is_the_main_one(pair):
    assert (pair.main, pair.main_frame) == ("Back", pair.frames["Back"])
    assert {view: list(layers) for view, layers in pair.eyes.items()} == {
        key: ["Back", "Front"] for key in ("left", "right")
    }


def test_times_and_counts_are_of_all_layers(pair):
    assert pair.seconds == {"source": 8.0, "total": 12.0}
    assert pair.predicted_speedup == pytest.approx((5.0 + 4.0 + 3.0 + 3.0) / 12.0)
    assert pair.invalid_pixels == {"left": 2, "right": 4}


TEXTS = {
    "cryptomatte/1/name": "Back v1.0.CryptoObject",
    "cryptomatte/1/manifest": "{objects}",
    "cryptomatte/2/name": "Back v1.0.CryptoMaterial",
    "cryptomatte/2/manifest": "{materials}",
    "cycles.Back.samples": "4",
}


@pytest.mark.parametrize(("matte", "group"), [("CryptoObject00", "1"), ("CryptoMaterial00", "2")])
def test_only_the_texts_of_cryptomattes_that_the_user_gets(matte, group):
    pair = StereoPair({"Back v1.0": frame(total=1, source=1, sync=0, passes=("Combined", matte), metadata=TEXTS)})
    assert pair.metadata == {key: text for key, text in TEXTS.items() if key.startswith(f"cryptomatte/{group}/")}
    assert StereoPair({"Back v1.0": frame(total=1, source=1, sync=0, metadata=TEXTS)}).metadata == {}
