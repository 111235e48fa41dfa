"""The measurement of the warp on the GPU that Blender has, as a user runs it."""

import json
import os
import subprocess
import sys

import pytest

from tests.bench.warp.settings import cpu_name
from tests.blender.gpu.gpu_cases import HAS_GPU, SAME_COLOURS, SAME_MASK
from tests.conftest import TESTS

SECONDS = 120.0
"""Far more than it takes."""


@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
def test_the_gpu_is_measured_and_held_against_numpy(tmp_path, mode):
    file = tmp_path / "warp.json"
    options = ["--size", "64x36", "--warp", "gpu", "--mode", mode, "--json", str(file)]
    done = subprocess.run(
        [sys.executable, "-m", "tests.bench.warp", *options],
        env={**os.environ, "PYTHONPATH": str(TESTS.parent)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    if not HAS_GPU:
        assert (done.returncode, done.stdout, file.exists()) == (2, "", False)
        assert "--warp gpu: no usable GPU" in done.stderr
        return
    assert (done.returncode, done.stderr) == (0, "")
    report = json.loads(file.read_text(encoding="utf-8"))
    assert (report["warp"], report["size"], report["scene"]["mode"]) == ("gpu", [64, 36], mode)
    assert report["device"] != cpu_name()
    assert report["device"] in done.stdout
    assert len(report["all_seconds"]) == report["runs"]
    assert min(report["all_seconds"]) > 0.0
    assert report["map_seconds"] is None
    agreement = report["agreement"]
    assert agreement["why_none"] is None
    assert agreement["holes"] <= SAME_MASK
    # Not the same to the bit: numpy is not held against itself.
    assert 0.0 < agreement["colour"] <= SAME_COLOURS
