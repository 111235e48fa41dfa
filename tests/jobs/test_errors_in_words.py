"""Errors can be made anew in another language, those of a worker too; `str` of one is its English text."""

import copy
import json
import sys
from pathlib import Path

import pytest

from stereo_reproject.errors import BadInputError, StereoReprojectError, in_one_line
from stereo_reproject.jobs.supervisor import Job, run_worker
from stereo_reproject.jobs.work_folder import work_folder
from stereo_reproject.sequence.writer_process import _result
from stereo_reproject.settings.animation import read_frames
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from stereo_reproject.words import Words, from_data, in_language, joined, to_data

GERMAN = {
    "{folder} is not a folder; choose another folder": "{folder} ist kein Ordner",
    "{name} must be above {low}, not {value}": "{value} für {name} ist nicht über {low}",
    "{name} must be from {low} to {high}, not {value}": "{name}: {value} liegt nicht in {low} bis {high}",
    "the width": "die Breite",
    "the tolerance": "die Toleranz",
    "frames {frames} are more than {max_frames}": "{frames} sind über {max_frames} Bilder",
    "{reason}: {where}": "{where}: {reason}",
    "while writing": "beim Schreiben",
    "{path} is gone, with {what}": "{path} fehlt samt {what}",
    "its frames": "Bildern",
    "Blender {ended} during {stage}": "Blender {ended} bei {stage}",
    "was killed by signal {number} ({name})": "starb an {name}",
    "stopped unexpectedly (exit status {status})": "endete mit {status}",
    "nothing was written, and existing files are kept": "nichts geschrieben",
}


def german(message):
    return GERMAN.get(message, message)


def failed(run, kind=StereoReprojectError):
    with pytest.raises(kind) as caught:
        run()
    return str(caught.value)


def too_wide():
    SceneOverrides(size=(3, 10))


def in_a_file(folder):
    (folder / "file").touch()
    with work_folder(folder / "file", ()):
        pass


def test_an_error_keeps_its_words():
    words = Words("{path} is gone", path="a{b}c")
    error = BadInputError(words)
    assert str(error) is words
    assert (str(error), f"{error}", json.dumps(words)) == ("a{b}c is gone", "a{b}c is gone", '"a{b}c is gone"')


def test_words_are_copied_with_their_fields():
    words = Words("{path} is gone", path="a{b}c")
    again = copy.deepcopy(words)
    assert (again, again.message, again.fields) == (words, words.message, words.fields)


def test_settings(tmp_path):
    said = failed(too_wide)
    assert said == "the width must be from 4 to 65536, not 3"
    assert in_language(said, german) == "die Breite: 3 liegt nicht in 4 bis 65536"


def test_a_number_keeps_its_format():
    said = failed(lambda: StereoSettings(tolerance=-0.5))
    assert said == "the tolerance must be above 1, not -0.5"
    assert in_language(said, german) == "-0.5 für die Toleranz ist nicht über 1"


def test_frames():
    said = failed(lambda: read_frames("1-99999999"))
    assert said.startswith("frames 1-99999999 are more than ")
    assert in_language(said, german).startswith("1-99999999 sind über ")


def test_folders(tmp_path):
    said = failed(lambda: in_a_file(tmp_path))
    assert said == f"{tmp_path / 'file'} is not a folder; choose another folder"
    assert in_language(said, german) == f"{tmp_path / 'file'} ist kein Ordner"


def test_a_failure_of_the_system_is_told_where_it_was():
    said = str(in_one_line(OSError(28, "No space left on device")))
    assert said == "No space left on device: while writing"
    assert in_language(said, german) == "beim Schreiben: No space left on device"


WORKER = """
import json, sys
sys.stdin.readline()
print(json.dumps({event}), flush=True)
"""


def worker_that_says(event):
    return [sys.executable, "-c", WORKER.replace("{event}", repr(event))]


def of_worker(tmp_path, event):
    blend = tmp_path / "room.blend"
    job = Job(blend, tmp_path / "out", StereoSettings())
    return failed(lambda: run_worker(job, lambda _: None, command=worker_that_says(event)))


GONE = Words("{path} is gone, with {what}", path=Path("/a{b}c"), what=Words("its frames"))


def test_words_cross_a_process(tmp_path):
    said = of_worker(tmp_path, {"event": "error", "status": 2, "message": GONE, "words": to_data(GONE)})
    assert said == "/a{b}c is gone, with its frames"
    assert in_language(said, german) == "/a{b}c fehlt samt Bildern"


def test_a_message_without_words_crosses_too(tmp_path):
    assert of_worker(tmp_path, {"event": "error", "status": 1, "message": "a {b} c"}) == "a {b} c"


def test_a_crash(tmp_path):
    said = of_worker(tmp_path, {"event": "note", "message": ""})
    assert said.startswith("Blender stopped unexpectedly (exit status 0) during ")
    assert said.endswith("; nothing was written, and existing files are kept")
    assert in_language(said, german).startswith("Blender endete mit 0 bei ")
    assert in_language(said, german).endswith("; nichts geschrieben")


def test_words_cross_from_the_writer():
    error = _result({"error": str(GONE), "words": to_data(GONE), "status": 2, "hopeless": False})
    assert in_language(str(error), german) == "/a{b}c fehlt samt Bildern"


@pytest.mark.parametrize(
    "data",
    [
        None,
        "text",
        {},
        {"message": "{path} is here", "fields": {"path": "x"}},
        {"message": "{path} is gone", "fields": {}},
        {"message": "{", "fields": {}},
        {"message": "{0}", "fields": {}},
        {"message": "{path.x}", "fields": {"path": "x"}},
        {"message": "{path}", "fields": {"path": {"message": 1}}},
    ],
)
def test_data_that_does_not_make_the_text_is_passed_over(data):
    assert type(from_data("x is gone", data)) is str


def test_parts_are_joined_without_the_empty_ones():
    text = joined("; ", first=Words("its frames"), second="", third=Words("the width"))
    assert text == "its frames; the width"
    assert in_language(text, german) == "Bildern; die Breite"
