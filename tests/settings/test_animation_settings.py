"""Which frames are rendered and how: as they are written on a command line, and what is refused."""

import dataclasses
from pathlib import Path

import pytest

from stereo_reproject.delivery.layouts import LAYOUTS
from stereo_reproject.errors import BadInputError
from stereo_reproject.programs import cli
from stereo_reproject.settings.animation import EXISTING, MAX_FRAMES, AnimationSettings, read_every, read_frames
from stereo_reproject.settings.frame import MAX_FRAME


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("12", [12]),
        ("1-4", [1, 2, 3, 4]),
        ("3-3", [3]),
        ("1-6:2", [1, 3, 5]),
        ("1-5:2", [1, 3, 5]),
        ("1-5:9", [1]),
        ("20,1-3", [1, 2, 3, 20]),
        ("1-4,3-6", [1, 2, 3, 4, 5, 6]),
        (" 1-2 , 7 ", [1, 2, 7]),
        ("0-1", [0, 1]),
        ("0001-0003", [1, 2, 3]),
        (str(MAX_FRAME), [MAX_FRAME]),
    ],
)
def test_frames_as_people_write_them(text, frames):
    assert read_frames(text) == tuple(frames)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "of the form 1-24, 1-24:2 or 1-10,15, not ''"),
        ("all", "of the form"),
        ("1-", "of the form"),
        ("1:2", "of the form"),
        ("1-2:", "of the form"),
        ("1..5", "of the form"),
        ("1.5", "of the form"),
        ("1,,3", "of the form"),
        ("1,", "of the form"),
        ("1-24x2", "of the form"),
        ("1234567890", "of the form"),
        ("3-1", "frames 3-1 are none"),
        ("1-3:0", "frames 1-3:0 are none"),
        ("1, 5-4", "frames 5-4 are none"),
        ("1-999999999", f"frames 1-999999999 are more than {MAX_FRAMES}"),
        (str(MAX_FRAME + 1), f"frames must be from 0 to {MAX_FRAME}"),
        ("-3--1", f"frames must be from 0 to {MAX_FRAME}"),
        ("-1-1", f"frames must be from 0 to {MAX_FRAME}"),
    ],
)
def test_frames_that_are_none_are_one_line(text, part):
    with pytest.raises(BadInputError) as refused:
        read_frames(text)

    assert part in str(refused.value)
    assert "\n" not in str(refused.value)


def test_frames_that_are_named_again_and_again_are_not_counted_for_ever():
    with pytest.raises(BadInputError, match="again and again"):
        read_frames(",".join(["0-1048573"] * 800))


@pytest.mark.parametrize(("text", "every"), [("every=6", 6), ("6", 6), ("every=1", 1)])
def test_every_so_many_frames(text, every):
    assert read_every(text) == every


@pytest.mark.parametrize(
    "text", ["", "every", "every=", "every=0", "0", "-1", "every=1.5", "Every=6", "6 ", "1234567890"]
)
def test_what_is_no_number_of_frames_is_refused(text):
    with pytest.raises(BadInputError, match="--compare must be of the form every=6, not"):
        read_every(text)


@pytest.mark.parametrize(
    ("fields", "part"),
    [
        ({"frames": ()}, "no frames are named"),
        ({"frames": (1, 2.0)}, "whole numbers"),
        ({"frames": (True,)}, "whole numbers"),
        ({"frames": (2, 1)}, "in rising order, each once"),
        ({"frames": (1, 1)}, "in rising order, each once"),
        ({"frames": (1, MAX_FRAME + 1)}, f"from 0 to {MAX_FRAME}"),
        ({"existing": "append"}, "existing must be one of refuse, resume, overwrite, keep, not 'append'"),
        ({"layout": "Side-by-side"}, "the layout must be one of individual, multi-view"),
        ({"compare_every": 0}, "compare every=0: must be a whole number from 1"),
        ({"compare_every": 2.0}, "compare every=2.0"),
        ({"compare_every": True}, "compare every=True"),
    ],
)
def test_settings_check_themselves(fields, part):
    with pytest.raises(BadInputError) as refused:
        AnimationSettings(**fields)
    assert part in str(refused.value)
    assert "\n" not in str(refused.value)


def test_what_may_be_asked_for():
    for existing in EXISTING:
        for layout in (None, *LAYOUTS):
            AnimationSettings(frames=(0, 1, 5), existing=existing, layout=layout, compare_every=1)
    with pytest.raises(dataclasses.FrozenInstanceError):
        AnimationSettings().holes = True


BAD_OPTIONS = [
    (["--frames", "1-"], "argument --frames: frames must be of the form 1-24, 1-24:2 or 1-10,15, not '1-'"),
    (["--frames", "5-1"], "argument --frames: frames 5-1 are none"),
    (["--frame", "-1"], "frames must be from 0 to"),
    (["--frames"], "argument --frames: expected one argument"),
    (["--frame", "1", "--frames", "1-3"], "--frame and --frames each say which frames are rendered"),
    (["--resume", "--overwrite"], "argument --overwrite: not allowed with argument --resume"),
    (["--compare"], "argument --compare: expected one argument"),
    (["--compare", "every=0"], "argument --compare: --compare must be of the form every=6, not 'every=0'"),
    (["--layout", "sbs"], "argument --layout: invalid choice: 'sbs' (choose from"),
    (["--resum"], "unrecognized arguments: --resum"),
]


@pytest.mark.parametrize(("options", "part"), BAD_OPTIONS, ids=[" ".join(options) for options, _ in BAD_OPTIONS])
def test_bad_options_are_one_line_before_anything_is_made(tmp_path, capsys, options, part):
    (tmp_path / "room.blend").write_bytes(b"BLENDER-v502")
    nobody = cli.Host(worker_command=[str(tmp_path / "nobody")])
    argv = ["animate", str(tmp_path / "room.blend"), "--output", str(tmp_path / "out"), *options]
    assert cli.main(argv, host=nobody) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("stereo_reproject: error: ")
    assert printed.err.count("\n") == 1
    assert part in printed.err
    assert not Path(tmp_path / "out").exists()
