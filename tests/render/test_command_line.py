"""The command line as a user types it, with Blender behind it: files, report, refusals, interrupts."""

import contextlib
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
import pytest

from stereo_reproject.blender.output.delivery import deliver_side_by_side
from stereo_reproject.blender.output.pictures import read_png
from stereo_reproject.blender.scene.working import open_blend
from stereo_reproject.images.effects import Effect
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.pipeline.stages import OUTSIDE_TOTAL
from tests.blender.toolbox import add_camera, add_cube, add_plane, add_sun, diffuse, empty_scene, render_plain

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "demo" / "cornell-box" / "cornell-box.blend"
FILES = [
    "estimate.exr",
    "estimate.png",
    "grid.png",
    "holes.png",
    "left.exr",
    "report.json",
    "right.exr",
    "stereo.exr",
    "stereo.png",
]
SIZE = (96, 54)
DEMO_LAYER = "ViewLayer"
DEMO_OPTIONS = ["--interocular", "0.2", "--convergence", "6.9", "--size", "96x54", "--samples", "4", "--no-denoise"]

# What is measured may make another choice each time: auto fills as it finds cheapest.
REPEATABLE = ["--seed", "5", "--fill", "packed"]

SECONDS = 120.0
"""Far more than any of these runs takes."""


DITHER = 2.01 / 255.0
"""A scene's dithering moves a value of 8 bits to the next one, at random, and rounding may add one."""

posix = pytest.mark.skipif(os.name != "posix", reason="signals and terminals as POSIX has them")


@dataclass(frozen=True)
class Run:
    status: int
    out: str
    err: str
    folder: Path

    @property
    def report(self):
        return json.loads((self.folder / "report.json").read_text())

    @property
    def files(self):
        return sorted(path.name for path in self.folder.iterdir()) if self.folder.is_dir() else []

    def eye(self, view):
        with OpenEXR.File(str(self.folder / f"{view}.exr"), separate_channels=True) as file:
            return {name: np.array(channel.pixels) for name, channel in file.channels().items()}


def command(scene, folder, *options):
    return [sys.executable, "-m", "stereo_reproject", "render", str(scene), "--output", str(folder), *map(str, options)]


