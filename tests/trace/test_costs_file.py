"""The file of measured costs: whatever happened to it, no frame fails by it, and nothing that it holds is lost."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from stereo_reproject.trace.costs import MEASURED, TraceCosts
from stereo_reproject.trace.costs_file import COSTS_FILE, COSTS_SCHEMA, MAX_COSTS_FILE_BYTES, MAX_KEPT_COSTS, CostsFile

ROOT = Path(__file__).resolve().parents[2]

ASSUMED_COSTS = TraceCosts()
MEASURED_COSTS = TraceCosts(1.5, 0.25, 0.5, 0.125, MEASURED)
SECONDS = 60.0

RENEWER = """
import sys
from dataclasses import replace
from pathlib import Path
from stereo_reproject.trace.costs import MEASURED
from stereo_reproject.trace.costs_file import CostsFile
file = CostsFile(Path(sys.argv[1]))
for k in range(1, 60):
    cost = k / 60
    file.renew(sys.argv[2], lambda known: replace(known, resync_share=cost, source=MEASURED))
"""


@pytest.fixture
def file(tmp_path):
    return CostsFile(tmp_path / "of the user" / COSTS_FILE)


def put(file, content):
    file.path.parent.mkdir(exist_ok=True)
    file.path.write_bytes(content)


def measure(file, key="a device", costs=MEASURED_COSTS):
    file.renew(key, lambda _: costs)


def test_costs_are_assumed_until_they_are_measured_and_then_kept(file):
    assert file.read("a device") == ASSUMED_COSTS
    assert not file.path.parent.exists()
    measure(file)
    assert file.read("a device") == MEASURED_COSTS
    assert file.read("another") == ASSUMED_COSTS
    assert list(file.path.parent.iterdir()) == [file.path]


def test_what_is_learned_rests_on_what_is_in_the_file(file):
    told = []
    measure(file)
    file.renew("a device", lambda known: told.append(known) or known)
    file.renew("another", lambda known: told.append(known) or known)
    assert told == [MEASURED_COSTS, ASSUMED_COSTS]


def test_what_changes_nothing_is_not_written(file):
    measure(file)
    before = file.path.stat().st_ino
    measure(file)
    assert file.path.stat().st_ino == before
    measure(file, costs=replace(MEASURED_COSTS, resync_share=0.5))
    assert file.path.stat().st_ino != before


def test_other_keys_stay_whatever_they_hold(file):
    held = {"of a later version": {"costs": [1, None]}, "broken": 3, "a device": "no costs"}
    put(file, json.dumps({"schema": COSTS_SCHEMA, "costs": held}).encode())
    assert [file.read(key) for key in (*held, "none")] == [ASSUMED_COSTS] * 4
    measure(file)
    kept = json.loads(file.path.read_text())["costs"]
    assert kept == {**held, "a device": MEASURED_COSTS.numbers}


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"\xff\xfe", b"[" * 30000, b"1" * 5000, b'{"schema": 1', b"\0" * 100, b'{"schema": 1, "costs": [3]}'],
)
def test_a_broken_file_is_as_none_and_replaced(file, content):
    put(file, content)
    assert file.read("a device") == ASSUMED_COSTS
    measure(file)
    assert file.read("a device") == MEASURED_COSTS


@pytest.mark.parametrize(
    "content", [b"[]", b"null", b"{}", b'{"schema": 2, "costs": {}}', b'"text"', b"{" * MAX_COSTS_FILE_BYTES + b" "]
)
def test_what_is_not_ours_is_left_alone(file, content):
    put(file, content)
    assert file.read("a device") == ASSUMED_COSTS
    measure(file)
    assert file.path.read_bytes() == content
    assert list(file.path.parent.iterdir()) == [file.path]


@pytest.mark.skipif(os.name != "posix", reason="kinds of files as POSIX has them")
@pytest.mark.parametrize("kind", ["folder", "link", "pipe"])
def test_what_is_no_file_is_left_alone(file, kind, tmp_path):
    file.path.parent.mkdir()
    other = tmp_path / "other.json"
    other.write_text(json.dumps({"schema": COSTS_SCHEMA, "costs": {"a device": MEASURED_COSTS.numbers}}))
    make = {
        "folder": file.path.mkdir,
        "link": lambda: file.path.symlink_to(other),
        "pipe": lambda: os.mkfifo(file.path),
    }
    make[kind]()
    before = file.path.lstat()
    assert file.read("a device") == ASSUMED_COSTS
    measure(file)
    assert file.path.lstat().st_ino == before.st_ino


def test_a_folder_that_cannot_be_made_is_no_error(tmp_path):
    (tmp_path / "taken").write_text("a file")
    file = CostsFile(tmp_path / "taken" / "folder" / COSTS_FILE)
    assert file.read("a device") == ASSUMED_COSTS
    measure(file)
    assert file.read("a device") == ASSUMED_COSTS


def test_the_file_does_not_grow_for_ever(file):
    for number in range(MAX_KEPT_COSTS + 5):
        measure(file, f"device {number}")
    measure(file, "device 7", replace(MEASURED_COSTS, resync_share=0.5))
    measure(file, "one more")
    kept = json.loads(file.path.read_text())["costs"]
    assert len(kept) == MAX_KEPT_COSTS
    assert "device 5" not in kept
    assert list(kept)[-2:] == ["device 7", "one more"]
    assert file.path.stat().st_size < MAX_COSTS_FILE_BYTES


def test_two_processes_that_write_at_once_leave_a_whole_file(file):
    measure(file)
    command = [sys.executable, "-W", "error", "-c", RENEWER, str(file.path)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    running = [subprocess.Popen([*command, key], env=environment) for key in ("one", "two")]
    while any(process.poll() is None for process in running):
        assert file.read("a device") == MEASURED_COSTS
    assert [process.wait(SECONDS) for process in running] == [0, 0]
    assert file.read("a device") == MEASURED_COSTS
    # Whichever was last has written its last.
    assert 59 / 60 in (file.read(key).resync_share for key in ("one", "two"))
    assert list(file.path.parent.iterdir()) == [file.path]
