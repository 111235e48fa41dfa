"""Signals that are switched off or sent, standard streams that are closed or full, terminals of all sizes."""

from __future__ import annotations

import contextlib
import fcntl
import functools
import os
import pty
import signal
import struct
import sys
import termios
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from tests.hostile.case import Case
from tests.hostile.program import (
    DEMO,
    PAIR,
    Outcome,
    assert_done,
    assert_nothing_left,
    assert_one_line_or_done,
    lines_of,
    run_program,
    start_program,
)
from tests.hostile.rows._names import ANIMATION
from tests.hostile.rows._variables import ANIMATE, RENDER, Variables


def _signals(ignored: tuple[int, ...], blocked: tuple[int, ...], command: tuple[Any, ...], folder: Path) -> None:
    """Signals that whoever started it has switched off change nothing in a run that gets none."""

    def switch() -> None:
        for number in ignored:
            signal.signal(number, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_BLOCK, blocked)

    outcome = run_program(*command, cwd=folder, prepare=switch)
    assert_done(outcome)


def _interruptible(ignored: bool, blocked: bool, signum: int, folder: Path) -> None:
    """Ctrl-C ends it, also where a script that runs in the background had it ignored: by hand, `kill -INT`."""

    def switch() -> None:
        if ignored:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        if blocked:
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP, signal.SIGUSR1})

    arguments = ("render", DEMO, "--output", "out", "--size", "2000x2000", "--samples", "4000")
    with start_program(*arguments, cwd=folder, prepare=switch) as run:
        run.wait_for(lambda: list(folder.glob("out/.stereo_reproject-*/tmp")))
        run.process.send_signal(signum)
        outcome = run.end(30)
    assert not outcome.timed_out, f"{signum} did not end it"
    assert outcome.status == 128 + signum, f"{signum} ended it with {outcome}"
    assert_nothing_left(folder)


def _timed_out(folder: Path) -> None:
    """`timeout 1 python -m stereo_reproject ...`, as scripts have it."""
    arguments = ("render", DEMO, "--output", "out", "--size", "2000x2000", "--samples", "4000")
    outcome = run_program(*arguments, cwd=folder, python=("timeout", "2", sys.executable))
    assert outcome.status == 124, outcome
    assert not outcome.left, outcome
    assert_nothing_left(folder)


def _streams(closed: tuple[int, ...], onto: Mapping[int, str], command: tuple[Any, ...], folder: Path) -> None:
    """Whatever becomes of what it says, the result is the same."""

    def switch() -> None:
        for number in closed:
            os.close(number)
        for number, name in onto.items():
            opened = os.open(name, os.O_RDONLY if number == 0 or name == "/dev/zero" else os.O_WRONLY)
            os.dup2(opened, number)
            os.close(opened)

    outcome = run_program(*command, cwd=folder, prepare=switch)
    files = PAIR if command is RENDER else ANIMATION
    if onto.get(1) in ("/dev/full", "/dev/zero"):
        # What it said is lost, which is a failure of its own; what it made is not.
        assert outcome.status in (0, 1), outcome
        assert len(lines_of(outcome)) <= 1, outcome
    else:
        assert_done(outcome)
    assert not outcome.timed_out
    assert_nothing_left(folder, "out", *(f"out/{name}" for name in files))


def _broken_pipe(number: int, command: tuple[Any, ...], folder: Path) -> None:
    """Nobody reads: `... | head -0`."""
    reader, writer = os.pipe()
    os.close(reader)
    outcome = run_program(*command, cwd=folder, **{{1: "stdout", 2: "stderr"}[number]: writer})
    os.close(writer)
    assert outcome.status == 0, outcome
    assert_one_line_or_done(outcome)


def _quiet_pipe(folder: Path) -> None:
    """Standard input from a pipe into which nobody writes and that nobody closes."""
    reader, writer = os.pipe()
    outcome = run_program(*RENDER, cwd=folder, stdin=reader)
    os.close(reader)
    os.close(writer)
    assert_done(outcome)