def environment():
    return {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error"}


def render(scene, folder, *options):
    finished = subprocess.run(
        command(scene, folder, *options),
        env=environment(),
        cwd=folder.parent,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    return Run(finished.returncode, finished.stdout, finished.stderr, folder)


def save(scene, path):
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
    return path


@pytest.fixture
def small_scene():
    """A lit wall with a box before it: not yet a file."""
    scene = empty_scene(64, 36, samples=2)
    add_plane(scene, diffuse("wall", (0.3, 0.5, 0.7)), size=(30, 20), location=(0, 0, -10))
    add_cube(scene, diffuse("box", (0.9, 0.4, 0.2)), size=1.5, location=(0.3, 0.2, -5)).name = "Box"
    add_sun(scene)
    add_camera(scene)
    return scene


def assert_refused(run, *parts, status=2):
    """One line that says it, and nothing else, anywhere."""
    assert (run.status, run.out) == (status, ""), run.err
    line = run.err.removesuffix("\n")
    assert "\n" not in line
    assert "Traceback" not in line
    assert "defect" not in line
    for part in parts:
        assert part in line
    assert not run.folder.exists()
    assert workers_of(run.folder) == []


def workers_of(folder):
    """Processes whose temporary folder lies in `folder`: the workers of its runs, and all that they started."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"TMPDIR={folder}".encode() in (process / "environ").read_bytes():
                found.append(process.name)
    return found


# A pair


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    options = [*DEMO_OPTIONS, *REPEATABLE, "--compare"]
    return render(DEMO, tmp_path_factory.mktemp("demo") / "out", *options)


@pytest.fixture(scope="module")
def plain_demo(tmp_path_factory):
    """Blender's own multiview of the same, from the same file."""
    scene = open_blend(DEMO)
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.cycles.samples, scene.cycles.use_denoising = 4, False
    scene.view_layers[0].use_pass_z = True
    stereo = scene.camera.data.stereo
    stereo.interocular_distance, stereo.convergence_distance = 0.2, 6.9
    return render_plain(scene, tmp_path_factory.mktemp("plain"), seed=5)


def test_every_file_is_there_and_nothing_else(demo):
    assert (demo.status, demo.err) == (0, "")
    assert demo.files == sorted([*FILES, "difference.png"])


def test_output_is_the_table_alone(demo):
    """No progress without a terminal, and nothing that Blender prints."""
    words = [line.split()[0] for line in demo.out.splitlines() if line[:1].strip()]
    assert words == ["cornell-box,", "took", "traced", "fill", "estimate", "price", "gained", "memory", "files"]
    assert "\r" not in demo.out
    assert not re.search("Fra:|Saved|Info|Read blend", demo.out)


def test_report_holds_what_was_promised(demo):
    report = demo.report
    assert (report["schema"], report["frame"], report["size"], report["samples"]) == (1, 1, [96, 54], 4)
    assert report["scene"] == "cornell-box"
    assert report["blender"] == bpy.app.version_string
    assert report["accuracy"] == "balanced"
    assert set(report["seconds"]) >= {"load", "source", "warp", "fill", "composite", "write", "total"}
    inside = [value for name, value in report["seconds"].items() if name not in (*OUTSIDE_TOTAL, "total")]
    assert report["seconds"]["total"] == pytest.approx(sum(inside))
    assert 0.0 < report["seconds"]["plan"] < report["seconds"]["total"]
    fractions = report["fractions"]
    assert 0.0 < fractions["rerendered"] <= 1.0
    compare = report["compare"]
    assert compare["speedup"] == pytest.approx(compare["multiview_seconds"] / report["seconds"]["total"])
    assert compare["noise_ratio"] == pytest.approx(compare["rmse"] / compare["noise_rmse"])
    assert min(compare["flip"], compare["noise_flip"], compare["worst_tiles"]) > 0.0
    assert compare["flip_ratio"] == pytest.approx(compare["flip"] / compare["noise_flip"])
    assert compare["bias"] == pytest.approx(np.sqrt(max(2.0 * (compare["honest_ratio"] ** 2 - 1.0), 0.0)))
    assert compare["honest_ratio"] > compare["noise_ratio"], "lookups between pixels smooth noise"
    assert 0.0 <= compare["wrong_tiles"] < 1.0
    assert [row["effect"] for row in report["effects"]] == [effect.label for effect in Effect]
    assert not any(row["called_for"] for row in report["effects"] if row["effect"] in ("glossy", "hair", "volume"))
    estimate, price = report["estimate"], report["price"]
    assert (estimate["noise_ratio"], estimate["promise"], estimate["kept"]) == (None, 1.1, None)
    assert price["accuracy"] == "high"
    assert price["seconds"] == pytest.approx(report["seconds"]["total"] + price["more_seconds"])


def test_source_is_blenders_own_left_eye(demo, plain_demo):
    eye, plain = demo.eye("left"), plain_demo["left"]
    for index, letter in enumerate("RGBA"):
        np.testing.assert_array_equal(eye[letter], plain[COLOUR_PASS][..., index])
    np.testing.assert_array_equal(eye["Depth.Z"], plain[DEPTH_PASS][..., 0])


def test_target_is_near_blenders_own_right_eye(demo, plain_demo):
    """In the mean: the noise of a picture of 4 samples is large, that of its mean is not."""
    eye, plain = demo.eye("right"), plain_demo["right"][COLOUR_PASS]
    for index, letter in enumerate("RGB"):
        assert eye[letter].mean() == pytest.approx(plain[..., index].mean(), rel=0.05)


def test_stereo_exr_holds_both_eyes(demo):
    """A part for each pass and view; the first of each view has plain R, G, B and A."""
    with OpenEXR.File(str(demo.folder / "stereo.exr"), separate_channels=True) as file:
        parts = [
            (part.header["view"], {name: np.array(channel.pixels) for name, channel in part.channels.items()})
            for part in file.parts
        ]
    assert [(view, set(channels)) for view, channels in parts[:2]] == [("left", set("RGBA")), ("right", set("RGBA"))]
    for view in ("left", "right"):
        held = {
            name.removeprefix(f"{DEMO_LAYER}."): values
            for of, channels in parts
            if of == view
            for name, values in channels.items()
        }
        eye = demo.eye(view)
        assert set(held) == set(eye)
        for name, values in eye.items():
            np.testing.assert_array_equal(held[name], values)


def test_stereo_png_shows_both_eyes_through_the_view_transform(demo, tmp_path):
    scene = open_blend(DEMO)
    scene.render.dither_intensity = 0.0
    eyes = {view: np.stack([demo.eye(view)[letter] for letter in "RGBA"], axis=-1) for view in ("left", "right")}
    deliver_side_by_side(scene, eyes, tmp_path / "again.png")
    shown = read_png(demo.folder / "stereo.png")
    assert shown.shape == (54, 192, 3)
    np.testing.assert_allclose(shown, read_png(tmp_path / "again.png"), atol=DITHER)


def test_the_same_command_gives_the_same_pair(demo, tmp_path):
    again = render(DEMO, tmp_path / "out", *DEMO_OPTIONS, *REPEATABLE, "--quiet")
    assert (again.status, again.out, again.err) == (0, "", "")
    for view in ("left", "right"):
        for name, values in demo.eye(view).items():
            np.testing.assert_array_equal(again.eye(view)[name], values)


@pytest.mark.parametrize(
    ("accuracy", "fill", "others"),
    [
        ("draft", "packed", ["--interpolation", "cubic"]),
        ("preview", "card", ["--source", "right"]),
        ("balanced", "full", ["--mode", "toe-in"]),
        ("high", "auto", ["--grid-threshold", "0", "--frame", "3"]),
        ("exact", "packed", ["--mode", "parallel", "--source", "right"]),
        ("balanced", "packed", ["--packed-by", "portal", "--mode", "parallel"]),
    ],
)
def test_options(tmp_path, accuracy, fill, others):
    run = render(DEMO, tmp_path / "out", *DEMO_OPTIONS, "--accuracy", accuracy, "--fill", fill, *others)
    assert (run.status, run.err, run.files) == (0, "", FILES)
    report, given = run.report, dict(zip(others[::2], others[1::2], strict=True))
    assert report["accuracy"] == accuracy
    assert fill in ("auto", report["fill"]["method"])
    packed_by = given.get("--packed-by", "osl") if report["fill"]["method"] == "packed" else None
    assert report["fill"]["camera"] == packed_by
    assert report["stereo"]["source"] == given.get("--source", "left")
    assert report["stereo"]["convergence_mode"] == {"toe-in": "TOE", "parallel": "PARALLEL"}.get(
        given.get("--mode"), "OFFAXIS"
    )
    assert report["frame"] == int(given.get("--frame", 1))
    assert "compare" not in report


def test_a_scene_that_denoises_is_denoised_unless_told_otherwise(demo, tmp_path):
    options = [option for option in DEMO_OPTIONS if option != "--no-denoise"]
    clean = render(DEMO, tmp_path / "out", *options, *REPEATABLE, "--quiet")
    assert (clean.status, clean.err) == (0, "")
    assert clean.report["seconds"]["denoise_target"] > 0.0
    assert np.abs(np.diff(clean.eye("left")["R"])).mean() < 0.7 * np.abs(np.diff(demo.eye("left")["R"])).mean()


def test_no_distance_gives_two_equal_eyes(tmp_path):
    run = render(DEMO, tmp_path / "out", *DEMO_OPTIONS, "--interocular", "0", "--quiet")
    assert (run.status, run.out, run.err) == (0, "", "")
    assert set(run.report["fractions"].values()) == {0.0}
    left, right = run.eye("left"), run.eye("right")
    for letter in "RGBA":
        np.testing.assert_allclose(right[letter], left[letter], atol=1e-6)


def test_an_earlier_result_is_replaced(tmp_path, small_scene):
    blend = save(small_scene, tmp_path / "small.blend")
    (tmp_path / "out").mkdir()
    for name in (*FILES, "mine.txt"):
        (tmp_path / "out" / name).write_text("old")
    run = render(blend, tmp_path / "out", "--quiet")
    assert (run.status, run.files) == (0, sorted([*FILES, "mine.txt"]))
    assert {name for name in run.files if (run.folder / name).read_bytes() == b"old"} == {"mine.txt"}


AWKWARD = [
    "Räume und Größen",
    "back\\slash",
    "per%cent %04d",
    "#hash ###",
    "{brace} {blend_name}",
    "<UDIM>",
    "-dash",
]


@pytest.mark.parametrize("name", AWKWARD)
def test_a_folder_with_an_awkward_name(tmp_path, small_scene, name):
    """Blender reads more into some of them: frame numbers, path templates, tiles, separators."""
    (tmp_path / name).mkdir()
    blend = save(small_scene, tmp_path / name / f"{name}.blend")
    run = render(blend, tmp_path / name / "out", "--quiet", "--fill", "packed")
    assert (run.status, run.err, run.files) == (0, "", FILES)


def test_the_blend_file_is_left_alone(tmp_path, small_scene):
    blend = save(small_scene, tmp_path / "small.blend")
    blend.chmod(0o444)
    before = blend.read_bytes(), blend.stat().st_mtime_ns
    assert render(blend, tmp_path / "out", "--quiet").status == 0
    assert (blend.read_bytes(), blend.stat().st_mtime_ns) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "small.blend"]


def test_scripts_in_the_file_do_not_run(tmp_path, small_scene):
    text = bpy.data.texts.new("run.py")
    text.write(f"open({str(tmp_path / 'ran')!r}, 'w').close()")
    text.use_module = True
    blend = save(small_scene, tmp_path / "small.blend")
    assert render(blend, tmp_path / "out", "--quiet").status == 0
    assert not (tmp_path / "ran").exists()


# Engines and cameras


def test_eevee(tmp_path, small_scene):
    """Whichever way is the faster here."""
    small_scene.render.engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0, 0) else "BLENDER_EEVEE_NEXT"
    blend = save(small_scene, tmp_path / "eevee.blend")
    run = render(blend, tmp_path / "out", "--samples", "1")
    assert (run.status, run.err, run.files) == (0, "", FILES)
    assert "a second EEVEE render" in run.report["fill"]["reason"]
    assert (run.report["fill"]["method"] == "full") == (run.report["correction"] is None)
    left, right = run.eye("left"), run.eye("right")
    assert min(left["R"].mean(), right["R"].mean()) > 0.01
    assert np.abs(left["R"] - right["R"]).max() > 0.01


