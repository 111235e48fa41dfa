"""The price list with Blender behind it: every run, its files, and runs that a scene cannot have."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.commands.price_list import render_prices
from stereo_reproject.blender.commands.price_list_renderers import (
    HeuristicRenderer,
    RenderedSource,
    SharedSourceRenderer,
)
from stereo_reproject.blender.engines.portal_sheet import SHEET_NAME
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.working import rendered_layer, working_scene
from stereo_reproject.images.passes import COLOUR_PASS, MASKED_PASS, SOURCE_ONLY_PASSES
from stereo_reproject.images.reasons import Reason
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.settings.frame import ACCURACIES, SceneOverrides, StereoSettings
from stereo_reproject.tradeoff.cases import TRADEOFF_FILES, tradeoff_cases
from tests.blender.toolbox import (
    Material,
    add_camera,
    add_plane,
    add_sphere,
    diffuse,
    empty_scene,
    noise_image,
    set_background,
)

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "demo" / "cornell-box" / "cornell-box.blend"
OPTIONS = ["--interocular", "0.2", "--convergence", "6.9", "--size", "96x54", "--samples", "4", "--seed", "5"]
SECONDS = 300.0
"""Far more than a run takes."""

RATIO_TOLERANCE = 0.15
"""Of the noise ratio of two plain renders at 96 x 54: fireflies of 4 samples weigh in it."""

SIZE = (128, 72)


def tradeoff(scene, folder, *options, path=()):
    command = [sys.executable, "-m", "stereo_reproject", "tradeoff", str(scene), "--output", str(folder), *options]
    python_path = os.pathsep.join(map(str, (*path, ROOT, os.environ.get("PYTHONPATH", ""))))
    environment = {**os.environ, "PYTHONPATH": python_path, "PYTHONWARNINGS": "error"}
    return subprocess.run(
        command,
        env=environment,
        cwd=folder.parent,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )


# From the command line


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    pytest.importorskip("matplotlib")
    folder = tmp_path_factory.mktemp("demo") / "out"
    finished = tradeoff(DEMO, folder, *OPTIONS)
    assert finished.returncode == 0, finished.stderr
    return folder, finished, json.loads((folder / "tradeoff.json").read_text())


def test_every_file_is_there_and_nothing_else(demo):
    folder, finished, _ = demo
    assert sorted(path.name for path in folder.iterdir()) == sorted(TRADEOFF_FILES)
    assert finished.stderr == ""


def test_every_run_is_a_row(demo):
    folder, finished, prices = demo
    names = [run.name for run in tradeoff_cases()]
    assert [row["name"] for row in prices["rows"]] == names
    assert prices["left_out"] == []
    assert [row["accuracy"] for row in prices["rows"]] == [run.accuracy_name for run in tradeoff_cases()]
    with (folder / "tradeoff.csv").open(encoding="utf-8", newline="") as file:
        assert [line["name"] for line in csv.DictReader(file)] == [*names, "multiview"]
    assert all(f"{name} " in finished.stdout for name in names)


def test_facts_are_those_of_the_run(demo):
    _, _, prices = demo
    assert (prices["schema"], prices["scene"], prices["size"], prices["samples"]) == (1, "cornell-box", [96, 54], 4)
    assert prices["stereo"]["interocular_distance"] == pytest.approx(0.2)
    assert min(prices["warm_up_seconds"], prices["peer"]["seconds"], prices["peer"]["noise_rmse"]) > 0.0


def test_seconds_add_up_and_hold_the_source(demo):
    _, _, prices = demo
    for row in prices["rows"]:
        stages = {name: value for name, value in row["seconds"].items() if name != "total"}
        assert row["seconds"]["total"] == pytest.approx(sum(stages.values()))
        assert row["speedup"] == pytest.approx(prices["peer"]["seconds"] / row["seconds"]["total"])
        if row["kind"] != "heuristic":
            assert stages["source"] >= prices["source"]["seconds"]


def test_full_is_as_good_as_rendering_it_again(demo):
    _, _, prices = demo
    full = next(row for row in prices["rows"] if row["name"] == "full")
    assert (full["fill"], full["traced"]) == ("full", 1.0)
    assert full["noise_ratio"] == pytest.approx(1.0, abs=RATIO_TOLERANCE)


def test_card_is_a_card_and_holes_alone_have_no_silhouettes(demo):
    _, _, prices = demo
    rows = {row["name"]: row for row in prices["rows"]}
    assert rows["card"]["fill"] == "card"
    assert rows["holes alone"]["fractions"]["silhouette"] == 0.0
    assert rows["balanced"]["fractions"]["silhouette"] > 0.0


def test_without_matplotlib_nothing_is_rendered(tmp_path):
    """A stand-in that cannot be imported, found before the real one."""
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "matplotlib.py").write_text("raise ImportError('not for tests')")
    finished = tradeoff(DEMO, tmp_path / "out", *OPTIONS, path=[tmp_path / "modules"])
    assert (finished.returncode, finished.stdout) == (2, "")
    assert finished.stderr.count("\n") == 1
    assert "pip install matplotlib" in finished.stderr
    assert not (tmp_path / "out").exists()


# Single runs


@pytest.fixture
def scene(tmp_path):
    """A textured wall under a bright sky, and a mirror ball before it."""
    scene = empty_scene(*SIZE, samples=4)
    set_background(scene, 1.0)
    add_plane(scene, diffuse(image=noise_image(tmp_path)), size=(30, 20), location=(0, 0, -9))
    mirror = Material("mirror")
    mirror.surface(mirror.node("BsdfGlossy", Roughness=0.02))
    add_sphere(scene, mirror, radius=1.2, location=(0.2, 0.1, -6.0))
    add_camera(scene, interocular=0.3)
    return scene


@pytest.mark.parametrize("denoised", [False, True])
def test_the_heuristic_traces_the_mirror_and_leaves_the_wall(scene, tmp_path, denoised):
    scene.cycles.use_denoising = denoised
    run = next(run for run in tradeoff_cases() if run.kind == "heuristic")
    with working_scene(scene, SceneOverrides()) as working:
        renderer = HeuristicRenderer(working, tmp_path)
        masked, _ = renderer.render_source("left")
        frame = render_stereo_frame(renderer, StereoSettings(fill="packed"), accuracy=run.accuracy)
    mask = masked[MASKED_PASS][..., 0] > 0.0
    seen = ball(masked["Depth"])
    assert mask[seen].mean() > 0.97
    assert mask[~seen].mean() < 0.02
    flagged = (frame.reasons & Reason.VIEW_DEPENDENT.bit) > 0
    traced = flagged | ((frame.reasons & (Reason.SILHOUETTE.bit | Reason.DISOCCLUDED.bit)) > 0)
    assert traced[ball(frame.eyes["right"]["Depth"])].mean() > 0.97
    assert frame.refinement.estimate is None
    assert ("denoise_target" in frame.seconds) == denoised
    assert all(set(eye) == {COLOUR_PASS, "Depth"} for eye in frame.eyes.values())


def ball(depth):
    """(H, W): where the ball is seen, which ends before the wall begins."""
    return depth[..., 0] < 7.5


def test_the_heuristic_leaves_the_passes_as_they_were(scene, tmp_path):
    with working_scene(scene, SceneOverrides()) as working:
        rendered_layer(working).use_pass_glossy_color = True
        plain, _ = BlenderRenderer(working, tmp_path).render_source("left")
        masked, _ = HeuristicRenderer(working, tmp_path).render_source("left")
        assert rendered_layer(working).use_pass_glossy_color
        assert not rendered_layer(working).use_pass_transmission_direct
    # The simple method knows nothing of mirrors, and needs no pass that tells of them.
    assert set(masked) == {*plain, MASKED_PASS} - {*SOURCE_ONLY_PASSES}
    np.testing.assert_array_equal(masked[COLOUR_PASS], plain[COLOUR_PASS])


def test_a_shared_source_makes_the_very_frame_that_a_run_of_its_own_makes(scene, tmp_path):
    settings = StereoSettings(fill="packed", accuracy="draft")
    with working_scene(scene, SceneOverrides(seed=3)) as working:
        alone = render_stereo_frame(BlenderRenderer(working, tmp_path), settings)
    with working_scene(scene, SceneOverrides(seed=3)) as working:
        passes, cost = BlenderRenderer(working, tmp_path).render_source("left")
        shared = RenderedSource("left", passes, cost, 0.0)
        for accuracy in ("exact", "draft"):
            working.cycles.seed = 3
            renderer = SharedSourceRenderer(working, tmp_path, shared)
            frame = render_stereo_frame(renderer, settings, accuracy=SETTINGS[accuracy])
    for view, eye in alone.eyes.items():
        np.testing.assert_array_equal(frame.eyes[view][COLOUR_PASS], eye[COLOUR_PASS])


def test_each_run_of_a_denoising_scene_is_denoised(scene, tmp_path):
    scene.cycles.use_denoising = True
    settings = StereoSettings(fill="packed", accuracy="draft")
    with working_scene(scene, SceneOverrides(seed=3)) as working:
        passes, cost = BlenderRenderer(working, tmp_path).render_source("left")
        shared = RenderedSource("left", passes, cost, 0.0)
        frames = [
            render_stereo_frame(SharedSourceRenderer(working, tmp_path, shared), settings, accuracy=SETTINGS["draft"])
            for _ in range(2)
        ]
    for frame in frames:
        assert frame.seconds["denoise_source"] > 0.0
        assert not np.array_equal(frame.eyes["left"][COLOUR_PASS], passes[COLOUR_PASS])


def test_no_run_pays_for_what_only_the_first_packed_trace_does(scene, tmp_path):
    """The portal's sheet stands, and is synced, before the first run begins."""
    pytest.importorskip("matplotlib")
    sheets = {}

    def listen(name, _):
        sheets.setdefault(name, [item.name for item in bpy.data.objects if item.name.startswith(SHEET_NAME)])

    settings = StereoSettings(scene=SceneOverrides(size=(48, 27), samples=1), packed_by="portal")
    render_prices(scene, settings, tmp_path, only=["draft", "balanced"], on_stage=listen)
    assert (len(sheets["source"]), len(sheets["draft"])) == (0, 1)
    assert sheets["balanced"] == sheets["draft"]


def test_a_run_that_the_scene_cannot_have_is_left_out(scene, tmp_path):
    pytest.importorskip("matplotlib")
    scene.view_layers[0].material_override = diffuse("override").block
    told = []
    prices, files = render_prices(
        scene,
        StereoSettings(scene=SceneOverrides(size=(48, 27), samples=1)),
        tmp_path,
        on_stage=lambda name, detail: told.append((name, detail)),
    )
    assert [row["name"] for row in prices["rows"]] == [*ACCURACIES, "holes alone", "heuristic mask", "full"]
    assert prices["left_out"] == [{"name": "card", "reason": "a material override would replace the card's material"}]
    assert any(line.startswith("card is left out: ") for line in prices["warnings"])
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(files)
    names = [name for name, _ in told]
    assert list(dict.fromkeys(names))[:4] == ["warm-up", "multiview", "source", "draft"]
    assert ("balanced", "warp") in told
