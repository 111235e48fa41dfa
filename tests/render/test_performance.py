"""The performance analysis with Blender behind it: its runs, its variants, and a scene that cannot be rendered."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

pytest.importorskip("scipy")
pytest.importorskip("matplotlib")

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "demo" / "cornell-box" / "cornell-box.blend"
SECONDS = 600.0
"""Far more than it takes."""


def analysis(*options):
    command = [sys.executable, "-m", "tests.bench.performance", *map(str, options)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error"}
    return subprocess.run(
        command, env=environment, cwd=ROOT, capture_output=True, text=True, timeout=SECONDS, check=False
    )


def results_of(folder):
    return json.loads((folder / "results.json").read_text(encoding="utf-8"))


def test_the_cornell_box_is_measured_and_an_analysis_goes_on(tmp_path):
    quick = ["--quick", "--output", tmp_path, "--sizes", "64x36", "--frames", "1-2"]
    theirs = [tmp_path / folder / "mine.txt" for folder in ("work", "runs", "variants")]
    for file in theirs:
        file.parent.mkdir()
        file.write_text("mine")
    first = analysis(*quick, "--parts", "scenes", "path")
    assert (first.returncode, first.stderr) == (0, "")
    found = results_of(tmp_path)
    assert found["facts"]["runs"] == {"done": 9, "failed": 0, "left out": 0}
    assert [row["method"] for row in found["scenes"]] == ["multiview", "card", "packed"]
    assert all(row["peak_mb"] > 0.0 and row["seconds"]["total"] > 0.0 for row in found["scenes"])
    assert len({row["holes"] for row in found["path"]}) == 2, "the camera moves, and sees other holes"
    assert (tmp_path / "path-packed-64x36.svg").exists()
    assert all(file.exists() for file in theirs)
    second = analysis(*quick, "--parts", "scenes", "path", "triangles")
    assert (second.returncode, second.stderr) == (0, "")
    assert "9 of 17 runs are there already" in second.stdout
    again = results_of(tmp_path)
    assert again["scenes"] == found["scenes"]
    xs = [x for x, _ in again["scaling"][0]["stages"][0]["points"]]
    assert xs == sorted(set(xs))
    assert not list(tmp_path.glob(".*"))


def test_a_scene_that_cannot_be_rendered_is_told_in_its_cell(tmp_path):
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    shutil.copy(DEMO, scenes)
    (scenes / "broken.blend").write_text("no scene", encoding="utf-8")
    few = ["--sizes", "64x36", "--samples", "2", "--turns", "1", "--parts", "scenes"]
    done = analysis("--scenes", scenes, "--output", tmp_path / "out", *few)
    assert (done.returncode, done.stderr) == (1, "")
    table = (tmp_path / "out" / "results.md").read_text(encoding="utf-8")
    broken = [line for line in table.splitlines() if line.startswith("| broken | 64x36")]
    assert len(broken) == 3
    assert all("failed: " in line for line in broken)
    assert all("is not a .blend file" in line for line in broken if "multiview" not in line)
    rows = {(row["scene"], row["method"]): row["message"] for row in results_of(tmp_path / "out")["scenes"]}
    assert rows["cornell-box", "packed"] is None
    assert rows["broken", "packed"] is not None
