"""Stands in for the worker that runs Blender: `python stub_worker.py BEHAVIOUR NOTES`, NOTES being a folder in which
it leaves word of what it saw. Not a test itself."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

FOREVER = 600

behaviour, notes = sys.argv[1], Path(sys.argv[2])


def note(name, text=""):
    beside = notes / f".{name}"
    beside.write_text(text, encoding="utf-8")
    beside.replace(notes / name)


def say(event, **values):
    print(json.dumps({"event": event, **values}), flush=True)


def report():
    return {
        "schema": 1,
        "scene": "room.blend",
        "frame": 1,
        "size": [64, 32],
        "samples": 4,
        "blender": "5.2.3",
        "accuracy": "balanced",
        "fill": {"method": "packed", "reason": "6 % of the pixels are holes"},
        "grid": {"cells": 8, "subdivided": 2, "triangles": 44},
        "fractions": {"disoccluded": 0.03, "outside": 0.01, "silhouette": 0.02, "rerendered": 0.06},
        "seconds": {"load": 1, "source": 10, "warp": 0.1, "fill": 1, "composite": 0.1, "write": 0.5, "total": 11.2},
        "memory": {"peak_mb": 512.5},
    }


INSPECTION = {
    "schema": 1,
    "scene": "room",
    "frame": 1,
    "size": [64, 32],
    "samples": 4,
    "engine": "CYCLES",
    "device": "CPU",
    "blender": "5.2.3",
    "accuracy": "balanced",
    "effects": [{"effect": "hair", "called_for": True, "by": ["curves 'Fur \u00e4'"], "handling": "traced"}],
    "passes": ["Combined", "Depth"],
    "predicted": None,
    "warnings": ["the scene denoises"],
}


def finish(*, without=()):
    files = [name for name in job["files"] if name not in without]
    for name in files:
        (work / "out" / name).write_text(f"new {name}", encoding="utf-8")
    say("done", report=report(), files=files)


def views(*, without=()):
    asked = job["views"]
    (work / "out" / "views").mkdir()
    # Of the scene's own views it alone knows the names.
    own = [f"views/{name}.exr" for name in ("left", "far right")] if asked["from_scene"] else []
    quilts = [f"quilt_qs{asked['columns']}x{asked['rows']}a0.75.{kind}" for kind in ("png", "exr") if asked["columns"]]
    names = [name for name in (*quilts, *own, *job["files"]) if name not in without]
    for name in names:
        (work / "out" / name).write_text(f"new {name}", encoding="utf-8")
    seen = [
        {"name": f"view_{k:02d}", "how": "made", "from": ["view_00"], "traced": 0.1} for k in range(asked["count"] or 2)
    ]
    seen[0] |= {"how": "rendered", "from": [], "traced": 1.0}
    rest = {"plan": ["render view_00: the leftmost"], "seconds": {"source": 10.0, "total": 12.5}}
    estimates = {"honest_ratio": 1.01, "interval": [1.0, 1.02]}
    report = {"views": [{**view, **estimates} for view in seen], **rest, "files": names}
    if "report.json" in names:
        (work / "out" / "report.json").write_text(json.dumps(report), encoding="utf-8")
    say("done", report=report, files=names)


def begin(frame):
    part = ", view 2 of 4" if "of views" in behaviour else ""
    say("stage", stage="source", detail=f"frame {frame}{part}")


def done(frame, *, left):
    far = {"done": len(asked) - left, "total": len(asked), "each": 3.5, "remaining": 2.5 * left}
    say("frame", frame=frame, seconds=2.5, traced=0.08, **far)


ALWAYS = 0
"""No frame of the tests."""


def animate(*, crash_at=None, crash_after=None, crash_in_movie=False):
    """As the worker does it: of a frame that is written while the next one is rendered, one is told after that."""
    options = job["animation"]
    left = [frame for frame in asked if str(frame) not in options["skip"] and frame not in options["finished"]]
    said = None
    while left:
        frame = left.pop(0)
        begin(frame)
        if crash_at in (frame, ALWAYS):
            sys.exit(3)
        say("stage", stage="write", detail=f"frame {frame}")
        if crash_after == frame and not options["finished"]:
            sys.exit(3)
        if said is not None:
            done(said, left=len(left) + 1)
        said = frame
    if said is not None:
        done(said, left=0)
    say("stage", stage="movie")
    if crash_in_movie and not options["skip"]:
        sys.exit(3)
    if options["skip"]:
        (frame, why), *_ = options["skip"].items()
        say("error", status=1, message=f"1 of {len(asked)} frames failed ({frame}); frame {frame}: {why}")
        sys.exit(1)
    totals = {"frames": len(asked), "seconds_per_frame": 2.5, "beside_seconds_per_frame": 0.25, "traced": 0.08}
    movies = [options["movie"]] if options["movie"] else []
    told = {"frames": [], "totals": {**totals, "speedup": 1.5, "speedup_from": "predicted"}, "movies": movies}
    say("done", report=told, files=[])


note("pid", str(os.getpid()))
if behaviour == "silent":
    note("ready")
    time.sleep(FOREVER)

job = json.loads(sys.stdin.readline())
work = Path(job["work"])
note("job", json.dumps(job))
with (notes / "jobs").open("a", encoding="utf-8") as jobs:
    jobs.write(json.dumps(job) + "\n")
asked = (job.get("animation") or {}).get("frames")
note("temporary", os.environ["TMPDIR"])
print("Read blend: noise that is no event", flush=True)
say("stage", stage="load")
print("Sample 7/8", file=sys.stderr, flush=True)
say("stage", stage="fill", detail="12 of 24 samples")

match behaviour:
    case "success":
        say("warning", message="two passes\nhad to be left out")
        finish()
    case "views":
        views()
    case "views without a sweep":
        views(without=["sweep.mp4"])
    case "views, slowly":
        for number in (1, 2, 3):
            for stage in ("warp", "fill"):
                time.sleep(0.15)
                say("stage", stage=stage, detail=f"view {number} of 4")
        time.sleep(0.15)
        say("stage", stage="write")
        views()
    case "inspection":
        say("warning", message="the scene denoises")
        say("done", report=INSPECTION, files=[])
    case "success, then hangs":
        finish()
        note("ready")
        time.sleep(FOREVER)
    case "success, then dies":
        finish()
        os._exit(9)
    case "incomplete":
        finish(without=["stereo.png"])
    case "error 1":
        (work / "out" / "left.exr").write_text("half", encoding="utf-8")
        say("error", status=1, message="the source eye came out empty:\ncheck the scene")
    case "error 2":
        say("error", status=2, message="room.blend has no camera; add one")
    case "segmentation fault":
        with contextlib.suppress(ImportError):
            import resource

            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        print("Device 0 lost\n\n", file=sys.stderr, flush=True)
        print("00:00.493  cycles   | WARNING CUEW initialization failed", file=sys.stderr, flush=True)
        print('00:00.513  blend    | Read blend: "room.blend"', file=sys.stderr, flush=True)
        print("Fra:1 Mem:8.00M | Sample 7/8", file=sys.stderr, flush=True)
        os.kill(os.getpid(), signal.SIGSEGV)
    case "killed":
        print("Saved: '/tmp/something.png'", file=sys.stderr, flush=True)
        os.kill(os.getpid(), signal.SIGKILL)
    case "killed for memory":
        counter = Path((notes / "counter").read_text())
        counter.write_text("oom_kill 8\n")
        os.kill(os.getpid(), signal.SIGKILL)
    case "exit 3":
        print("ModuleNotFoundError: No module named 'bpy'", file=sys.stderr)
        sys.exit(3)
    case "waits":
        note("ready")
        sys.stdin.read()
        note("end of input")
    case "says more than anybody reads":
        for _ in range(300):
            say("note", message="more " * 200)
        note("ready")
        sys.stdin.read()
    case "stubborn":
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        child = subprocess.Popen([sys.executable, "-c", f"import time; time.sleep({FOREVER})"])
        note("descendant", str(child.pid))
        note("ready")
        time.sleep(FOREVER)
    case "descendant keeps the pipe":
        child = subprocess.Popen([sys.executable, "-c", f"import time; time.sleep({FOREVER})"])
        note("descendant", str(child.pid))
        os._exit(4)
    case "animation":
        say("note", message="1 of 4 frames\nare there already")
        say("warning", message="frame 2 is dark")
        animate()
    case "animation, slowly":
        begin(1)
        time.sleep(0.2)
        say("stage", stage="fill", detail="frame 1")
        time.sleep(0.2)
        say("note", message="rendered again, for being damaged: 2")
        time.sleep(0.2)
        animate()
    case "animation that crashes" | "animation of views that crashes":
        animate(crash_at=int(notes.joinpath("crash at").read_text()))
    case "animation that warns and crashes":
        say("warning", message="a library is missing")
        animate(crash_at=int(notes.joinpath("crash at").read_text()))
    case "animation that crashes between frames":
        animate(crash_after=3)
    case "animation that crashes in its movie":
        animate(crash_in_movie=True)
    case "announces stages slowly":
        for samples in (12, 16, 24):
            time.sleep(0.5)
            print(f"Fra:1 Mem:8.00M | Sample {samples}/24", file=sys.stderr, flush=True)
        time.sleep(0.5)
        finish()