def _terminal(columns: int, lines: int, variables: Variables, command: tuple[Any, ...], folder: Path) -> None:
    """On a terminal of any size, a progress line, and no control characters but those that move to its beginning."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
    said: list[bytes] = []

    def read() -> None:
        with contextlib.suppress(OSError):
            while part := os.read(master, 65536):
                said.append(part)

    reader = threading.Thread(target=read)
    with start_program(*command, cwd=folder, environment=variables, stdin=slave, stdout=slave, stderr=slave) as run:
        reader.start()
        os.close(slave)
        outcome = run.end()
    reader.join(10)
    os.close(master)
    text = b"".join(said).decode("utf-8", "replace")
    assert_done(Outcome(outcome.status, text.encode(), b"", outcome.seconds, outcome.timed_out, outcome.left))
    odd = {char for char in text if not char.isprintable()} - {"\r", "\n"}
    assert not odd, f"control characters: {odd}"


def _terminal_gone(folder: Path) -> None:
    """Whoever closes the terminal's window sends SIGHUP: the run ends, and leaves nothing."""
    master, slave = pty.openpty()

    def own() -> None:
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)

    arguments = ("render", DEMO, "--output", "out", "--size", "2000x2000", "--samples", "4000")
    with start_program(*arguments, cwd=folder, stdin=slave, stdout=slave, stderr=slave, prepare=own) as run:
        os.close(slave)
        run.wait_for(lambda: list(folder.glob("out/.stereo_reproject-*/tmp")))
        os.close(master)
        outcome = run.end(30)
    assert outcome.status == 128 + signal.SIGHUP, outcome
    assert_nothing_left(folder)


def _signal_cases() -> Iterator[Case]:
    for number in ("SIGPIPE", "SIGINT", "SIGHUP", "SIGCHLD", "SIGTERM", "SIGUSR1", "SIGALRM"):
        command = ANIMATE if number == "SIGCHLD" else RENDER
        ignored = (getattr(signal, number),)
        yield Case(f"{number} ignored", functools.partial(_signals, ignored, (), command))
    for number in ("SIGCHLD", "SIGTERM", "SIGINT", "SIGPIPE"):
        yield Case(f"{number} blocked", functools.partial(_signals, (), (getattr(signal, number),), RENDER))
    every = tuple(signal.valid_signals())
    yield Case("every signal blocked", functools.partial(_signals, (), every, RENDER))
    yield Case("Ctrl-C where it was ignored", functools.partial(_interruptible, True, False, signal.SIGINT))
    yield Case("Ctrl-C with others blocked", functools.partial(_interruptible, False, True, signal.SIGINT))
    yield Case("SIGTERM where Ctrl-C is ignored", functools.partial(_interruptible, True, False, signal.SIGTERM))
    yield Case("a time limit of a script", _timed_out)


def _stream_cases() -> Iterator[Case]:
    for closed in ((0,), (1,), (2,), (0, 1), (1, 2), (0, 1, 2)):
        for command in (RENDER, ANIMATE):
            shown = ", ".join(map(str, closed))
            yield Case(f"{command[0]} with {shown} closed", functools.partial(_streams, closed, {}, command))
    for onto in (
        {1: "/dev/full"},
        {2: "/dev/full"},
        {1: "/dev/full", 2: "/dev/full"},
        {0: "/dev/zero"},
        {1: "/dev/zero"},
    ):
        for command in (RENDER, ANIMATE):
            yield Case(f"{command[0]} with {onto}", functools.partial(_streams, (), onto, command))
    for number in (1, 2):
        for command in (RENDER, ANIMATE):
            yield Case(f"{command[0]} with {number} a broken pipe", functools.partial(_broken_pipe, number, command))
    yield Case("standard input that says nothing", _quiet_pipe)
    for columns, lines, variables in (
        (80, 24, {}),
        (0, 0, {}),
        (1, 1, {}),
        (5, 2, {"TERM": "dumb"}),
        (65535, 65535, {}),
    ):
        for command in (RENDER, ANIMATE):
            check = functools.partial(_terminal, columns, lines, variables, command)
            yield Case(f"{command[0]} on a terminal of {columns} x {lines}", check)
    yield Case(
        "a terminal without letters", functools.partial(_terminal, 80, 24, {"LC_ALL": "C", "PYTHONUTF8": "0"}, RENDER)
    )
    yield Case("a terminal that is closed", _terminal_gone)


def cases() -> Iterator[Case]:
    yield from _signal_cases()
    yield from _stream_cases()
