"""Scenes that other people made: pairs as good as rendered again, by honest ratio, alpha and FLIP."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from stereo_reproject.images.exr import read_channels
from stereo_reproject.settings.accuracy import SETTINGS

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]

SECONDS = 200.0
"""Far more than any of these runs takes."""

PROMISE = SETTINGS["balanced"].promise
"""Of the honest ratio."""

FLIP_RATIO = 1.05
"""FLIP over that of a second plain render may be as much at most."""

NOISE_RATIO = 1.05
"""The highest that is promised for these scenes, at 960 x 540 with 64 samples. Here edges are a larger share of the
picture, and 16 samples hide more."""

WORST_TILES = 1.6
"""The same: promised are 1.35 and 1.40; the 99th percentile of 240 tiles is the third worst, and noise itself."""


def render(scenes, name, folder, *options):
    command = [sys.executable, "-m", "stereo_reproject", "render", str(scenes / name / f"{name}.blend")]
    finished = subprocess.run(
        [*command, "--output", str(folder), "--quiet", *options],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout == ""
    return json.loads((folder / "report.json").read_text())


@pytest.mark.parametrize(
    ("name", "convergence", "source"),
    [("living-room", "2.9", "left"), ("classroom", "6.5", "left"), ("classroom", "6.5", "right")],
)
def test_an_interior_is_as_good_as_rendered(shared_scenes, tmp_path, name, convergence, source):
    options = [
        "--interocular",
        "0.065",
        "--convergence",
        convergence,
        "--size",
        "320x180",
        "--samples",
        "16",
        "--no-denoise",
    ]
    report = render(shared_scenes, name, tmp_path, *options, "--source", source, "--fill", "packed", "--compare")
    assert report["compare"]["honest_ratio"] <= PROMISE
    assert report["compare"]["flip_ratio"] <= FLIP_RATIO
    assert report["compare"]["noise_ratio"] <= NOISE_RATIO
    assert report["compare"]["worst_tiles"] <= WORST_TILES
    assert report["fractions"]["rerendered"] < 0.5


MIRROR_NOISE_RATIO = 1.15
"""Balanced promises 1.1, by estimate; at this size that rests on 500 probes, which leave 0.05 to chance."""


def test_the_mirror_of_a_bathroom_is_put_right(shared_scenes, tmp_path):
    options = [
        "--interocular",
        "0.065",
        "--convergence",
        "2.5",
        "--size",
        "240x135",
        "--samples",
        "32",
        "--no-denoise",
        "--compare",
    ]
    ratios = {}
    for accuracy in ("draft", "balanced"):
        (tmp_path / accuracy).mkdir()
        settings = ["--fill", "packed", "--accuracy", accuracy]
        report = render(shared_scenes, "bathroom", tmp_path / accuracy, *options, *settings)
        ratios[accuracy] = report["compare"]["noise_ratio"]
    # Warped by where its image stands, it is right before anything is traced for it.
    assert max(ratios.values()) <= MIRROR_NOISE_RATIO
    assert report["compare"]["honest_ratio"] <= PROMISE
    assert report["compare"]["flip_ratio"] <= FLIP_RATIO
    assert report["fractions"]["rerendered"] < 0.3
    assert report["estimate"]["low"] <= report["estimate"]["noise_ratio"] <= report["estimate"]["high"]


# Foliage finer than a pixel, a skinned character that moves, glass, fog, hair, an old file with depth of field:
# interocular and convergence.
HARD = {
    "meadow": ("0.065", "5.9"),
    "walking-man": ("0.065", "5"),
    "broken-window": ("0.03", "1.14"),
    "volumetric-caustic": ("0.2", "6"),
    "fur-ball": ("0.08", "3.4"),
    "glass-vase": ("0.013", "0.54"),
    "bmw27": ("0.28", "14"),
}

NOISELESS_FLIP_RATIO = {"broken-window": 1.5}
"""Its glass shows a picture that has next to no noise, over which any error is many times as much: 1.31 to 1.45 were
measured at all sizes, and the docs say that this mark is missed."""

OPAQUE = 0.5 / 255.0
"""From 1, that alpha may be off before a film that is not transparent: what no 8-bit picture shows."""


@pytest.mark.parametrize("name", HARD)
def test_a_hard_scene_is_as_good_as_rendered(shared_scenes, tmp_path, name):
    interocular, convergence = HARD[name]
    options = [
        "--interocular",
        interocular,
        "--convergence",
        convergence,
        "--size",
        "256x144",
        "--samples",
        "16",
        "--no-denoise",
        "--compare",
    ]
    report = render(shared_scenes, name, tmp_path, *options)
    compare = report["compare"]
    assert compare["honest_ratio"] <= PROMISE
    assert compare["flip_ratio"] <= NOISELESS_FLIP_RATIO.get(name, FLIP_RATIO)
    for eye in ("left", "right"):
        alpha = read_channels(tmp_path / f"{eye}.exr")["A"]
        assert np.abs(alpha - 1.0).max() <= OPAQUE


def test_an_animated_scene_renders_the_frame_that_was_asked_for(shared_scenes, tmp_path):
    options = ["--interocular", "0.065", "--convergence", "5", "--size", "160x90", "--samples", "1", "--no-denoise"]
    for frame in ("1", "25"):
        (tmp_path / frame).mkdir()
        report = render(shared_scenes, "walking-man", tmp_path / frame, *options, "--frame", frame)
        assert report["frame"] == int(frame)
    first, second = ((tmp_path / frame / "left.exr").read_bytes() for frame in ("1", "25"))
    assert first != second
