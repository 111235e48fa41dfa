"""The command line and the supervision of its worker, which a stub stands in for."""

import contextlib
import errno
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from stereo_reproject.errors import BadInputError, StereoReprojectError, in_one_line
from stereo_reproject.jobs import memory, supervisor, work_folder
from stereo_reproject.programs import cli
from stereo_reproject.sequence.journal_folder import JOURNAL
from stereo_reproject.settings.animation import AnimationSettings
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from stereo_reproject.settings.views import ViewsSettings

ROOT = Path(cli.__file__).resolve().parents[2]
STUB = Path(__file__).with_name("stub_worker.py")
SECONDS = 30.0

posix = pytest.mark.skipif(os.name != "posix", reason="signals and terminals as POSIX has them")

# The real entry point, with the worker replaced.
DRIVER = """
import sys
from stereo_reproject.jobs import worker_process
from stereo_reproject import __main__
from stereo_reproject.sequence.journal_folder import JOURNAL
worker, sys.argv[1:5] = sys.argv[1:5], []
worker_process.own_worker = lambda: worker
sys.exit(__main__.run())
"""


@pytest.fixture
def place(tmp_path):
    """A folder with a .blend (its first bytes, at least), and one for the stub's notes outside of it."""
    (tmp_path / "notes").mkdir()
    folder = tmp_path / "place"
    folder.mkdir()
    (folder / "room.blend").write_bytes(b"BLENDER-v502")
    return folder


def notes(place):
    return place.parent / "notes"


def stub(place, behaviour):
    return [sys.executable, str(STUB), behaviour, str(notes(place))]


def render(place, behaviour, *options, output="out/pair"):
    """Exit status of a run within this process."""
    argv = ["render", str(place / "room.blend"), "--output", str(place / output), *options]
    return cli.main(argv, host=cli.Host(worker_command=stub(place, behaviour)))


@pytest.fixture
def start(place):
    """Starts a run as a process of its own, by way of a line of shell if need be."""
    started = []

    def start_run(behaviour, *options, verb="render", by_way_of=None, stdout=subprocess.PIPE, unbuffered=""):
        argv = [verb, str(place / "room.blend"), "--output", str(place / "out/pair"), *options]
        command = [sys.executable, "-c", DRIVER, *stub(place, behaviour), *argv]
        if by_way_of is not None:
            command = ["sh", "-c", by_way_of, "sh", *command]
        environment = {
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "PYTHONWARNINGS": "error",
            "PYTHONUNBUFFERED": unbuffered,
        }
        process = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=stdout, stderr=subprocess.PIPE
        )
        started.append(process)
        return process

    yield start_run
    for process in started:
        with process:
            process.kill()
    for name in ("pid", "descendant"):
        if (notes(place) / name).exists() and runs(noted_pid(place, name)):
            os.kill(noted_pid(place, name), signal.SIGTERM if os.name == "nt" else signal.SIGKILL)


