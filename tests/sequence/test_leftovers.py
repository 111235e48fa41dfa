"""What is left beside the frames by a run that has finished none."""

import subprocess
import sys

import pytest

from stereo_reproject.jobs.work_folder import machine
from stereo_reproject.sequence.journal_folder import JOURNAL
from stereo_reproject.sequence.leftovers import missing_folders, remove_empty, remove_leftovers

FOUND = "found-0123456789abcdef-costs.json"
RUN = "run-0123456789abcdef"


@pytest.fixture
def journal(tmp_path):
    """The journal of a run that was ended in its first frame."""
    folder = tmp_path / JOURNAL
    folder.mkdir()
    (folder / FOUND).write_text("{}")
    (folder / "0001.claim.1").write_text("")
    return folder


def say_run(journal, pid):
    """A run's file, of this process of this machine."""
    (journal / RUN).write_text(f'{{"machine": "{machine()}", "pid": {pid}}}\n{0:020}')


@pytest.fixture
def other():
    """A process that lives until the test is over."""
    process = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    yield process
    process.kill()
    process.communicate()


def test_a_journal_that_tells_of_no_frame_is_removed(journal, other):
    say_run(journal, other.pid)
    other.kill()
    other.wait()
    remove_leftovers(journal.parent)
    assert list(journal.parent.iterdir()) == []


@pytest.mark.parametrize("name", ["0001.json", "shot_0001.json", "movie-0123456789abcdef.json", "of the user's"])
def test_one_that_tells_of_a_frame_stays(journal, name):
    (journal / name).write_text("{}")
    remove_leftovers(journal.parent)
    assert {name, FOUND} <= {path.name for path in journal.iterdir()}


def test_one_in_which_another_run_is_at_work_stays(journal, other):
    say_run(journal, other.pid)
    before = sorted(journal.iterdir())
    remove_leftovers(journal.parent)
    assert sorted(journal.iterdir()) == before


def test_a_link_is_left_alone(tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    (other / FOUND).write_text("{}")
    (tmp_path / JOURNAL).symlink_to(other)
    remove_leftovers(tmp_path)
    assert (other / FOUND).exists()


def test_folders_that_were_missing_are_removed_unless_something_is_in_them(tmp_path):
    shots, others = tmp_path / "film" / "shots", tmp_path / "film" / "others"
    missing = missing_folders([shots, others, tmp_path])
    assert set(missing) == {tmp_path / "film", shots, others}
    for folder in (shots, others):
        folder.mkdir(parents=True)
    (others / "0001.png").write_text("")
    remove_empty(missing)
    assert not shots.exists()
    assert others.exists()
    (others / "0001.png").unlink()
    remove_empty(missing)
    assert list(tmp_path.iterdir()) == []
