"""The hostile suite's quick part: a sample of what is refused before a worker starts, and that the suite itself counts,
bounds and cleans up. The suite proper is `make hostile`."""

import contextlib
import importlib.util
import os
import subprocess
import time
from pathlib import Path

import pytest

from stereo_reproject.jobs.work_folder import FILES
from stereo_reproject.programs import cli
from tests.hostile import __main__ as suite
from tests.hostile.case import PROMISED, Case, Row, load_row, row_names
from tests.hostile.program import (
    PAIR,
    PROGRAMS,
    Outcome,
    assert_bad_input,
    assert_nothing_left,
    assert_one_line_or_done,
)
from tests.hostile.rows import options

pytestmark = pytest.mark.skipif(os.name != "posix", reason="forks, mounts and signals as POSIX has them")

EACH = 16
"""One in so many of what is refused is tried here."""


def refused(refusal, folder, monkeypatch, capfdbinary):
    monkeypatch.chdir(folder)
    argv = [os.fsdecode(argument) for argument in refusal.arguments]
    started = time.monotonic()
    status = cli.main(argv, host=cli.Host(worker_command=["no worker is started"]))
    printed = capfdbinary.readouterr()
    assert_bad_input(Outcome(status, printed.out, printed.err, time.monotonic() - started, False), *refusal.words)
    assert_nothing_left(folder)


@pytest.mark.parametrize("refusal", options.refusals()[::EACH], ids=lambda refusal: ascii(refusal.name)[:60])
def test_what_means_nothing_is_refused(refusal, tmp_path, monkeypatch, capfdbinary):
    refused(refusal, tmp_path, monkeypatch, capfdbinary)


def test_all_rows_are_there():
    assert set(row_names()) == set(PROMISED)


@pytest.mark.parametrize("name", ["kills", "faults", "scripts"])
def test_rows_are_as_long_as_promised(name):
    """The others, whose cases need Blender or much time to be made, are counted when they are tried."""
    row = load_row(name)
    assert row.title
    assert row.seen_before <= PROMISED[name] <= len(row.cases)


def test_a_row_that_is_too_short_is_no_row(monkeypatch):
    monkeypatch.setitem(PROMISED, "scripts", 1000)
    with pytest.raises(ValueError, match="1000 are promised"):
        load_row("scripts")


@pytest.mark.parametrize("name", ["worker", "writer", "heartbeat"])
def test_the_suite_knows_a_run_s_processes(name):
    assert importlib.util.find_spec(f"{PROGRAMS}.{name}") is not None


def test_the_suite_knows_a_pair_s_files():
    assert PAIR == FILES


# The suite itself


def passes(folder):
    assert not list(folder.iterdir())
    assert Path.cwd() == folder


def fails(folder):
    (folder / "kept").touch()
    raise AssertionError("a promise is broken")


def is_wrong(folder):
    raise KeyError("a name")


def dies(folder):
    os._exit(3)


def never_ends(folder):
    with contextlib.suppress(subprocess.TimeoutExpired):
        subprocess.run(["tail", "-f", "/dev/null"], check=False)


def attempted(tmp_path, *checks, keep=False):
    row = Row("row", "a row", 3, tuple(Case(check.__name__, check) for check in checks))
    return row, {result.case: result for result in suite.attempt([row], tmp_path, jobs=2, keep=keep)}


def test_each_way_to_fail_is_a_failure(tmp_path):
    row, results = attempted(tmp_path, fails, passes, is_wrong, dies)
    assert results["passes"].error == ""
    assert results["fails"].error == "a promise is broken"
    assert "the case is wrong" in results["is_wrong"].error
    assert "KeyError" in results["is_wrong"].error
    assert results["dies"].error == "the case itself ended with 3"
    assert list(tmp_path.iterdir()) == []
    assert suite.table([row], list(results.values())).splitlines()[-1].split()[-3:] == ["3", "4", "1"]


def test_a_case_that_never_ends_is_ended_with_all_that_it_started(tmp_path, monkeypatch):
    monkeypatch.setattr(suite, "CASE_SECONDS", 0.3)
    _, results = attempted(tmp_path, never_ends)
    assert results["never_ends"].error == "not done after 0 s"


def test_folders_stay_when_they_are_to_be_kept(tmp_path):
    _, results = attempted(tmp_path, fails, keep=True)
    assert (Path(results["fails"].folder) / "kept").exists()


@pytest.mark.parametrize(
    ("status", "stderr", "left", "broken"),
    [
        (2, b"stereo_reproject: error: no\nand more\n", (), "not one line"),
        (2, b"Traceback (most recent call last):\n", (), "a traceback"),
        (1, b"stereo_reproject: error: a defect of stereo_reproject: x\n", (), "defect"),
        (-11, b"", (), "a signal ended it"),
        (3, b"stereo_reproject: error: no\n", (), "an odd exit status"),
        (2, b"stereo_reproject: error: \x1b[2J\n", (), "unprintable"),
        (0, b"something\n", (), "says something"),
        (0, b"", ("/tmp/x",), "left behind"),
    ],
)
def test_a_bad_end_is_found(status, stderr, left, broken):
    with pytest.raises(AssertionError, match=broken):
        assert_one_line_or_done(Outcome(status, b"", stderr, 1.0, False, left))


@pytest.mark.parametrize("name", [".stereo_reproject-1-2", "x.exr.tmp", ".x.svg.abc.tmp", "0001.claim.1", "run-ab"])
def test_what_is_half_made_is_found(tmp_path, name):
    (tmp_path / "whole").touch()
    assert_nothing_left(tmp_path, "whole")
    (tmp_path / name).touch()
    with pytest.raises(AssertionError, match="half-made"):
        assert_nothing_left(tmp_path, "whole", name)
