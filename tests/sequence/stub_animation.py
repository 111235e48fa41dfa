"""Stands in for the process that renders an animation, without Blender: `python stub_animation.py FOLDER LAST ...`.

A frame's two files hold bytes that follow from its number (`content`). Each line on standard output is an event, and
each rendering of a frame is logged in a file as well, before it begins. Not a test itself.
"""

import argparse
import contextlib
import errno
import itertools
import os
import random
import signal
import sys
import time
from pathlib import Path

from stereo_reproject.errors import StereoReprojectError
from stereo_reproject.jobs import work_folder
from stereo_reproject.sequence import frames as animation
from stereo_reproject.sequence import other_runs, runs
from stereo_reproject.sequence.fingerprints import Fingerprints
from stereo_reproject.sequence.journal import Journal
from stereo_reproject.sequence.journal_folder import JOURNAL
from stereo_reproject.sequence.output_errors import failed_output

VIEWS = ("L", "R")
BYTES = 20_000
NAME = "shot_"


def names(frame):
    return [f"{NAME}{frame:04d}_{view}.png" for view in VIEWS]


def content(name, signature=""):
    return signature.encode() + random.Random(name).randbytes(BYTES)


def main():
    options = parse()
    if options.machine:
        runs.machine = lambda: options.machine
    animation.POLL_SECONDS = other_runs.POLL_SECONDS = 0.05
    real_time = time.time
    time.time = lambda: real_time() + options.clock
    if options.full_at:
        fill_disk_at(options.full_at)
    live = runs.LiveRuns(options.folder / JOURNAL, stale_seconds=options.stale)
    journal = Journal(options.folder, NAME, runs=live)
    wanted = Fingerprints(options.settings, {"meshes": options.scene})
    try:
        with contextlib.ExitStack() as stack:
            private = stack.enter_context(work_folder.work_folder(options.folder, ())) / "tmp"
            files = {n: [options.folder / name for name in names(n)] for n in range(options.first, options.last + 1)}
            token = prepare(journal, stack, other_runs.announcement(journal, files, wanted))
            other_runs.settle(journal, files, wanted, token)
            plan = animation.plan_frames(journal, files, wanted, options.existing)
            say("plan", *plan.todo)
            maker = Maker(journal, wanted, token, private, options)
            told = animation.FrameListener(
                done=lambda frame, _: say("done", frame),
                failed=lambda frame, why: say("failed", frame, why),
                waits=lambda frames: say("waits", *frames),
            )
            animation.render_frames(plan, journal, wanted, token, maker, told)
            other_runs.check_frames_stayed(journal, files, wanted)
    except StereoReprojectError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_status)


def fill_disk_at(number):
    """What is written reaches the disk, or finds it full, when it is flushed."""
    real, flushes = os.fsync, itertools.count(1)

    def fsync(descriptor):
        if next(flushes) >= number:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(descriptor)

    os.fsync = fsync


def prepare(journal, stack, announced):
    try:
        journal.place.make()
        return stack.enter_context(runs.run_at_work(journal.runs, announced))
    except OSError as error:
        raise failed_output(journal.frames_folder, error) from error


def parse():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("last", type=int)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--existing", default="refuse")
    parser.add_argument("--log", type=Path, default=os.devnull)
    parser.add_argument("--seconds", type=float, default=0.0)
    parser.add_argument("--settings", default="these")
    parser.add_argument("--scene", default="cube")
    parser.add_argument("--machine", default="")
    parser.add_argument("--stale", type=float, default=runs.STALE_SECONDS)
    parser.add_argument("--clock", type=float, default=0.0)
    parser.add_argument("--signature", default="")
    parser.add_argument("--throws-at", type=int)
    parser.add_argument("--stops-at", type=int)
    parser.add_argument("--full-at", type=int, help="the number of the flush at which the disk is full, and stays so")
    return parser.parse_args()


def say(*words):
    print(*words, flush=True)


class Maker:
    def __init__(self, journal, wanted, token, private, options):
        self.journal, self.wanted, self.token = journal, wanted, token
        self.private, self.options = private, options
        self.results = []

    def render(self, frame, claim):
        with self.options.log.open("a") as log:
            log.write(f"{frame}\n")
        say("renders", frame)
        time.sleep(self.options.seconds)
        if frame == self.options.throws_at:
            raise StereoReprojectError("the renderer cannot")
        try:
            made = self.write(frame)
        except OSError as error:
            raise failed_output(self.journal.frames_folder, error) from error
        if frame == self.options.stops_at:
            os.kill(os.getpid(), signal.SIGSTOP)
        record = {
            "frame": frame,
            "settings": self.wanted.settings,
            "scene": self.wanted.scene,
            "run": self.token,
            "figures": {},
        }
        self.results.append((frame, animation.publish_frame(self.journal, made, record, claim)))

    def write(self, frame):
        made = {}
        for name in names(frame):
            made[name] = self.private / name
            made[name].write_bytes(content(name, self.options.signature))
        return made

    def finished(self, *, wait):  # noqa: ARG002 - whatever was rendered is written
        results, self.results = self.results, []
        return results


if __name__ == "__main__":
    main()
