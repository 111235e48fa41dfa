"""Scenes that other people made: a pair at the price of noise, and no scene that stops us."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]

SECONDS = 200.0
"""Far more than any of these runs takes."""

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
    assert report["compare"]["honest_ratio"] <= MIRROR_NOISE_RATIO
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


@pytest.mark.parametrize("name", HARD)
def test_a_hard_scene_runs(shared_scenes, tmp_path, name):
    interocular, convergence = HARD[name]
    options = [
        "--interocular",
        interocular,
        "--convergence",
        convergence,
        "--size",
        "160x90",
        "--samples",
        "4",
        "--no-denoise",
    ]
    report = render(shared_scenes, name, tmp_path, *options)
    assert report["size"] == [160, 90]


def test_an_animated_scene_renders_the_frame_that_was_asked_for(shared_scenes, tmp_path):
    options = ["--interocular", "0.065", "--convergence", "5", "--size", "160x90", "--samples", "1", "--no-denoise"]
    for frame in ("1", "25"):
        (tmp_path / frame).mkdir()
        report = render(shared_scenes, "walking-man", tmp_path / frame, *options, "--frame", frame)
        assert report["frame"] == int(frame)
    first, second = ((tmp_path / frame / "left.exr").read_bytes() for frame in ("1", "25"))
    assert first != second
