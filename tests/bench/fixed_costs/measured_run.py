"""One run of the render command, measured from its start to its end: a program of its own, for any version of ours.

    python -P measured_run.py drive OPTIONS      OPTIONS are JSON; the last line of the output is what was measured
    python -P measured_run.py work FILE CLOCK    the worker that `drive` starts: notes its own part in FILE

The package that it finds (PYTHONPATH) is the one that is measured.
"""

from __future__ import annotations

import json
import pstats
import sys
import tempfile
import time
from collections.abc import Callable
from cProfile import Profile
from pathlib import Path
from typing import Any

FUNCTIONS = {
    "call": ("blender/engines/render.py", "call_render"),
    "cycles": ("~", "<built-in method _cycles.render>"),
    "read": ("images/exr.py", "read_render"),
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


CLOCKS: dict[str, Callable[[], float]] = {"wall": time.perf_counter, "processor": time.thread_time}
"""Clocks by name: the one on the wall, and the main thread's processor time. The second one counts nothing that other
programs do meanwhile, and nothing that other threads do: where bands are worked on by several, it tells the main
thread's share, which is about as long as all of it takes on idle cores."""


class StageProfiles:
    """Profiles of a worker's stages, one for each, by one of `CLOCKS`, and the syncs of the render calls."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self.seconds: dict[str, float] = {}
        self.functions: dict[str, dict[str, float]] = {}
        self.syncs: list[float] = []
        self._clock, self._stage, self._start = clock, "", 0.0
        self._profile: Profile | None = None

    def begin(self, stage: str) -> None:
        """End the profile of the stage that runs, and begin that of this one; "" begins none."""
        if self._profile is not None:
            self._profile.disable()
            self.seconds[self._stage] = self._clock() - self._start
            self.functions[self._stage] = seconds_by_function(self._profile)
        self._stage, self._profile = stage, Profile(self._clock) if stage else None
        if self._profile is not None:
            self._start = self._clock()
            self._profile.enable()

    def watch_syncs(self) -> None:
        """Have the sync of each render call noted."""
        from stereo_reproject.blender.engines import packed_trace, renderer
        from stereo_reproject.blender.engines.render import render_views

        def noted(*given: Any, **named: Any) -> Any:
            rendered = render_views(*given, **named)
            self.syncs.append(rendered.sync_seconds)
            return rendered

        for module in (renderer, packed_trace):
            setattr(module, render_views.__name__, noted)


def seconds_by_function(profile: Profile) -> dict[str, float]:
    """Return the seconds in each of `FUNCTIONS` that a profile has seen called, with all that they call."""
    found: dict[str, float] = {}
    for (file, _, name), (_, _, _, cumulative, _) in pstats.Stats(profile).stats.items():  # pyright: ignore
        for key, (path, function) in FUNCTIONS.items():
            if name == function and Path(file).as_posix().endswith(path):
                found[key] = found.get(key, 0.0) + cumulative
    return found


def work(facts: Path, clock: str) -> None:
    """Be the worker of a run, and write what is measured in this process into a file as JSON."""
    from stereo_reproject.programs import worker

    original, profiles = worker.run_job, StageProfiles(CLOCKS[clock])

    def measured(job: dict[str, Any], emit: Any) -> None:
        def watched(event: str, **fields: Any) -> None:
            if event == "stage":
                profiles.begin(str(fields["stage"]))
            emit(event, **fields)

        profiles.watch_syncs()
        started = time.process_time()
        original(job, watched)
        profiles.begin("")
        noted = {"started": started, "stages": profiles.seconds, "functions": profiles.functions}
        noted |= {"syncs": profiles.syncs, "copy": saved_copy(Path(job["work"]), CLOCKS[clock])}
        facts.write_text(json.dumps({**noted, "ended": time.time()}))

    worker.run_job = measured
    worker.main()


def saved_copy(work: Path, clock: Callable[[], float]) -> float:
    """Return the seconds, by this clock, of saving a copy of the open file, as the panel does before a run."""
    from stereo_reproject.blender.commands.processes import save_copy

    folder = work / "copy"
    folder.mkdir()
    start = clock()
    save_copy(folder)
    return clock() - start


def drive(options: dict[str, Any]) -> dict[str, Any]:
    """Render a pair as the command line does, and return what was measured: the seconds of each part, and the share of
    the second eye that was traced."""
    from stereo_reproject.jobs.supervisor import Job, run_worker
    from stereo_reproject.settings.frame import SceneOverrides, StereoSettings

    overrides = SceneOverrides(**{**options["overrides"], "size": tuple(options["overrides"]["size"])})
    clock, loads = options["clock"], []

    def on_event(event: dict[str, Any]) -> None:
        if event["event"] == "stage" and not loads:
            loads.append(time.time())

    with tempfile.TemporaryDirectory() as folder:
        facts = Path(folder) / "facts.json"
        command = [sys.executable, "-P", __file__, "work", str(facts), clock]
        job = Job(Path(options["blend"]), Path(folder) / "out", StereoSettings(scene=overrides, fill="packed"))
        start = time.time()
        report = run_worker(job, on_event, command=command)
        end = time.time()
        noted = json.loads(facts.read_text())
    return {
        **{name: noted[name] for name in ("stages", "functions", "syncs", "copy")},
        "start": loads[0] - start if clock == "wall" else noted["started"],
        # What was measured after the report is no part of a run.
        "end": end - noted["ended"],
        "traced": report["fractions"]["rerendered"],
    }


if __name__ == "__main__":
    if sys.argv[1] == "work":
        work(Path(sys.argv[2]), sys.argv[3])
    else:
        print(json.dumps(drive(json.loads(sys.argv[2]))))