def eevee(scene):
    scene.render.engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0, 0) else "BLENDER_EEVEE_NEXT"


def eevee_orthographic(scene):
    eevee(scene)
    orthographic(scene)


def workbench(scene):
    scene.render.engine = "BLENDER_WORKBENCH"


def mirror_ball(scene):
    scene.camera.data.type, scene.camera.data.panorama_type = "PANO", "MIRRORBALL"


def without_camera(scene):
    bpy.data.objects.remove(scene.camera)


def layers_off(scene):
    scene.view_layers[0].use = False


def orthographic(scene):
    scene.camera.data.type = "ORTHO"


@pytest.mark.parametrize(
    ("change", "options", "part"),
    [
        (workbench, [], "BLENDER_WORKBENCH"),
        (mirror_ball, [], "panoramic mirror ball"),
        (without_camera, [], "no camera"),
        (layers_off, [], "view layer"),
        (orthographic, ["--fill", "packed", "--packed-by", "osl"], "orthographic"),
        (eevee_orthographic, ["--fill", "packed", "--packed-by", "osl"], "orthographic"),
    ],
)
def test_what_cannot_be_rendered_is_said_in_one_line(tmp_path, small_scene, change, options, part):
    change(small_scene)
    blend = save(small_scene, tmp_path / "small.blend")
    assert_refused(render(blend, tmp_path / "out", *options), "error: ", part)