def run_module(*argv, folder=ROOT, path=()):
    """`python -m stereo_reproject` as a user types it."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (*path, ROOT)))}
    command = [sys.executable, "-m", "stereo_reproject", *map(str, argv)]
    return subprocess.run(
        command, env=environment, cwd=folder, capture_output=True, text=True, timeout=SECONDS, check=False
    )


def wait_until(condition):
    deadline = time.monotonic() + SECONDS
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def runs(pid):
    if not Path("/proc/self/stat").exists():
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, 0)
            return True
        return False
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):
        # Where no init reaps them, the dead stay as zombies.
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    return False


def noted_pid(place, name):
    return int((notes(place) / name).read_text())


def snapshot(folder):
    """Everything under the folder: path -> content, None for folders."""
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def assert_one_line(text, *parts):
    assert text.endswith("\n")
    assert text.count("\n") == 1
    assert text.startswith("stereo_reproject: ")
    for part in parts:
        assert part in text


# Success


def test_success_delivers_all_files_and_nothing_else(place, capsys):
    assert render(place, "success") == 0
    assert snapshot(place / "out" / "pair") == {name: f"new {name}".encode() for name in work_folder.FILES}
    printed = capsys.readouterr()
    assert "\r" not in printed.out
    assert "rerendered        6.00 %" in printed.out
    assert str(place / "out" / "pair") in printed.out
    assert_one_line(printed.err, "warning: two passes had to be left out")


def test_quiet_leaves_standard_output_empty(place, capsys):
    assert render(place, "success", "--quiet") == 0
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "warning" in printed.err


def test_job_as_the_worker_gets_it(place, monkeypatch):
    monkeypatch.chdir(place)
    options = "--frame -3 --size 64x32 --samples 4 --seed 0 --interocular 0 --convergence 2.5 --mode toe-in"
    options += " --source-engine cycles"
    options += " --source right --accuracy exact --fill card --grid-threshold 0.5 --interpolation cubic --compare"
    argv = ["render", "room.blend", "--output", "out", *options.split()]
    assert cli.main(argv, host=cli.Host(worker_command=stub(place, "success"))) == 0
    job = json.loads((notes(place) / "job").read_text())
    assert job["blend"] == str(place / "room.blend")
    assert job["output"] == str(place / "out")
    work = Path(job["work"])
    assert work.parent == place / "out"
    assert work.name.startswith(".stereo_reproject-")
    assert (notes(place) / "temporary").read_text() == str(work / "tmp")
    overrides = SceneOverrides(
        frame=-3,
        size=(64, 32),
        samples=4,
        seed=0,
        interocular_distance=0.0,
        convergence_distance=2.5,
        convergence_mode="toe-in",
        source_engine="cycles",
    )
    scene = {**job["settings"].pop("scene")}
    scene["size"] = tuple(scene["size"])
    settings = StereoSettings(**job["settings"], scene=SceneOverrides(**scene))
    assert settings == StereoSettings("right", "exact", "card", 0.5, "cubic", True, overrides)


@pytest.mark.parametrize(("option", "value"), [("--frames", "-5--3"), ("--output", "-dash")])
def test_how_a_value_that_begins_with_a_dash_is_given_is_said(place, capsys, option, value):
    assert cli.main(["animate", "room.blend", option, value]) == 2
    assert_one_line(capsys.readouterr().err, f"argument {option}: expected one argument", f"is given as {option}=-...)")


def test_a_value_that_begins_with_a_dash(place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    argv = ["animate", "room.blend", "--output=-dash"]
    assert cli.main([*argv, "--frames=1-2"], host=cli.Host(worker_command=stub(place, "animation"))) == 0
    assert json.loads((notes(place) / "job").read_text())["output"] == str(place / "-dash")
    capsys.readouterr()
    assert cli.main([*argv, "--frames=-5--3"]) == 2
    assert_one_line(capsys.readouterr().err, "argument --frames: frames must be from 0 to")


def test_what_frame_means_to_an_animation_is_in_its_help(place, capsys):
    assert cli.main(["animate", "--help"]) == 0
    assert "the one frame to render, as --frames N" in " ".join(capsys.readouterr().out.split())
    for option in ("--frame", "--frames"):
        assert animate(place, option, "7", "--overwrite") == 0
        assert json.loads((notes(place) / "job").read_text())["animation"]["frames"] == [7]


@pytest.mark.parametrize(
    ("options", "asked"), [([], None), (["--denoise"], True), (["--no-denoise", "--no-denoise"], False)]
)
def test_denoising_is_the_scene_s_own_unless_told(place, options, asked):
    assert render(place, "success", *options) == 0
    assert json.loads((notes(place) / "job").read_text())["settings"]["scene"]["denoise"] is asked


@pytest.mark.parametrize(
    ("options", "panorama", "size"),
    [
        ("--vr180", "vr180", [4096, 4096]),
        ("--vr180 512", "vr180", [512, 512]),
        ("--vr180 512x256", "vr180", [512, 256]),
        ("--vr180 --size 64x64", "vr180", [64, 64]),
        ("--vr360", "vr360", [8192, 4096]),
        ("--vr360=512", "vr360", [512, 256]),
        ("--size 64x64", None, [64, 64]),
    ],
)
@pytest.mark.parametrize("verb", ["render", "animate"])
def test_panoramas_and_their_sizes(place, verb, options, panorama, size):
    argv = [verb, str(place / "room.blend"), "--output", str(place / "out"), *options.split()]
    assert cli.main(argv, host=cli.Host(worker_command=stub(place, "error 2"))) == 2
    scene = json.loads((notes(place) / "job").read_text())["settings"]["scene"]
    assert (scene["panorama"], scene["size"]) == (panorama, size)


def test_a_difference_does_not_outlive_the_pair_that_it_is_of(place):
    argv = ["render", str(place / "room.blend"), "--output", str(place / "out")]
    assert cli.main([*argv, "--compare"], host=cli.Host(worker_command=stub(place, "success"))) == 0
    assert (place / "out" / "difference.png").read_text() == "new difference.png"
    assert cli.main(argv, host=cli.Host(worker_command=stub(place, "success"))) == 0
    assert sorted(path.name for path in (place / "out").iterdir()) == sorted(work_folder.FILES)


def test_tradeoff_takes_the_scene_and_leaves_accuracy_and_fill_to_its_runs(place, capsys):
    argv = [
        "tradeoff",
        str(place / "room.blend"),
        "--output",
        str(place / "out"),
        "--size",
        "64x32",
        "--source",
        "right",
    ]
    assert cli.main(argv, host=cli.Host(worker_command=stub(place, "error 2"))) == 2
    job = json.loads((notes(place) / "job").read_text())
    assert (job["command"], job["settings"]["source"]) == ("tradeoff", "right")
    assert job["settings"]["scene"]["size"] == [64, 32]
    capsys.readouterr()
    assert cli.main([*argv, "--accuracy", "high"], host=cli.Host(worker_command=stub(place, "success"))) == 2
    assert_one_line(capsys.readouterr().err, "--accuracy")


def test_what_is_left_out_comes_from_the_scene(place):
    assert render(place, "success") == 0
    job = json.loads((notes(place) / "job").read_text())
    assert job["settings"]["scene"].pop("mono") is False
    assert set(job["settings"]["scene"].values()) == {None}


def many_views(place, *options, behaviour="views"):
    argv = ["views", str(place / "room.blend"), "--output", str(place / "out"), *options]
    return cli.main(argv, host=cli.Host(worker_command=stub(place, behaviour)))


def views_job(place):
    job = json.loads((notes(place) / "job").read_text())
    return ViewsSettings(**job["views"]), job["settings"]


@pytest.mark.parametrize(
    ("options", "views", "size"),
    [
        ("", ViewsSettings(48, 40.0, columns=8, rows=6), None),
        ("--display Portrait", ViewsSettings(48, 40.0, None, None, 8, 6, 0.75, "portrait"), [420, 560]),
        ("--display go --size 64x32", ViewsSettings(66, 54.0, None, None, 11, 6, 0.5625, "go"), [64, 32]),
        (
            "--display go --views 20 --cone 10 --quilt 5x4 --aspect 1",
            ViewsSettings(20, 10.0, None, None, 5, 4, 1.0, "go"),
            [818, 1023],
        ),
        ("--views 45 --baseline 0.5 --focus 2", ViewsSettings(45, None, 0.5, 2.0, 9, 5), None),
        ("--quilt 4x3 --size 64x32", ViewsSettings(12, 40.0, columns=4, rows=3), [64, 32]),
        ("--views 12 --fresh 0.25", ViewsSettings(12, 40.0, columns=4, rows=3, fresh=0.25), None),
        ("--layout multi-view", ViewsSettings(48, 40.0, columns=8, rows=6, layout="multi-view"), None),
        ("--from-scene --size 64x32", ViewsSettings(0, from_scene=True), [64, 32]),
        (
            "--from-scene --quilt 2x2 --aspect 2 --layout Multi-View",
            ViewsSettings(0, columns=2, rows=2, aspect=2.0, from_scene=True, layout="multi-view"),
            None,
        ),
    ],
)
def test_views_as_the_worker_gets_them(place, options, views, size):
    assert many_views(place, *options.split()) == 0
    told, settings = views_job(place)
    assert told == views
    assert settings["scene"]["size"] == size


def test_views_take_what_a_picture_has_and_nothing_that_only_a_pair_has(place, capsys):
    options = "--frame 7 --samples 4 --seed 3 --denoise --accuracy high --packed-by portal --compare --strict"
    assert many_views(place, *options.split()) == 0
    settings = views_job(place)[1]
    scene = SceneOverrides(**settings.pop("scene"))
    assert scene == SceneOverrides(frame=7, samples=4, seed=3, denoise=True)
    assert StereoSettings(**settings, scene=scene) == StereoSettings(
        accuracy="high", packed_by="portal", compare=True, scene=scene
    )
    capsys.readouterr()
    for option in ("--interocular=1", "--convergence=1", "--vr180", "--source=left", "--fill=card"):
        assert many_views(place, option) == 2
        assert_one_line(capsys.readouterr().err, "unrecognized arguments: --")


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ("--views 1", "argument --views: the number of views must be from 2 to 256, not 1"),
        ("--fresh 1.5", "argument --fresh: the fresh share must be at most 1, not 1.5"),
        ("--fresh -1", "argument --fresh: the fresh share must be at least 0, not -1"),
        ("--views 1e2", "argument --views: must be a whole number"),
        ("--cone 180", "argument --cone: the cone must be below 180 degrees"),
        ("--cone nan", "argument --cone: the cone must be a finite number"),
        ("--baseline 0", "argument --baseline: the baseline must be above 0"),
        ("--focus -1", "argument --focus: the focus distance must be above 0"),
        ("--cone 40 --baseline 1", "argument --baseline: not allowed with argument --cone"),
        ("--quilt 8", "argument --quilt: the quilt must be of the form COLUMNSxROWS"),
        ("--quilt 2x2 --views 9", "a quilt of 2 x 2 must have a place for each of the 9 views"),
        ("--quilt 1x1", "the number of views must be from 2 to 256, not 1"),
        ("--quilt 999x999", "the number of views must be from 2 to 256"),
        ("--display 27", "argument --display: invalid choice: '27'"),
        ("--aspect 0", "argument --aspect: the aspect must be at least 0.01"),
        ("--frames 3-1", "argument --frames: frames 3-1 are none"),
        ("--frames 1-3 --frame 2", "--frame and --frames each say which frames are rendered"),
        ("--frames 1-3 --resume --overwrite", "argument --overwrite: not allowed with argument --resume"),
        ("--frames 1-3 --compare", "--compare is for one frame alone: leave it out with --frames"),
        ("--frames 1-3 --from-scene --movie", "--movie shows quilts, and the scene's own views have one with --quilt"),
        ("--frames 1-3 --layout multi-view --view-files", "--view-files has each view in a file of its own"),
        ("--frame 3 --resume", "--resume is for several frames: name them by --frames"),
        ("--overwrite", "--overwrite is for several frames: name them by --frames"),
        ("--movie", "--movie is for several frames: name them by --frames"),
        ("--view-files", "--view-files is for several frames: name them by --frames"),
        ("--layout side-by-side", "argument --layout: invalid choice: 'side-by-side'"),
        *(
            (f"--from-scene {option}", "leave --views, --cone, --baseline, --focus and --display out")
            for option in ("--views 4", "--cone 20", "--baseline 1", "--focus 2", "--display go")
        ),
    ],
)
def test_bad_options_of_views_are_said_in_one_line(place, capsys, options, part):
    assert many_views(place, *options.split()) == 2
    assert_one_line(capsys.readouterr().err, part)
    assert not (place / "out").exists()


def test_views_are_delivered_with_their_quilt_and_said_in_short(place, capsys):
    assert many_views(place, "--views", "12") == 0
    views = [f"views/view_{k:02d}.exr" for k in range(12)]
    quilts = ["quilt_qs4x3a0.75.exr", "quilt_qs4x3a0.75.png"]
    names = [*quilts, *views, "contact.png", "sweep.mp4", "report.json"]
    found = {name: content for name, content in snapshot(place / "out").items() if content is not None}
    assert json.loads(found.pop("report.json"))["files"] == [*quilts[::-1], *names[2:]]
    assert found == {name: f"new {name}".encode() for name in names[:-1]}
    printed = capsys.readouterr().out
    assert "12 views" in printed
    shown = f"{', '.join(quilts[::-1])}, {views[0]} to {views[-1]}, contact.png, sweep.mp4, report.json"
    assert printed.endswith(f"  {shown}\n")


def test_the_scenes_own_views_are_delivered_by_their_names(place, capsys):
    assert many_views(place, "--from-scene") == 0
    names = ["views/left.exr", "views/far right.exr", "contact.png", "sweep.mp4", "report.json"]
    assert sorted(names) == sorted(name for name, text in snapshot(place / "out").items() if text is not None)
    shown = "views/left.exr to views/far right.exr, contact.png, sweep.mp4, report.json"
    assert capsys.readouterr().out.endswith(f"  {shown}\n")
    assert many_views(place, "--views", "2", "--layout", "multi-view") == 0
    assert (place / "out" / "views.exr").exists()
    assert not (place / "out" / "views").exists()


def test_fewer_views_than_before_leave_none_of_those(place):
    assert many_views(place, "--views", "12") == 0
    assert many_views(place, "--views", "6") == 0
    quilts = sorted(path.name for path in (place / "out").glob("quilt_*"))
    assert quilts == ["quilt_qs3x2a0.75.exr", "quilt_qs3x2a0.75.png"]
    assert len(list((place / "out" / "views").iterdir())) == 6


def test_views_that_are_not_whole_leave_nothing(place, capsys):
    assert many_views(place, behaviour="views without a sweep") == 1
    assert_one_line(capsys.readouterr().err, "did not write sweep.mp4")
    assert not (place / "out").exists()


@pytest.mark.parametrize("magic", [b"BLENDER17-01v0500", b"\x1f\x8b\x08\x00", b"\x28\xb5\x2f\xfd\x00"])
def test_compressed_scenes_are_scenes(place, magic):
    (place / "room.blend").write_bytes(magic)
    assert render(place, "success") == 0


def test_files_of_an_earlier_run_are_replaced_and_others_stay(place):
    output = place / "out" / "pair"
    output.mkdir(parents=True)
    (output / "left.exr").write_text("old")
    (output / "mine.txt").write_text("mine")
    assert render(place, "success") == 0
    assert (output / "left.exr").read_text() == "new left.exr"
    assert sorted(path.name for path in output.iterdir()) == sorted((*work_folder.FILES, "mine.txt"))


@posix
def test_delivered_files_have_ordinary_permissions(place):
    assert render(place, "success") == 0
    mask = os.umask(0)
    os.umask(mask)
    assert (place / "out" / "pair" / "left.exr").stat().st_mode & 0o777 == 0o666 & ~mask


@pytest.mark.parametrize("behaviour", ["success, then hangs", "success, then dies"])
def test_how_the_worker_ends_after_done_changes_nothing(place, monkeypatch, behaviour):
    monkeypatch.setattr(supervisor, "EXIT_SECONDS", 0.3)
    assert render(place, behaviour) == 0
    assert sorted(snapshot(place / "out" / "pair")) == sorted(work_folder.FILES)
    assert not runs(noted_pid(place, "pid"))


# Failure


@pytest.mark.parametrize(
    ("behaviour", "status", "parts"),
    [
        ("error 1", 1, ["error: the source eye came out empty: check the scene"]),
        ("error 2", 2, ["error: room.blend has no camera; add one"]),
        ("exit 3", 1, ["unexpectedly (exit status 3) during fill", "; last in its log: ModuleNotFoundError"]),
        ("incomplete", 1, ["did not write stereo.png"]),
        pytest.param(
            "segmentation fault",
            1,
            ["(SIGSEGV) during fill; nothing was written, and existing files are kept; last in its log: Device 0"],
            marks=posix,
        ),
        pytest.param(
            "killed",
            1,
            ["signal 9 (SIGKILL) during fill; something outside", "; nothing was written, and existing files"],
            marks=posix,
        ),
        pytest.param("descendant keeps the pipe", 1, ["exit status 4"], marks=posix),
    ],
)
def test_failure_is_one_line_and_leaves_nothing(place, capsys, behaviour, status, parts):
    before = snapshot(place)
    assert render(place, behaviour) == status
    assert snapshot(place) == before
    printed = capsys.readouterr()
    assert printed.out == ""
    assert_one_line(printed.err, *parts)


@posix
def test_of_a_killed_blender_nothing_stays_in_the_journal(place, capsys):
    journal = place / "out" / JOURNAL
    journal.mkdir(parents=True)
    with subprocess.Popen([sys.executable, "-c", ""]) as gone:
        pass
    facts = json.dumps({"machine": work_folder.machine(), "pid": gone.pid})
    (journal / f"run-{'a' * 16}").write_text(f"{facts}\n{0:020}")
    (journal / f".run-{'b' * 16}.tmp").write_text("{")
    (journal / "0001.json").write_text("{}")
    assert animate(place, "--frames", "1-3", behaviour="segmentation fault") == 1
    assert [path.name for path in journal.iterdir()] == ["0001.json"]
    assert "SIGSEGV" in capsys.readouterr().err


@posix
@pytest.mark.parametrize(
    ("command", "output", "words"),
    [
        ("render", "out", "; nothing was written, and existing files are kept"),
        ("animate", "out", "; frames that are finished are kept"),
        ("views", "out", "; frames that are finished are kept"),
        ("inspect", None, ""),
    ],
)
def test_of_a_killed_blender_its_files_are_told_and_not_its_log(place, command, output, words):
    frames = AnimationSettings() if command in ("animate", "views") else None
    settings, output = StereoSettings(), output and place / output
    job = supervisor.Job(place / "room.blend", output, settings, command, files=(), animation=frames)
    with pytest.raises(StereoReprojectError) as raised:
        supervisor.run_worker(job, lambda _: None, command=stub(place, "killed"))
    told = (
        "Blender was killed by signal 9 (SIGKILL) during fill; something outside of it has done that;"
        " if memory ran out, render smaller, or free some"
    )
    assert str(raised.value) == told + words


GROUPS = {
    "version 2": ("0::/user.slice/a:b\n", "sys/fs/cgroup/user.slice/a:b/memory.events"),
    "version 1": ("5:cpu:/\n4:memory:/job\n0::/\n", "sys/fs/cgroup/memory/job/memory.oom_control"),
    "none": ("", "proc/vmstat"),
}


@posix
@pytest.mark.parametrize("groups", GROUPS)
@pytest.mark.parametrize(("behaviour", "words"), [("killed for memory", "memory has run out"), ("killed", "outside")])
def test_memory_has_run_out_where_the_kernel_says_so(place, capsys, monkeypatch, groups, behaviour, words):
    told, counter = GROUPS[groups]
    system = notes(place) / "system"
    for name, text in (("proc/self/cgroup", told), ("proc/vmstat", "oom_kill 7\n"), (counter, "oom 3\noom_kill 3\n")):
        (system / name).parent.mkdir(parents=True, exist_ok=True)
        (system / name).write_text(text)
    (notes(place) / "counter").write_text(str(system / counter))
    monkeypatch.setattr(memory, "SYSTEM", system)
    assert render(place, behaviour) == 1
    assert_one_line(capsys.readouterr().err, "(SIGKILL) during fill", words)


@posix
def test_a_limit_of_memory_is_named_when_blender_falls_over(place, start):
    process = start("segmentation fault", by_way_of='ulimit -v 4000000; exec "$@"')
    _, err = process.communicate(timeout=SECONDS)
    assert process.returncode == 1
    assert_one_line(err.decode(), "(SIGSEGV) during fill; if its memory is limited (ulimit -v), allow it more")


@pytest.mark.parametrize("why", ["failed to map segment from shared object", "cannot map zero-fill pages"])
def test_a_library_that_finds_no_room_is_no_defect(why):
    told = in_one_line(ImportError(f"libembree4.so.4: {why}"))
    assert "libembree4" in str(told)
    assert "ulimit -v" in str(told)
    assert "defect" not in str(told)


@posix
def test_a_path_relative_to_a_folder_that_is_gone_is_said(place, tmp_path, monkeypatch, capsys):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    assert cli.main(["render", "room.blend", "--output", str(place / "out")]) == 2
    assert_one_line(capsys.readouterr().err, "room.blend is relative to a folder that is gone")


def test_a_name_that_is_no_utf8_is_no_defect():
    with pytest.raises(UnicodeDecodeError) as caught:
        b"Stra\xdfe".decode()
    told = in_one_line(caught.value)
    assert told.exit_status == 2
    assert "Stra\\xdfe" in str(told)


@posix
@pytest.mark.parametrize("behaviour", ["error 2", "killed"])
def test_a_folder_that_is_removed_under_way_is_said(place, behaviour):
    output = place / "out"

    def on_event(event):
        if event.get("stage") == "load":
            shutil.rmtree(output)

    job = supervisor.Job(place / "room.blend", output, StereoSettings())
    with pytest.raises(BadInputError) as raised:
        supervisor.run_worker(job, on_event, command=stub(place, behaviour))
    assert str(raised.value) == f"what the run had in {output} was removed under way; run it again"
    assert not output.exists()


@posix
def test_descendants_of_a_dead_worker_are_ended(place):
    assert render(place, "descendant keeps the pipe") == 1
    wait_until(lambda: not runs(noted_pid(place, "descendant")))


def test_failure_leaves_an_output_folder_that_was_there(place):
    (place / "out" / "pair").mkdir(parents=True)
    (place / "out" / "pair" / "left.exr").write_text("old")
    before = snapshot(place)
    assert render(place, "error 1") == 1
    assert snapshot(place) == before


def test_worker_that_cannot_be_started(place, capsys):
    before = snapshot(place)
    argv = ["render", str(place / "room.blend"), "--output", str(place / "out")]
    assert cli.main(argv, host=cli.Host(worker_command=[str(place / "nothing")])) == 1
    assert_one_line(capsys.readouterr().err, "could not be started")
    assert snapshot(place) == before


# Bad input

BAD_OPTIONS = [
    ("--size 960", "--size"),
    ("--size 0x540", "the width must be from"),
    ("--size 960x540x3", "--size"),
    ("--size -960x540", "--size"),
    ("--size 99999999x2", "the width must be from"),
    ("--samples 0", "--samples: samples must be from 1"),
    ("--samples 1.5", "--samples: must be a whole number, not '1.5'"),
    ("--samples many", "--samples"),
    ("--samples 1_0", "--samples"),
    ("--seed -1", "--seed"),
    ("--frame one", "--frame"),
    ("--frame 99999999999999999999999", "--frame"),
    ("--interocular nan", "--interocular: the interocular distance must be a finite number"),
    ("--interocular inf", "--interocular"),
    ("--interocular -0.1", "--interocular: the interocular distance must be at least 0"),
    ("--convergence 0", "--convergence: the convergence distance must be above 0"),
    ("--convergence -1", "--convergence"),
    ("--convergence x", "--convergence: must be a number"),
    ("--mode cross-eyed", "off-axis"),
    ("--source middle", "left"),
    ("--accuracy perfect", "balanced"),
    ("--fill half", "packed"),
    ("--interpolation nearest", "cubic"),
    ("--vr180 --vr360", "--vr360: not allowed with argument --vr180"),
    ("--vr360=64 --vr180=64", "--vr180: not allowed with argument --vr360"),
    ("--vr180 3", "--vr180: the width must be from 4 to 65536, not 3"),
    ("--vr360 6", "--vr360: the height must be from 4 to 65536, not 3"),
    ("--vr180 64x2", "--vr180: the height must be from 4"),
    ("--vr360 65", "--vr360: must be an even number or WIDTHxHEIGHT, such as 8192 or 8192x4096"),
    ("--vr180 half.blend", "(the scene comes before it), not 'half.blend'"),
    ("--vr180 64 --size 64x64", "--size and --vr180 each say how large an eye is: leave one of the sizes out"),
    ("--denoise --no-denoise", "--no-denoise: not allowed with argument --denoise"),
    ("--no-denoise --denoise", "--denoise: not allowed with argument --no-denoise"),
    ("--grid-threshold nan", "--grid-threshold"),
    ("--grid-threshold -1", "--grid-threshold"),
    ("--samples", "--samples"),
    ("--sampels 4", "--sampels"),
    ("--sample 4", "--sample"),
    ("more.blend", "more.blend"),
]


@pytest.mark.parametrize(("options", "part"), BAD_OPTIONS)
def test_bad_option_is_one_line(place, capsys, options, part):
    before = snapshot(place)
    assert render(place, "success", *options.split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert_one_line(printed.err, "error: ", part)
    assert snapshot(place) == before
    assert not (notes(place) / "pid").exists()


@pytest.mark.parametrize(
    "argv", [[], ["rendr"], ["render"], ["render", "room.blend"], ["render", "--output", "x"], ["-x"]]
)
def test_incomplete_command_is_one_line(argv, capsys):
    assert cli.main(argv) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert_one_line(printed.err, "error: ", "--help")


def make_bad_scene(folder, kind):
    scene = folder / "bad.blend"
    match kind:
        case "empty":
            scene.touch()
        case "text":
            scene.write_text("not a scene")
        case "folder":
            scene.mkdir()
        case "pipe":
            os.mkfifo(scene)
        case "behind a file":
            return folder / "room.blend" / "bad.blend"
        case "without a name":
            return ""
        case "awkward name":
            return folder / "two\nlines \x1b[31m.blend"
        case "unreadable":
            scene.write_bytes(b"BLENDER")
            scene.chmod(0)
    return scene


not_root = pytest.mark.skipif(getattr(os, "geteuid", lambda: 0)() == 0, reason="permissions do not bind root")


@pytest.mark.parametrize(
    ("kind", "part"),
    [
        ("missing", "does not exist"),
        ("empty", "not a .blend"),
        ("text", "not a .blend"),
        ("folder", "is a folder"),
        pytest.param("pipe", "not a regular file", marks=posix),
        ("behind a file", "does not exist"),
        ("without a name", "is a folder"),
        ("awkward name", "does not exist"),
        pytest.param("unreadable", "cannot be read", marks=[posix, not_root]),
    ],
)
def test_bad_scene_is_one_line(place, capsys, kind, part):
    scene = make_bad_scene(place, kind)
    assert cli.main(["render", str(scene), "--output", str(place / "out")]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert_one_line(printed.err, "error: ", part)
    assert "\x1b" not in printed.err
    assert not (place / "out").exists()


@pytest.mark.parametrize(
    ("output", "part"),
    [
        ("room.blend", "is not a folder"),
        ("room.blend/out", "is not a folder"),
        ("taken", "left.exr is a folder"),
        ("x" * 300, "cannot be written"),
        ("made/on/the/way/" + "x" * 300, "cannot be written"),
        pytest.param("locked/out", "cannot be written", marks=[posix, not_root]),
        pytest.param("locked", "cannot be written", marks=[posix, not_root]),
    ],
)
def test_bad_output_is_one_line(place, capsys, output, part):
    (place / "taken" / "left.exr").mkdir(parents=True)
    (place / "locked").mkdir(mode=0o500)
    before = snapshot(place)
    assert render(place, "success", output=output) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert_one_line(printed.err, "error: ", part, "another folder")
    assert snapshot(place) == before
    assert not (notes(place) / "pid").exists()


def test_empty_output_is_refused(place, capsys, monkeypatch):
    monkeypatch.chdir(place)
    assert cli.main(["render", "room.blend", "--output", ""]) == 2
    assert_one_line(capsys.readouterr().err, "--output is empty")


def test_full_disk_at_the_start_is_one_line(place, capsys, monkeypatch):
    def no_space(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = snapshot(place)
    monkeypatch.setattr(tempfile, "mkdtemp", no_space)
    assert render(place, "success") == 2
    assert_one_line(capsys.readouterr().err, "the disk is full")
    assert snapshot(place) == before


def intrude_on_rename(monkeypatch, number, intrusion):
    """Have `intrusion` called before the rename of that number, counted from 0 over the delivery of a result."""
    replace, count = pathlib.Path.replace, iter(range(1000))

    def intruding(self, target):
        if next(count) == number:
            intrusion()
        return replace(self, target)

    monkeypatch.setattr(pathlib.Path, "replace", intruding)


def fail_for_space():
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def send_interrupt():
    os.kill(os.getpid(), signal.SIGINT)


# With two files of an earlier run, those two are moved out before the new ones are moved in.
RENAMES = 2 + len(work_folder.FILES)


@pytest.mark.parametrize("number", range(RENAMES))
@pytest.mark.parametrize(
    ("intrusion", "status", "part"),
    [(fail_for_space, 2, "disk is full"), pytest.param(send_interrupt, 130, "interrupted", marks=posix)],
    ids=["full disk", "Ctrl-C"],
)
def test_delivery_is_all_or_nothing(place, capsys, monkeypatch, number, intrusion, status, part):
    output = place / "out" / "pair"
    output.mkdir(parents=True)
    for name in ("left.exr", "report.json"):
        (output / name).write_text(f"old {name}")
    before = snapshot(place)
    intrude_on_rename(monkeypatch, number, intrusion)
    assert render(place, "success", "--quiet") == status
    assert snapshot(place) == before
    assert part in capsys.readouterr().err


def test_a_report_never_stands_beside_files_that_are_not_its_own(place, monkeypatch):
    output = place / "out" / "pair"
    output.mkdir(parents=True)
    for name in work_folder.FILES:
        (output / name).write_text("old")
    replace = pathlib.Path.replace

    def watching(self, target):
        result = replace(self, target)
        contents = [path.read_text().partition(" ")[0] for path in output.iterdir() if path.is_file()]
        if (output / "report.json").exists():
            assert contents in (["old"] * len(work_folder.FILES), ["new"] * len(work_folder.FILES))
        return result

    monkeypatch.setattr(pathlib.Path, "replace", watching)
    assert render(place, "success") == 0
    assert (output / "report.json").read_text() == "new report.json"


# Interruption


@posix
@pytest.mark.parametrize(
    ("behaviour", "signum", "status"),
    [
        ("silent", signal.SIGINT, 130),
        ("waits", signal.SIGINT, 130),
        ("waits", signal.SIGTERM, 143),
        ("waits", signal.SIGHUP, 129),
        ("stubborn", signal.SIGINT, 130),
        ("success, then hangs", signal.SIGINT, 130),
    ],
)
def test_interrupted_run_leaves_nothing(place, behaviour, signum, status, start):
    before = snapshot(place)
    process = start(behaviour)
    wait_until((notes(place) / "ready").exists)
    process.send_signal(signum)
    out, err = process.communicate(timeout=SECONDS)
    assert process.returncode == status
    assert out == b""
    assert_one_line(err.decode(), "no result was written")
    assert snapshot(place) == before
    assert not runs(noted_pid(place, "pid"))
    if behaviour == "stubborn":
        wait_until(lambda: not runs(noted_pid(place, "descendant")))


@posix
def test_impatient_user_interrupts_many_times(place, start):
    before = snapshot(place)
    process = start("stubborn")
    wait_until((notes(place) / "ready").exists)
    while process.poll() is None:
        process.send_signal(signal.SIGINT)
        time.sleep(0.002)
    out, err = process.communicate(timeout=SECONDS)
    # The entry point may be past caring about signals by then, but it neither fails nor tells twice.
    assert process.returncode == 130
    assert out == b""
    assert_one_line(err.decode())
    assert snapshot(place) == before


@posix
def test_nohup_outlives_its_terminal(place, start):
    process = start("waits", by_way_of="trap '' HUP; exec \"$@\"")
    wait_until((notes(place) / "ready").exists)
    process.send_signal(signal.SIGHUP)
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(0.5)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=SECONDS)
    assert process.returncode == 130


@posix
def test_in_the_background_of_a_script_an_interrupt_that_is_meant_for_it_ends_a_run(place, start):
    process = start("waits", by_way_of="trap '' INT; exec \"$@\"")
    wait_until((notes(place) / "ready").exists)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=SECONDS)
    assert process.returncode == 130
    assert_one_line(err.decode(), "no result was written")


@posix
def test_interrupt_while_modules_load(place, tmp_path):
    shim = tmp_path / "shim"
    shim.mkdir()
    (shim / "argparse.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nwhile True: pass\n")
    finished = run_module("render", place / "room.blend", "--output", place / "out", path=[shim])
    assert finished.returncode == 130
    assert finished.stderr == ""


@posix
def test_signal_handlers_are_put_back(place):
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    assert render(place, "error 1") == 1
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)] == before


@posix
def test_worker_learns_of_a_killed_parent_and_the_next_run_cleans_up(place, start):
    process = start("waits")
    wait_until((notes(place) / "ready").exists)
    process.kill()
    process.communicate(timeout=SECONDS)
    wait_until((notes(place) / "end of input").exists)
    output = place / "out" / "pair"
    assert [path.name.startswith(".stereo_reproject-") for path in output.iterdir()] == [True]
    assert render(place, "success") == 0
    assert sorted(snapshot(output)) == sorted(work_folder.FILES)


def left_over(output, name, pid=None, age=0.0):
    folder = output / f"{work_folder.WORK_PREFIX}{name}"
    (folder / "out").mkdir(parents=True)
    if pid is not None:
        (folder / "pid").write_text(pid)
    os.utime(folder, (time.time() - age,) * 2)
    return folder


def test_only_work_folders_of_dead_runs_are_removed(place):
    output = place / "out" / "pair"
    finished = subprocess.Popen([sys.executable, "-c", ""])
    finished.wait()
    # No Popen is under way while `render` works, so that number is not given out again.
    dead = left_over(output, "dead", str(finished.pid))
    nameless_old = left_over(output, "nameless-old", age=3600)
    nameless_new = left_over(output, "nameless-new")
    digest = work_folder._machine_digest()
    cut_short = left_over(output, f"{finished.pid}-{digest}-x")
    starting = left_over(output, f"{os.getppid()}-{digest}-x")
    starting_elsewhere = left_over(output, f"{finished.pid}-0{digest[1:]}x-x")
    elsewhere = left_over(output, "elsewhere", f"{finished.pid}\nanother-machine.invalid\n")
    alive = left_over(output, "alive", str(os.getppid()))
    recycled = left_over(output, "recycled", str(os.getpid()))
    (output / "stereo_reproject-mine").mkdir()
    assert render(place, "success") == 0
    assert {path: path.exists() for path in (dead, nameless_old, recycled, cut_short)} == dict.fromkeys(
        (dead, nameless_old, recycled, cut_short), False
    )
    for path in (nameless_new, starting, starting_elsewhere, elsewhere, alive, output / "stereo_reproject-mine"):
        assert path.exists(), path


# Terminal and pipes


def through_terminal(start, behaviour, *options, verb="render"):
    """What a run shows on a terminal 100 columns wide: its standard output, its standard error and the status."""
    import pty

    controller, terminal = pty.openpty()
    process = start(behaviour, *options, verb=verb, stdout=terminal)
    os.close(terminal)
    shown = b""
    with contextlib.suppress(OSError):
        while part := os.read(controller, 65536):
            shown += part
    os.close(controller)
    _, err = process.communicate(timeout=SECONDS)
    return shown.decode(), err.decode(), process.returncode


@posix
def test_terminal_shows_one_line_per_stage(place, monkeypatch, start):
    monkeypatch.setenv("COLUMNS", "100")
    shown, err, status = through_terminal(start, "announces stages slowly")
    assert (status, err) == (0, "")
    lines = shown.split("\r\n")
    load, fill = (line.split("\r")[-1] for line in lines[:2])
    assert re.fullmatch(r"load +[\d.]+ s *", load)
    assert re.fullmatch(r"fill +\[#{24}\] 100 % +[\d.]+ s *", fill)
    assert "fill       [############------------]  50 %" in lines[1]
    assert " 88 %" not in shown, "samples of the stage before"
    assert "12 of 24 samples" in lines[1]
    assert lines[2].startswith("room.blend")
    assert max(len(part) for line in lines[:2] for part in line.split("\r")) < 100


@posix
def test_progress_fits_a_narrow_terminal(place, monkeypatch, start):
    monkeypatch.setenv("COLUMNS", "30")
    shown, _, _ = through_terminal(start, "announces stages slowly")
    assert max(len(part) for line in shown.split("\r\n")[:2] for part in line.split("\r")) < 30


@posix
def test_quiet_terminal_stays_clean(place, start):
    assert through_terminal(start, "announces stages slowly", "--quiet") == ("", "", 0)


@posix
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_closed_pipe_is_no_failure(place, start, unbuffered):
    reader, writer = os.pipe()
    os.close(reader)
    process = start("success", stdout=writer, unbuffered=unbuffered)
    os.close(writer)
    _, err = process.communicate(timeout=SECONDS)
    assert process.returncode == 0
    assert_one_line(err.decode(), "warning")
    assert (place / "out" / "pair" / "report.json").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_summary_that_cannot_be_written_is_told(place, start, unbuffered):
    with Path("/dev/full").open("wb") as full:
        process = start("announces stages slowly", stdout=full, unbuffered=unbuffered)
        _, err = process.communicate(timeout=SECONDS)
    assert process.returncode == 1
    assert_one_line(err.decode(), "standard output cannot be written")
    assert (place / "out" / "pair" / "report.json").exists()


@posix
def test_closed_standard_streams_are_no_failure(place, start):
    process = start("announces stages slowly", by_way_of='exec "$@" >&- 2>&-')
    process.communicate(timeout=SECONDS)
    assert process.returncode == 0


# As a user types it


def test_module_reports_bad_input(place):
    finished = run_module("render", place / "missing.blend", "--output", place / "out", folder=place)
    assert finished.returncode == 2
    assert finished.stdout == ""
    assert_one_line(finished.stderr, "missing.blend does not exist")
    assert not (place / "out").exists()


def test_module_tells_its_version():
    manifest = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    number = re.search(r'^version = "(.+)"', manifest, re.MULTILINE)[1]
    finished = run_module("--version")
    assert (finished.returncode, finished.stdout, finished.stderr) == (0, f"stereo_reproject {number}\n", "")


@pytest.mark.parametrize("argv", [["-h"], ["render", "-h"]])
def test_module_explains_itself(argv):
    finished = run_module(*argv)
    assert (finished.returncode, finished.stderr) == (0, "")
    assert finished.stdout.startswith("usage: python -m stereo_reproject")


@posix
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("option", ["--version", "--help"])
def test_nobody_reads_the_answer(option, unbuffered):
    reader, writer = os.pipe()
    os.close(reader)
    finished = subprocess.run(
        [sys.executable, "-m", "stereo_reproject", option],
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": unbuffered},
        stdout=writer,
        stderr=subprocess.PIPE,
        check=False,
    )
    os.close(writer)
    assert (finished.returncode, finished.stderr) == (0, b"")


def test_parent_process_never_imports_blender(place):
    code = (
        "import sys; from stereo_reproject.programs import cli; sys.exit(not {'bpy', 'numpy'}.isdisjoint(sys.modules))"
    )
    finished = subprocess.run([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": str(ROOT)}, check=False)
    assert finished.returncode == 0


# Inspecting


def inspect(place, *options, behaviour="inspection"):
    """Exit status of an inspection within this process."""
    argv = ["inspect", str(place / "room.blend"), *options]
    return cli.main(argv, host=cli.Host(worker_command=stub(place, behaviour)))


def test_an_inspection_is_printed_as_a_table_and_leaves_nothing(place, capsys):
    before = sorted(place.iterdir())
    assert inspect(place) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith("room, frame 1, 64x32, 4 samples, balanced, CYCLES on CPU\n")
    assert "curves 'Fur" in printed.out
    assert printed.err == "stereo_reproject: warning: the scene denoises\n"
    assert sorted(place.iterdir()) == before
    assert not Path((notes(place) / "temporary").read_text()).exists()


def test_an_inspection_as_json_is_nothing_but_json(place, capsys):
    assert inspect(place, "--json") == 0
    printed = capsys.readouterr()
    assert printed.out.isascii()
    assert json.loads(printed.out)["effects"][0]["by"] == ["curves 'Fur \u00e4'"]
    assert printed.err == "stereo_reproject: warning: the scene denoises\n"


@pytest.mark.parametrize(("options", "command"), [([], "inspect"), (["--no-sketch"], "plan")])
def test_what_an_inspection_asks_of_the_worker(place, options, command):
    assert inspect(place, *options, "--size", "64x32", "--accuracy", "high", "--fill", "card", "--seed", "7") == 0
    job = json.loads((notes(place) / "job").read_text())
    assert job["command"] == command
    assert job["output"] is None
    assert job["settings"]["scene"] == {**vars(SceneOverrides()), "size": [64, 32], "seed": 7}
    assert (job["settings"]["accuracy"], job["settings"]["fill"]) == ("high", "card")


def test_render_and_inspect_take_the_same_options_for_the_pair():
    def options(command):
        text = run_module(command, "--help").stdout
        return set(re.findall(r"--[a-z-]+", text.partition("options:")[2].partition("examples:")[0]))

    assert options("render") - options("inspect") == {"--output", "--compare", "--quiet"}
    assert options("inspect") - options("render") == {"--json", "--no-sketch"}


def test_an_inspection_that_fails_says_so_in_one_line(place, capsys):
    assert inspect(place, behaviour="error 2") == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err == "stereo_reproject: error: room.blend has no camera; add one\n"


# Animating


def animate(place, *options, behaviour="animation"):
    """Exit status of an animation within this process."""
    argv = ["animate", str(place / "room.blend"), "--output", str(place / "out"), *options]
    return cli.main(argv, host=cli.Host(worker_command=stub(place, behaviour)))


def jobs_told(place):
    """The jobs that workers were given, one after the other."""
    return [json.loads(line) for line in (notes(place) / "jobs").read_text().splitlines()]


def test_an_animation_as_the_worker_gets_it(place, monkeypatch):
    monkeypatch.chdir(place)
    options = "--frames 1-5:2 --resume --movie shot.mkv --layout side-by-side-half --format JPEG --holes"
    options += " --compare every=24 --size 64x32 --accuracy draft"
    argv = ["animate", "room.blend", "--output", "out", *options.split()]
    assert cli.main(argv, host=cli.Host(worker_command=stub(place, "animation"))) == 0
    (job,) = jobs_told(place)
    assert (job["command"], job["output"], job["files"]) == ("animate", str(place / "out"), [])
    assert job["animation"] == {
        "frames": [1, 3, 5],
        "existing": "resume",
        "output": str(place / "out"),
        "layout": "side-by-side-half",
        "file_format": "JPEG",
        "movie": str(place / "shot.mkv"),
        "holes": True,
        "compare_every": 24,
        "reuse": None,
        "mono": False,
        "views": False,
        "skip": {},
        "finished": [],
        "goes_on": False,
    }
    assert job["settings"]["scene"]["size"] == [64, 32]
    assert (job["settings"]["accuracy"], job["settings"]["compare"]) == ("draft", False)


@pytest.mark.parametrize(
    ("options", "field", "value"),
    [
        ("--frame 7", "frames", [7]),
        ("--frames 7", "existing", "refuse"),
        ("--frames 7 --overwrite", "existing", "overwrite"),
        ("--frames 7", "movie", None),
        ("--frames 7 --movie", "movie", ""),
        ("--frames 7 --movie clips/", "movie", "{place}/clips/"),
        ("--frames 7", "layout", None),
        ("--frames 7 --compare 3", "compare_every", 3),
        ("--frames 7 --reuse 8 --mono", "mono", True),
    ],
)
def test_an_option_of_an_animation(place, monkeypatch, options, field, value):
    monkeypatch.chdir(place)
    assert animate(place, *options.split()) == 0
    (job,) = jobs_told(place)
    wanted = value.replace("{place}", str(place)) if isinstance(value, str) else value
    assert job["animation"][field] == wanted


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ("", "mono needs reuse: without, Blender itself renders such an animation"),
        ("--reuse off", "mono needs reuse"),
        ("--reuse 8 --layout individual", "mono frames hold one view: leave the layout out"),
        ("--reuse 8 --source right", "a mono animation has one view and no source eye: leave it out"),
        ("--reuse 8 --convergence 2", "a mono animation has one view and no convergence distance: leave it out"),
        ("--reuse 8 --vr180", "a mono animation has one view and no panorama for headsets: leave it out"),
    ],
)
def test_what_one_view_cannot_have_is_said_in_one_line(place, capsys, options, part):
    assert animate(place, "--mono", *options.split()) == 2
    assert_one_line(capsys.readouterr().err, part)
    assert not (place / "out").exists()


def test_in_a_pipe_each_frame_is_a_line_and_the_table_comes_last(place, capsys):
    assert animate(place, "--frames", "1-3") == 0
    printed = capsys.readouterr()
    assert printed.out.splitlines() == [
        "1 of 4 frames are there already",
        "frame 1  2.5 s  8 % traced  1 of 3  0:05 left",
        "frame 2  2.5 s  8 % traced  2 of 3  0:02 left",
        "frame 3  2.5 s  8 % traced  3 of 3  0:00 left",
        "frames        3",
        "per frame     2.50 s, 0.25 s not for rendering",
        "traced        8.0 % of the target eye, on average",
        "speed-up      1.50 x over Blender's multiview, predicted",
        f"files         {place / 'out'}{os.sep}",
    ]
    assert_one_line(printed.err, "warning: frame 2 is dark")


def test_a_line_is_there_as_soon_as_its_frame_is_done(place, start):
    process = start("animation", "--frames", "1-2", verb="animate")
    lines = [process.stdout.readline() for _ in range(3)]
    assert [line.split()[:2] for line in lines[1:]] == [[b"frame", b"1"], [b"frame", b"2"]]


def test_a_quiet_animation_says_nothing_but_warnings(place, capsys):
    assert animate(place, "--frames", "1-3", "--quiet") == 0
    printed = capsys.readouterr()
    assert printed.out == ""
    assert_one_line(printed.err, "warning: frame 2 is dark")


@posix
def test_a_terminal_shows_one_line_for_all_frames(place, monkeypatch, start):
    monkeypatch.setenv("COLUMNS", "100")
    shown, err, status = through_terminal(start, "animation, slowly", "--frames", "1-4", verb="animate")
    assert (status, err) == (0, "")
    lines = shown.split("\r\n")
    drawn = [part.rstrip() for line in lines for part in line.split("\r")]
    assert f"[{'-' * 24}]  frame 1: fill" in drawn
    assert "rendered again, for being damaged: 2" in drawn
    last = next(part for part in reversed(drawn) if part.startswith("["))
    assert last == f"[{'#' * 24}]  3.5 s per frame  8 % traced  4 of 4  0:00 left"
    assert "frame 1  2.5 s" not in shown, "no line for each frame"
    assert len([line for line in lines if "[" in line]) <= 2
    assert max(map(len, drawn)) < 100


@posix
def test_a_terminal_shows_one_line_for_all_views(place, monkeypatch, start):
    monkeypatch.setenv("COLUMNS", "100")
    shown, _, status = through_terminal(start, "views, slowly", "--views", "4", verb="views")
    assert status == 0
    lines = [line for line in shown.split("\n") if line.startswith("\rviews")]
    assert len(lines) == 1, "stages of each view begin no line of their own"
    assert "view 2 of 4: warp" in lines[0]
    assert "view 3 of 4: fill" in lines[0]
    assert "[############------------]  50 %" in lines[0]
    assert "100 %" in lines[0].rstrip().rpartition("\r")[2]


@posix
def test_a_quiet_terminal_of_an_animation_stays_clean(place, start):
    options = ["--frames", "1-2", "--quiet"]
    assert through_terminal(start, "animation, slowly", *options, verb="animate") == ("", "", 0)


@pytest.mark.parametrize(("crash_at", "told_before"), [(1, []), (2, []), (3, [1]), (4, [1, 2])])
def test_a_blender_that_ends_on_a_frame_is_followed_by_another(place, capsys, crash_at, told_before):
    """The frame before is written by then, and the next Blender is to find it, without having been told of it."""
    (notes(place) / "crash at").write_text(str(crash_at))
    assert animate(place, "--frames", "1-4", behaviour="animation that crashes") == 1
    first, second = jobs_told(place)
    assert (first["animation"]["existing"], second["animation"]["existing"]) == ("refuse", "resume")
    assert list(second["animation"]["skip"]) == [str(crash_at)]
    assert second["animation"]["finished"] == told_before
    printed = capsys.readouterr()
    assert sorted({line.split()[1] for line in printed.out.splitlines()}) == sorted(
        {"1", "2", "3", "4"} - {str(crash_at)}
    )
    warning, error = printed.err.splitlines()
    assert warning.startswith(f"stereo_reproject: warning: frame {crash_at} is left out: Blender stopped unexpectedly")
    assert error.startswith(
        f"stereo_reproject: error: 1 of 4 frames failed ({crash_at}); frame {crash_at}: Blender stop"
    )


def test_frames_of_many_views_as_the_worker_gets_them(place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    options = "--display portrait --frames 1-5:2 --resume --movie film.mp4 --view-files --samples 4"
    assert many_views(place, *options.split(), behaviour="animation") == 0
    (job,) = jobs_told(place)
    assert (job["command"], job["files"]) == ("views", [])
    assert ViewsSettings(**job["views"]) == ViewsSettings(48, 40.0, None, None, 8, 6, 0.75, "portrait")
    asked = {name: job["animation"][name] for name in ("frames", "existing", "output", "movie", "views", "layout")}
    movie = str(place / "film.mp4")
    assert asked == {
        "frames": [1, 3, 5],
        "existing": "resume",
        "output": str(place / "out"),
        "movie": movie,
        "views": True,
        "layout": None,
    }
    assert (job["settings"]["scene"]["size"], job["settings"]["scene"]["samples"]) == ([420, 560], 4)
    printed = capsys.readouterr().out
    assert "frames        3\n" in printed
    assert f"movie         {movie}\n" in printed


def test_frames_whose_views_are_in_one_file_as_the_worker_gets_them(place):
    assert many_views(place, "--frames", "1-3", "--layout", "multi-view", behaviour="animation") == 0
    (job,) = jobs_told(place)
    assert job["views"]["layout"] == "multi-view"
    assert (job["animation"]["layout"], job["animation"]["views"]) == (None, False)


def test_frames_of_the_scenes_own_views_as_the_worker_gets_them(place):
    options = "--frames 1-3 --from-scene --quilt 2x2 --movie"
    assert many_views(place, *options.split(), behaviour="animation") == 0
    (job,) = jobs_told(place)
    assert ViewsSettings(**job["views"]) == ViewsSettings(0, columns=2, rows=2, from_scene=True)
    assert (job["animation"]["frames"], job["animation"]["movie"]) == ([1, 2, 3], "")


def test_a_blender_that_ends_on_a_frame_of_many_views_is_followed_by_another(place, capsys):
    (notes(place) / "crash at").write_text("2")
    assert many_views(place, "--frames", "1-3", behaviour="animation of views that crashes") == 1
    _, second = jobs_told(place)
    assert (second["animation"]["existing"], list(second["animation"]["skip"])) == ("resume", ["2"])
    warning, _ = capsys.readouterr().err.splitlines()
    assert warning.startswith("stereo_reproject: warning: frame 2 is left out: Blender stopped unexpectedly")


def test_a_warning_is_said_once_however_often_blender_is_started(place, capsys):
    (notes(place) / "crash at").write_text("2")
    assert animate(place, "--frames", "1-4", behaviour="animation that warns and crashes") == 1
    assert len(jobs_told(place)) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "stereo_reproject: warning: a library is missing"
    assert sum("a library is missing" in line for line in lines) == 1


@pytest.mark.parametrize(
    "argv",
    [
        ("render", "room.blend", "--output", "out"),
        ("animate", "room.blend", "--output", "out", "--frames", "1-2"),
        ("inspect", "room.blend"),
        ("tradeoff", "room.blend", "--output", "out"),
    ],
)
def test_strict_is_told_to_the_worker_and_is_no_setting_of_the_pair(place, monkeypatch, argv):
    monkeypatch.chdir(place)
    told = []
    for options in ((), ("--strict",)):
        cli.main([*argv, *options], host=cli.Host(worker_command=stub(place, "error 2")))
        told.append(json.loads((notes(place) / "job").read_text()))
    assert [job.pop("strict") for job in told] == [False, True]
    for job in told:
        del job["work"]
    assert told[0] == told[1]


@pytest.mark.parametrize(("option", "existing"), [("--overwrite", "overwrite"), ("--resume", "resume")])
def test_the_next_blender_treats_existing_frames_as_the_first_one_was_told(place, option, existing):
    (notes(place) / "crash at").write_text("3")
    assert animate(place, "--frames", "1-4", option, behaviour="animation that crashes") == 1
    assert [job["animation"]["existing"] for job in jobs_told(place)] == [existing, existing]


def test_when_one_blender_after_the_other_ends_no_more_are_tried(place, capsys):
    (notes(place) / "crash at").write_text("0")
    assert animate(place, "--frames", "1-9", behaviour="animation that crashes") == 1
    assert [sorted(job["animation"]["skip"]) for job in jobs_told(place)] == [[], ["1"], ["1", "2"]]
    *warnings, error = capsys.readouterr().err.splitlines()
    assert [line.split()[3] for line in warnings] == ["1", "2"]
    assert error.startswith("stereo_reproject: error: Blender stopped unexpectedly")
    assert "; frames that are finished are kept" in error


def test_as_in_blender_two_slashes_are_the_folder_of_the_scene(place, monkeypatch, capsys):
    monkeypatch.chdir(place.parent)
    argv = ["animate", str(place / "room.blend"), "--output", "//out", "--frames", "1-3", "--movie", "//film.mp4"]
    assert cli.main(argv, host=cli.Host(worker_command=stub(place, "animation"))) == 0
    (job,) = jobs_told(place)
    assert job["output"] == str(place / "out")
    assert job["animation"]["movie"] == str(place / "film.mp4")
    assert f"movie         {place / 'film.mp4'}\n" in capsys.readouterr().out


def test_a_blender_that_ends_between_frames_leaves_none_out(place, capsys):
    assert animate(place, "--frames", "1-4", behaviour="animation that crashes between frames") == 0
    assert [job["animation"]["skip"] for job in jobs_told(place)] == [{}, {}]
    printed = capsys.readouterr()
    assert_one_line(printed.err, "warning: Blender is started again: Blender stopped unexpectedly")
    assert {line.split()[1] for line in printed.out.splitlines() if line.startswith("frame ")} == {"1", "2", "3", "4"}


def test_a_blender_that_ends_on_the_movie_is_no_frames_fault(place, capsys):
    assert animate(place, "--frames", "1-2", behaviour="animation that crashes in its movie") == 1
    assert len(jobs_told(place)) == 1
    assert_one_line(capsys.readouterr().err, "error: Blender stopped unexpectedly (exit status 3) during movie")


@posix
def test_an_interrupted_animation_says_that_its_frames_are_kept(place, start):
    process = start("waits", "--frames", "1-2", verb="animate")
    wait_until((notes(place) / "ready").exists)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=SECONDS)
    assert (process.returncode, out) == (130, b"")
    assert_one_line(err.decode(), "interrupted; finished frames are kept, and --resume renders the rest")
