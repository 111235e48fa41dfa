"""What every test relies on: markers that follow from the folder, the scenes beside the checkout, and in CI no test
that quietly did not run."""

import atexit
import os
import shutil
import signal
import sys
import tempfile
from functools import partial
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
SHARED_SCENES = TESTS.parents[1] / "shared" / "scenes"
SHARED_SCENES_ABSENT = "shared scenes absent"
USER_FOLDER_VARIABLE = "STEREO_REPROJECT_USER_FOLDER"

MARKERS_OF_FOLDER = {
    "blender": ("blender",),
    "operators": ("blender",),
    "render": ("blender", "render"),
    "gui": ("gui",),
}
# In CI a skipped test with one of these markers is a failure: there Blender is installed, or the run is worth nothing.
MUST_RUN_IN_CI = "blender"


EXIT_STATUS = pytest.StashKey[int]()


def pytest_configure(config: pytest.Config) -> None:
    # Registered before Blender is loaded, and so called after all that Blender registers.
    atexit.register(_end_process, config)
    _listen_to_signals()
    _have_temporary_files_removed(config)
    # The user's own files are neither read nor written: tests begin alike on every machine. Those that keep costs name
    # a folder of their own.
    os.environ[USER_FOLDER_VARIABLE] = ""


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    session.config.stash[EXIT_STATUS] = int(session.exitstatus)


def _end_process(config: pytest.Config) -> None:
    """End this process with the status of its tests, before the libraries that came with Blender are taken apart:
    Blender 4.5 as a Python module sometimes never comes back from that."""
    if EXIT_STATUS in config.stash:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(config.stash[EXIT_STATUS])


def _listen_to_signals() -> None:
    """Have the runs that tests start listen to signals, also where `make test` was started to ignore them: in the
    background of a script, or with nohup. Children inherit what is ignored, but not what is handled by doing nothing.
    """
    for name in ("SIGINT", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) == signal.SIG_IGN:
            signal.signal(number, lambda *_: None)


def _have_temporary_files_removed(config: pytest.Config) -> None:
    """Give all tests, and what they start, a folder for temporary files that goes with them: each Blender that is
    loaded as a Python module leaves one of its own there. `tmp_path` stays where pytest keeps it."""
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", tempfile.gettempdir())
    folder = tempfile.mkdtemp(prefix="stereo-reproject-tests-")
    config.add_cleanup(partial(shutil.rmtree, folder, ignore_errors=True))
    os.environ.update(dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder))
    tempfile.tempdir = None


@pytest.fixture(scope="session")
def shared_scenes() -> Path:
    """The folder of test scenes beside the checkout; a test that asks for it skips where that is absent."""
    if not SHARED_SCENES.is_dir():
        pytest.skip(f"{SHARED_SCENES_ABSENT}: no {SHARED_SCENES}")
    return SHARED_SCENES


def markers_of(path: Path) -> tuple[str, ...]:
    for folder, markers in MARKERS_OF_FOLDER.items():
        if path.is_relative_to(TESTS / folder):
            return markers
    return ()


def pytest_itemcollected(item: pytest.Item) -> None:
    for marker in markers_of(item.path):
        item.add_marker(marker)


def in_ci() -> bool:
    return os.environ.get("CI", "").lower() not in ("", "0", "false")


def fail_if_skipped(report: pytest.TestReport | pytest.CollectReport) -> None:
    if not in_ci() or not report.skipped or hasattr(report, "wasxfail"):
        return
    reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    reason = reason.removeprefix("Skipped: ")
    if not reason.startswith(SHARED_SCENES_ABSENT):
        report.outcome = "failed"
        report.longrepr = f"skipped, and in CI a test that needs Blender must run: {reason}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item):
    report = yield
    if item.get_closest_marker(MUST_RUN_IN_CI):
        fail_if_skipped(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector):
    """A module may skip as a whole, before it has any test to mark."""
    report = yield
    if MUST_RUN_IN_CI in markers_of(collector.path):
        fail_if_skipped(report)
    return report
