"""What a run leaves and says while it goes on."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from stereo_reproject.images.exr import read_channels, read_eye
from tests.blender.toolbox import mirror_before_wall

SIZE = (96, 54)

HALF_ROUNDING = 2.0**-11
"""Of a half float, relative."""


@pytest.fixture
def scene():
    return mirror_before_wall(*SIZE, samples=4)


@pytest.fixture
def rendered(extension, scene, place):
    """Runs a job that renders the scene's pair; returns the pictures that it announced, as (view, colour), and the
    passes of both eyes in the end."""
    from stereo_reproject_extension.operators.render import PAIR_FILES, settings_of
    from stereo_reproject_extension.operators.run import BackgroundJob, Pictures
    from stereo_reproject_extension.stereo_reproject.jobs.progress import USUAL, Progress

    def render(which):
        seen = []

        class Watched(BackgroundJob):
            def _on_event(self, event):
                super()._on_event(event)
                if event["event"] == "picture":
                    channels = read_channels(Path(event["file"]))
                    seen.append((event["view"], np.stack([channels[letter] for letter in "RGBA"], axis=-1)))

        # What is traced, and how, must not follow from seconds that were measured.
        settings = replace(settings_of(scene, preview=False), accuracy="draft", fill="packed")
        job = Watched(
            scene, settings, "render", PAIR_FILES, Progress(0.0, USUAL["render"]), pictures=getattr(Pictures, which)
        )
        try:
            job.wait()
            assert job.error is None
            eyes = {view: next(iter(read_eye(job.folder / f"{view}.exr").values())) for view in ("left", "right")}
        finally:
            job.close()
        assert list(place.iterdir()) == []
        return seen, eyes

    return render


def test_both_eyes_are_seen_while_they_are_made(rendered):
    seen, eyes = rendered("FROM_THE_FIRST_SAMPLE")
    views = [view for view, _ in seen]
    assert views == sorted(views)
    assert views.count("left") >= 2
    assert views.count("right") >= 2
    assert all(picture.shape == (SIZE[1], SIZE[0], 4) for _, picture in seen)
    for view, (first, last) in {
        view: [[picture for eye, picture in seen if eye == view][k] for k in (0, -1)] for view in eyes
    }.items():
        whole = eyes[view]["Combined"]
        assert np.allclose(last, whole, rtol=HALF_ROUNDING, atol=HALF_ROUNDING)
        assert not np.allclose(first, whole, rtol=HALF_ROUNDING, atol=HALF_ROUNDING)


def test_pictures_change_no_pixel_of_the_pair(rendered):
    (nothing, plain), (some, watched), (more, looked) = (
        rendered(which) for which in ("NONE", "AS_THEY_ARE_MADE", "FROM_THE_FIRST_SAMPLE")
    )
    assert nothing == []
    assert len(more) == len(some) + 1
    for view, passes in plain.items():
        for name, image in passes.items():
            assert np.array_equal(image, watched[view][name], equal_nan=True), (view, name)
            assert np.array_equal(image, looked[view][name], equal_nan=True), (view, name)


def test_a_run_without_a_window_leaves_no_pictures(extension, scene, place, monkeypatch):
    from stereo_reproject_extension.operators.run import BackgroundJob

    told = BackgroundJob._on_event
    events = []
    monkeypatch.setattr(BackgroundJob, "_on_event", lambda self, event: (events.append(event), told(self, event)))
    assert bpy.ops.render.stereo_reproject_image(preview=True) == {"FINISHED"}
    assert {event["event"] for event in events} >= {"stage"}
    assert not [event for event in events if event["event"] == "picture"]


def test_a_cancelled_run_says_for_a_while_that_nothing_was_changed(extension, scene, place, monkeypatch, capfd):
    from stereo_reproject_extension.operators import jobs
    from stereo_reproject_extension.operators.results import result_of

    later = []
    monkeypatch.setattr(bpy.app.timers, "register", lambda function, **_: later.append(function))
    cancel_at(monkeypatch, lambda event: event.get("stage") == "source")
    assert bpy.ops.render.stereo_reproject_image() == {"CANCELLED"}
    assert "Cancelled: nothing was changed" in capfd.readouterr().out
    (forget,) = (function for function in later if getattr(function, "func", None) is jobs._forget_words)
    result, words = result_of(scene), result_of(scene).ended
    assert words.startswith("Cancelled")
    result.ended = "Something else since"
    forget()
    assert result.ended == "Something else since"
    result.ended = words
    forget()
    assert result.ended == ""


def test_a_cancelled_animation_says_how_many_frames_stay(extension, scene, place, monkeypatch, capfd):
    scene.frame_start, scene.frame_end = 11, 40
    scene.render.filepath = str(place / "shots" / "shot_")
    words = cancel_at(monkeypatch, lambda event: event["event"] == "frame")
    assert bpy.ops.render.stereo_reproject_animation() == {"CANCELLED"}
    # Others may have been written meanwhile, and the last one ended before it was recorded: it would be rendered again.
    there = len(list((place / "shots").glob("shot_*_L.png")))
    assert 1 <= there < 30
    said = ["1 frame is finished and stays", *(f"{count} frames are finished and stay" for count in range(2, 30))]
    lines = {f"Cancelled: {said[count - 1]}. To go on with the others" for count in (there - 1, there) if count}
    printed = capfd.readouterr().out
    assert any(line in printed for line in lines)
    assert "switch off Overwrite" in printed
    first = next(text for text in words if text.startswith("Frame"))
    assert re.match(r"Frame 11 \(1 of 30\)  \d+ %", first)
    assert _buttons_below(scene)[-2:] == ["render.stereo_reproject_view_animation", "stereo_reproject.look_at_frame"]


def _buttons_below(scene):
    """The operators that the panel has below the last result."""
    from stereo_reproject_extension.operators.drawing import draw_outcome

    found = []

    class Drawn:
        def __getattr__(self, _):
            return lambda *_, **__: self

        def operator(self, name, **_):
            found.append(name)
            return self

    context = SimpleNamespace(scene=scene, region=None, space_data=None, preferences=bpy.context.preferences)
    draw_outcome(Drawn(), context)
    return found


def cancel_at(monkeypatch, condition):
    """Have runs cancelled at the first event for which condition is true; return the list that gets the words about
    the progress at each event.
    """
    from stereo_reproject_extension.operators.run import BackgroundJob
    from stereo_reproject_extension.operators.run_words import progress_of

    told, words = BackgroundJob._on_event, []

    def tell(self, event):
        told(self, event)
        words.append(progress_of(self)[1])
        if condition(event):
            self.cancel()

    monkeypatch.setattr(BackgroundJob, "_on_event", tell)
    return words


def test_every_place_of_the_window_says_the_same(extension, scene, monkeypatch):
    """A panel may be drawn anew at any moment, because the mouse is over it; a status bar is not."""
    from stereo_reproject_extension.operators import drawing, jobs

    far = iter([0.40, 0.41, 0.42, 0.43])
    run = SimpleNamespace(
        uid=scene.session_uid,
        stage="source",
        detail="",
        stage_words={},
        far=lambda: (next(far), 42.0),
        looks=0,
        **dict.fromkeys(("animation", "picture", "error")),
        **dict.fromkeys(("is_ending", "finished"), False),
        savings=[],
    )
    monkeypatch.setattr(jobs, "_running", [run])
    monkeypatch.setattr(jobs, "_shown_progress", [])
    said = []
    window = SimpleNamespace(_tell=lambda ways: said.append(ways[0][0]), uses_render_result=True)
    layout = SimpleNamespace(
        progress=lambda *, factor, text: said.append((factor, text)), operator=lambda *_, **__: None
    )
    for _ in range(2):
        jobs.JobOperator.modal(window, bpy.context, SimpleNamespace(type="TIMER"))
        run.stage = "fill"
        drawing.draw_progress(layout)
    at_first, panel, then, panel_then = said
    assert panel == (0.40, "40 %, 42 s left")
    assert at_first.startswith("40 %, 42 s left.  Rendering the first eye")
    assert panel_then == (0.41, "41 %, 42 s left")
    assert then.startswith(panel_then[1])


@pytest.mark.parametrize(
    ("room", "lines"),
    [
        (200, ["Frame 1 (1 of 6)  13 %.  Rendering the first eye, 9 s saved so far by 1 frame   |   Esc: Cancel"]),
        (80, ["Frame 1 (1 of 6)  13 %", "Rendering the first eye, 9 s saved so far by 1 frame   |   Esc: Cancel"]),
        (50, ["Frame 1 (1 of 6)  13 %", "Rendering the first eye   |   Esc: Cancel"]),
        (25, ["Frame 1 (1 of 6)  13 %", "Esc: Cancel"]),
        (5, ["Frame 1 (1 of 6)  13 %", "Esc: Cancel"]),
    ],
)
def test_a_narrow_image_editor_says_how_to_cancel_too(extension, room, lines):
    from stereo_reproject_extension.operators.progress_line import way_that_fits
    from stereo_reproject_extension.operators.run_words import RunProgress, ways_to_say

    now = RunProgress(0.13, "Frame 1 (1 of 6)  13 %", "Rendering the first eye", "9 s saved so far by 1 frame")
    assert way_that_fits(ways_to_say(now), room, len) == lines
