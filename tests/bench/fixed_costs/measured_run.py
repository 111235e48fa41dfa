"""One run of the render command, measured from its start to its end: a program of its own, for any version of ours.

    python -P measured_run.py drive OPTIONS      OPTIONS are JSON; the last line of the output is what was measured
    python -P measured_run.py work FILE          the worker that `drive` starts: notes its own part in FILE

The package that it finds (PYTHONPATH) is the one that is measured.
"""

from __future__ import annotations

import json
import pstats
import sys
import tempfile
import time
from cProfile import Profile
from pathlib import Path
from typing import Any

FUNCTIONS = {
    "sharpness": ("images/sharpness.py", "sharpness_of"),
    "edges": ("holes/classifier.py", "source_edges"),
    "reasons": ("holes/classifier.py", "reasons"),
    "estimator": ("estimate/estimator.py", "estimator_of"),
    "eye files": ("images/exr.py", "write_eye"),
    "stereo.exr": ("images/exr.py", "write_stereo"),
    "stereo.png": ("blender/output/delivery.py", "deliver_side_by_side"),
    "holes.png": ("blender/output/pictures.py", "write_holes"),
    "estimate.png": ("blender/output/pictures.py", "write_estimate"),
    "grid.png": ("blender/output/pictures.py", "write_grid"),
}
"""Functions whose seconds are told apart within a stage, by the end of their file's path and their name."""


class StageProfiles:
    """Profiles of a worker's stages, one for each, and the render calls in them."""

    def __init__(self) -> None:
        self.stage = ""
        self.functions: dict[str, dict[str, float]] = {}
        self.renders: list[dict[str, Any]] = []
        self._profile: Profile | None = None

    def begin(self, stage: str) -> None:
        """End the profile of the stage that runs, and begin that of this one; "" begins none."""
        if self._profile is not None:
            self._profile.disable()
            self.functions[self.stage] = seconds_by_function(self._profile)
        self.stage, self._profile = stage, Profile() if stage else None
        if self._profile is not None:
            self._profile.enable()

    def watch_renders(self) -> None:
        """Have each render call noted, in whichever modules it is called from."""
        from stereo_reproject.blender.engines import packed_trace, render, renderer

        original = render.render_views

        def noted(*given: Any, **named: Any) -> Any:
            start = time.perf_counter()
            rendered = original(*given, **named)
            of_cycles = (text for key, text in rendered.attributes.items() if key.endswith(".total_time"))
            self.renders.append(
                {
                    "stage": self.stage,
                    "seconds": time.perf_counter() - start,
                    "cycles": seconds_of(next(of_cycles, "")),
                    "sync": rendered.sync_seconds,
                }
            )
            return rendered

        for module in (render, renderer, packed_trace):
            module.render_views = noted


def seconds_by_function(profile: Profile) -> dict[str, float]:
    """Return the seconds in each of `FUNCTIONS` that a profile has seen called, with all that they call."""
    found: dict[str, float] = {}
    for (file, _, name), (_, _, _, cumulative, _) in pstats.Stats(profile).stats.items():  # pyright: ignore
        for key, (path, function) in FUNCTIONS.items():
            if name == function and Path(file).as_posix().endswith(path):
                found[key] = found.get(key, 0.0) + cumulative
    return found


def seconds_of(text: str) -> float:
    """Return the seconds of a duration as Cycles writes it, 01:02.50; 0 without one."""
    total = 0.0
    for part in filter(None, text.split(":")):
        total = 60.0 * total + float(part)
    return total


def work(facts: Path) -> None:
    """Be the worker of a run, and write what is measured in this process into a file as JSON."""
    from stereo_reproject.programs import worker

    original, profiles = worker.run_job, StageProfiles()

    def measured(job: dict[str, Any], emit: Any) -> None:
        def stamped(event: str, **fields: Any) -> None:
            if event == "stage":
                profiles.begin(str(fields["stage"]))
            emit(event, **fields)
            if event == "done":
                done.append(time.time())

        done: list[float] = []
        profiles.watch_renders()
        original(job, stamped)
        profiles.begin("")
        copied = saved_copy(Path(job["work"]))
        noted = {"renders": profiles.renders, "functions": profiles.functions, "copy": copied, "done": done[0]}
        facts.write_text(json.dumps({**noted, "ended": time.time()}))

    worker.run_job = measured
    worker.main()


def saved_copy(work: Path) -> float:
    """Return the seconds of saving a copy of the open file, as the panel does before a run."""
    from stereo_reproject.blender.commands.processes import save_copy

    folder = work / "copy"
    folder.mkdir()
    start = time.perf_counter()
    save_copy(folder)
    return time.perf_counter() - start


def drive(options: dict[str, Any]) -> dict[str, Any]:
    """Render a pair as the command line does, and return what was measured: the seconds of each part, and the share of
    the second eye that was traced."""
    from stereo_reproject.jobs.supervisor import Job, run_worker
    from stereo_reproject.settings.frame import SceneOverrides, StereoSettings

    overrides = SceneOverrides(**{**options["overrides"], "size": tuple(options["overrides"]["size"])})
    began: dict[str, float] = {}

    def on_event(event: dict[str, Any]) -> None:
        if event["event"] == "stage":
            began.setdefault(str(event["stage"]), time.time())

    with tempfile.TemporaryDirectory() as folder:
        facts = Path(folder) / "facts.json"
        command = [sys.executable, "-P", __file__, "work", str(facts)]
        job = Job(Path(options["blend"]), Path(folder) / "out", StereoSettings(scene=overrides, fill="packed"))
        start = time.time()
        report = run_worker(job, on_event, command=command)
        end = time.time()
        noted = json.loads(facts.read_text())
    stages = dict(report["seconds"])
    # What was measured after "done" is no part of a run.
    ended = end - noted["ended"]
    return {
        "start": began["load"] - start,
        "stages": stages,
        "end": ended,
        "copy": noted["copy"],
        "renders": noted["renders"],
        "functions": noted["functions"],
        "traced": report["fractions"]["rerendered"],
    }


if __name__ == "__main__":
    if sys.argv[1] == "work":
        work(Path(sys.argv[2]))
    else:
        print(json.dumps(drive(json.loads(sys.argv[2]))))