# Files that are none, folders that take nothing


def cut_in_half(data):
    return data[: len(data) // 2]


def cut_after_the_header(data):
    return data[:24]


def without_its_end(data):
    return data[:-200]


def overwritten(data):
    return data[:64] + bytes(len(data) - 64)


def gzip_alone(data):
    return b"\x1f\x8b" + bytes(100)


def zstandard_alone(data):
    return b"\x28\xb5\x2f\xfd" + bytes(100)


@pytest.mark.parametrize(
    "damage", [cut_in_half, cut_after_the_header, without_its_end, overwritten, gzip_alone, zstandard_alone]
)
def test_a_damaged_file_is_one_line(tmp_path, small_scene, damage):
    blend = save(small_scene, tmp_path / "damaged.blend")
    blend.write_bytes(damage(blend.read_bytes()))
    assert_refused(render(blend, tmp_path / "out"), "error: ", "damaged.blend")


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs /proc, in which nobody can make a folder")
def test_an_output_that_cannot_be_made_is_one_line(small_scene, tmp_path):
    blend = save(small_scene, tmp_path / "small.blend")
    run = subprocess.run(
        command(blend, "/proc/out"), env=environment(), capture_output=True, text=True, timeout=SECONDS, check=False
    )
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.count("\n") == 1
    assert "/proc/out cannot be written" in run.stderr


# In which no picture fits, one render result, all but its last part, one eye, all but the legend of holes.png, and all
# but the last picture: how much a picture takes as PNG depends on the version.
DISK_SIZES = ["8k", "60k", "100k", "160k", "280k", "310k"]
NAMESPACE = ["unshare", "--mount"] if getattr(os, "geteuid", lambda: 1)() == 0 else ["unshare", "--mount", "-r"]


def in_small_disk(size, line, folder):
    """Run a line of shell with a file system of that size at `folder`, which is gone afterwards."""
    mount = f"mount -t tmpfs -o size={size} none {shlex.quote(str(folder))}"
    return subprocess.run(
        [*NAMESPACE, "sh", "-c", f"{mount} || exit 99; {line}"],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )


@pytest.fixture(scope="module")
def small_disks(tmp_path_factory):
    if shutil.which("unshare") is None or in_small_disk("8k", "true", tmp_path_factory.mktemp("disk")).returncode:
        pytest.skip("a file system cannot be mounted here: run as root")


@pytest.mark.parametrize("size", DISK_SIZES)
def test_a_full_disk_is_one_line(small_disks, tmp_path, size):
    disk = tmp_path / "disk"
    disk.mkdir()
    line = shlex.join(command(DEMO, disk / "out", *DEMO_OPTIONS))
    run = in_small_disk(size, f"{line}; echo status $?; ls -A {shlex.quote(str(disk))}", disk)
    assert run.stdout == "status 2\n", run.stderr
    message = run.stderr
    assert message.count("\n") == 1
    assert "full" in message or "No space left" in message


# Interruption


def until_it_shows(controller, word):
    """Read what a run shows on its terminal until `word` is there, or it ends."""
    shown = b""
    with contextlib.suppress(OSError):
        while word not in shown and (part := os.read(controller, 65536)):
            shown += part
    return shown


@posix
@pytest.mark.parametrize("stage", ["load", "source", "fill", "write"])
def test_an_interrupt_leaves_nothing(tmp_path, stage):
    import pty

    folder = tmp_path / "out"
    # Long enough to be met in the middle: some seconds each for the source and the fill.
    options = [*DEMO_OPTIONS, "--samples", "600" if stage in ("source", "fill") else "4", "--fill", "full"]
    controller, terminal = pty.openpty()
    process = subprocess.Popen(
        command(DEMO, folder, *options),
        env=environment(),
        stdin=subprocess.DEVNULL,
        stdout=terminal,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    with process:
        os.close(terminal)
        try:
            assert stage.encode() in until_it_shows(controller, stage.encode())
            assert workers_of(folder) != []
            process.send_signal(signal.SIGINT)
            until_it_shows(controller, b"\0")
            _, err = process.communicate(timeout=SECONDS)
        finally:
            process.kill()
            os.close(controller)
    assert process.returncode == 130
    assert "Traceback" not in err.decode()
    assert err.decode() == "stereo_reproject: interrupted; no result was written\n"
    assert not folder.exists()
    assert workers_of(folder) == []
