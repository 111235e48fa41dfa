"""The writer as a process of its own: started, handed one frame after the other, and asked for the results
(`programs/writer`)."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..errors import BadInputError, OutputError, StereoReprojectError
from ..jobs.supervisor import Session
from ..jobs.worker_process import module_command, private_environment
from ..words import Words, from_data
from .frame_record import Record
from .quilt_frames import QuiltFrames

ANSWER_SECONDS = 0.02
"""Time between two looks for an answer."""

MAX_PENDING_FRAMES = 2
"""Frames that may wait to be written: more would only fill the drive."""


@dataclass(frozen=True)
class WriterJob:
    """The job of the writer process: the .blend and the session in which it is open; the private folder for its
    answers; and the folder of the frames with their common name. output, layout and file_format are those of
    `AnimationSettings`; panorama and mono are those of `SceneOverrides`. quilt has the files of frames that are many
    views; None where they are pairs."""

    blend: str
    session: Session
    private: str
    folder: str
    name: str
    output: str | None
    layout: str | None
    file_format: str | None
    panorama: str | None = None
    mono: bool = False
    quilt: QuiltFrames | None = None


@dataclass(frozen=True)
class WrittenFrame:
    """A rendered frame that is handed to the writer process: claim is the number of this run's claim of it, which the
    writer releases when the frame is written.

    folder holds its pictures: of a pair left.exr, right.exr and, if they are asked for, holes.png and cutouts.png, of
    mono no right.exr; of many views views/view_00.exr and so on, report.json, and quilt.json, see
    `quilt_frames.QUILT_ORDER`. metadata are those of its passes. record has the fields of its `Record` but for the
    files.
    """

    frame: int
    claim: int
    folder: str
    metadata: dict[str, str]
    record: dict[str, Any]


class WriterProcess:
    """A second Blender process that writes frames while the first renders. It is started again if it crashes. command
    starts another program in place of `python -m stereo_reproject.programs.writer`."""

    def __init__(self, job: WriterJob, command: Sequence[str] | None = None) -> None:
        self._job = job
        self._command = command
        self._answers = Path(job.private)
        self._log = self._answers / "writer.log"
        self._process: subprocess.Popen[bytes] | None = None
        self._pending: dict[int, WrittenFrame] = {}
        self._results: list[tuple[int, Record | StereoReprojectError | None]] = []

    def start(self) -> None:
        """Start the process and have it open its .blend, which takes a while and goes on after this returns. An earlier
        process is ended first. Raises StereoReprojectError."""
        own_python = self._command is None
        self.close()
        try:
            (self._answers / "tmp").mkdir(exist_ok=True)
            with self._log.open("ab") as log:
                self._process = subprocess.Popen(
                    list(self._command or module_command("programs.writer")),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=log,
                    env=private_environment(self._answers, own_python=own_python),
                    creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
                )
        except OSError as error:
            raise StereoReprojectError(
                Words("no process could be started ({reason}); free some resources", reason=error.strerror)
            ) from error
        self._send(asdict(self._job))

    def hand_over(self, frame: WrittenFrame) -> None:
        """Have a frame written after those before it. Starts the process if it is not running, and waits while more
        than MAX_PENDING_FRAMES frames are not yet written. Raises StereoReprojectError."""
        if self._has_ended():
            self._look()
        if self._has_ended():
            self.start()
        self._pending[frame.frame] = frame
        self._send(asdict(frame))
        while len(self._pending) > MAX_PENDING_FRAMES:
            self._look()
            time.sleep(ANSWER_SECONDS)

    def finished(self, *, wait: bool) -> list[tuple[int, Record | StereoReprojectError | None]]:
        """Return the results of frames that were written since the last call, with `wait` of all that were handed over:
        see `frames.FrameMaker.finished`."""
        self._look()
        while wait and self._pending:
            time.sleep(ANSWER_SECONDS)
            self._look()
        results, self._results = self._results, []
        return results

    def close(self) -> None:
        """Wait until the process has written all frames that it was handed, and end it."""
        if self._process is None:
            return
        assert self._process.stdin is not None
        # What it was not there any more to read is of no use.
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        self._process.wait()
        self._process = None

    def _send(self, message: dict[str, Any]) -> None:
        """Write a message to the process as a line of JSON. Nothing is raised if the process is dead: that is noticed
        when its answer is missing."""
        assert self._process is not None
        assert self._process.stdin is not None
        # One that is dead is found so by whoever waits for its answer.
        with contextlib.suppress(OSError):
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()

    def _look(self) -> None:
        """Take in the answers that are there by now as results. If the process has ended, the frame that it was at gets
        an error as its result, and the frames behind it are handed to a new process."""
        ended = self._has_ended()
        for frame in list(self._pending):
            path = self._answers / f"{frame}.json"
            try:
                answer = json.loads(path.read_bytes())
            except FileNotFoundError:
                gone = self._is_gone()
                if not ended and not gone:
                    # They are written one after the other.
                    return
                answer = {"error": self._how_it_ended(frame), "status": 1, "hopeless": gone}
            else:
                path.unlink(missing_ok=True)
            del self._pending[frame]
            self._results.append((frame, _result(answer)))
            if ended and "error" in answer and not answer["hopeless"]:
                self._start_again()
                return

    def _start_again(self) -> None:
        """Start a new process and hand it the frames that are still to be written, if there are any."""
        if self._pending:
            self.start()
            for frame in self._pending.values():
                self._send(asdict(frame))

    def _has_ended(self) -> bool:
        """Return True if the process has ended or was not started yet."""
        return self._process is None or self._process.poll() is not None

    def _is_gone(self) -> bool:
        """Return True if the folder of the answers was removed: then the log in it is gone. The folder itself may exist
        again, because Blender makes missing folders on the way to its files."""
        return not self._log.exists()

    def _how_it_ended(self, frame: int) -> Words:
        """Return in words why the process has not written a frame."""
        if self._is_gone():
            return Words("{folder} is gone, with the frames that were in it", folder=self._job.folder)
        status = None if self._process is None else self._process.returncode
        if os.name != "posix" or not status or status > 0:
            ending = Words("exit status {status}", status=status)
        else:
            ending = Words("signal {number}", number=-status)
        return Words(
            "frame {frame} was not written: Blender stopped unexpectedly ({ending})", frame=frame, ending=ending
        )


def _result(answer: dict[str, Any]) -> Record | StereoReprojectError | None:
    """Return the result of a frame from the process's answer: its record, None where another run has claimed it, or the
    error."""
    if "record" in answer:
        return None if answer["record"] is None else Record(**answer["record"])
    kind = BadInputError if answer["status"] == BadInputError.exit_status else StereoReprojectError
    return (OutputError if answer["hopeless"] else kind)(from_data(answer["error"], answer.get("words")))
