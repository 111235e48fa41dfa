"""With a table of translations, panels and reports speak its language: texts as they are, and those with figures."""

from types import MappingProxyType, SimpleNamespace

import bpy
import pytest

TABLE = {
    "{time} saved": "{time} gespart",
    "{sentence}.": "{sentence}!",
    "Nearly as good as rendering both eyes": "Fast so gut wie beide Augen gerendert",
    "Accuracy {better} would take {time}": "{time} mehr für {better}",
    "Exact": "Genau",
    "Error (1 = only noise)": "Fehler (1 = nur Rauschen)",
    "Only Cycles and EEVEE can be reprojected: choose one in Render properties.": "Nur Cycles und EEVEE",
    "Predicted: {gain} times as fast as multiview": "{gain}-mal so schnell",
    "1 stereo frame rendered, {saved}": "Ein Stereobild: {saved}",
    "{count} stereo frames rendered, {saved}": "{count} Stereobilder: {saved}",
    "{end}: {side} ({pixels} px)": "{end}: {side}, {pixels} Pixel",
    "Nearest": "Nächster",
    "{percent} % in front": "{percent} % davor",
    "nearest {nearest}, farthest {farthest}": "von {nearest} bis {farthest}",
    "at the screen": "auf dem Schirm",
    "{frame}  {far}": "{far} ({frame})",
    "Frame {frame} ({place} of {count})": "Bild {frame}, {place}/{count}",
    "{share}, {left}": "{share}, {left}",
    "{time} left": "noch {time}",
    "{saved} so far by {count} frames": "bisher {saved} mit {count} Bildern",
    "Cancelled: {count} frames are finished and stay": "Abgebrochen: {count} Bilder bleiben",
    "To go on with the others, switch off Overwrite in Output first": "Dazu erst Überschreiben ausschalten",
    "Ending": "Endet",
    "camera {camera} is a panoramic mirror ball, which is not supported: choose another panorama type": (
        "kugelförmig ist {camera}"
    ),
    "{what} is not in front of the camera": "davor liegt nicht {what}",
    "The focus distance": "der Fokus",
    "no view layer of scene {scene} is used for rendering: switch one on": "keine Ebene in {scene}",
    "no depth is left: raise In Front or Behind": "keine Tiefe",
    "{path} cannot be written: {reason}": "nicht zu schreiben: {path}, {reason}",
    "the disk is full": "die Platte ist voll",
    "the last frame is not shown: {reason}": "letztes Bild nicht gezeigt: {reason}",
    "the scene {scene} was deleted meanwhile": "die Szene {scene} ist gelöscht",
    ". The pair is kept in {folder}: Render > {where}": ". Das Paar ist in {folder}: {where}",
    "Open Kept Stereo Pair": "Paar öffnen",
}


@pytest.fixture
def german(extension, monkeypatch):
    """Blender in German, with a made-up table for the extension's texts.

    Blender as a Python module has no languages: its own look-up is replaced here, and is used in a window
    (tests/gui/test_widths_in_window.py).
    """
    from stereo_reproject_extension.operators import text

    for name in ("pgettext_iface", "pgettext_rpt"):
        monkeypatch.setattr(text, name, lambda message: TABLE.get(message, message))


class Drawn:
    """A layout that notes the labels that are drawn into it; it stands for the parts of itself too."""

    def __init__(self):
        self.labels = []

    def label(self, *, text, **_):
        self.labels.append(text)

    def __getattr__(self, name):
        return lambda *_, **__: self


def paragraph(text):
    from stereo_reproject_extension.operators import drawing

    drawn = Drawn()
    wide = SimpleNamespace(region=SimpleNamespace(width=4000), preferences=bpy.context.preferences)
    drawing.paragraph(drawn, wide, text)
    return " ".join(drawn.labels)


def test_a_sentence_of_the_panel_is_translated(german):
    from stereo_reproject_extension.operators.panels import obstacle

    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    assert paragraph(obstacle(bpy.context.scene)) == "Nur Cycles und EEVEE"


def test_the_verdict_is_translated_with_its_figures(german):
    from stereo_reproject_extension.stereo_reproject.report.verdict import _quality, saved_words
    from stereo_reproject_extension.stereo_reproject.words import Words

    assert paragraph(Words("{sentence}.", sentence=saved_words(190.0))) == "3 min 10 s gespart!"
    verdict = _quality(1.2, True, 0.0).words
    assert paragraph(Words("{sentence}.", sentence=verdict)) == "Fast so gut wie beide Augen gerendert!"


def test_fields_may_stand_in_another_order(german):
    from stereo_reproject_extension.operators.details import price_words

    price = {"accuracy": "exact", "more_seconds": 4.0, "complete": True}
    said = paragraph(price_words(price))
    assert said.endswith(" mehr für Genau")
    assert "4.0 s" in said


def test_rows_of_figures_are_translated(german):
    from stereo_reproject_extension.operators.drawing import draw_row

    drawn = Drawn()
    draw_row(drawn, "Error (1 = only noise)", "1.020")
    assert drawn.labels == ["Fehler (1 = nur Rauschen)", "1.020"]


def test_reports_are_translated(german):
    from stereo_reproject_extension.operators.prediction import gain_words
    from stereo_reproject_extension.operators.text import reported

    assert reported(gain_words({"gain": {"low": 1.5, "high": 1.55}, "fill": {}})) == "1.6-mal so schnell"


@pytest.mark.parametrize(("count", "expected"), [(1, "Ein Stereobild"), (7, "7 Stereobilder")])
def test_one_and_many_have_messages_of_their_own(german, count, expected):
    from stereo_reproject_extension.operators.render import _words_of_animation
    from stereo_reproject_extension.operators.text import reported

    report = {"there_already": [], "files": ["shots/a.png"]}
    assert reported(_words_of_animation(report, count, 190.0, "", "")) == f"{expected}: 3 min 10 s gespart, in shots"


def test_sides_of_the_screen_are_translated(german):
    from stereo_reproject_extension.operators.depth import side_words
    from stereo_reproject_extension.operators.text import shown
    from stereo_reproject_extension.stereo_reproject.words import Words

    assert shown(side_words(-1.25)) == "1.2 % davor"
    line = Words("{end}: {side} ({pixels} px)", end=Words("Nearest"), side=side_words(0.0), pixels="3")
    assert paragraph(line) == "Nächster: auf dem Schirm, 3 Pixel"


def test_the_report_of_a_measurement_is_translated(german):
    from stereo_reproject_extension.operators.depth import parallax_line
    from stereo_reproject_extension.operators.results import KnownDepth, result_of
    from stereo_reproject_extension.operators.text import reported

    from tests.blender.toolbox import add_camera, empty_scene

    scene = empty_scene(64, 36)
    screen = add_camera(scene).data.stereo.convergence_distance
    result_of(scene).depth = KnownDepth(screen, screen, scene.frame_current)
    assert reported(parallax_line(scene)) == "von auf dem Schirm bis auf dem Schirm"


class AnimationUnderWay:
    """A run at its third frame of four, as `run_words` reads it."""

    animation = SimpleNamespace(
        frames=range(11, 15), settings=SimpleNamespace(existing="overwrite"), there_already=lambda: 0
    )
    detail, stage, savings, frames_finished, is_ending = "frame 13", "fill", (100.0, 90.0), 2, False
    stage_words = MappingProxyType({})

    def far(self):
        return 0.5, 42.0


def test_progress_is_translated(german):
    from stereo_reproject_extension.operators.run_words import (
        cancelled_and_on,
        cancelled_words,
        progress_of,
        run_progress,
        stage_and_saved,
    )
    from stereo_reproject_extension.operators.text import reported, shown

    run = AnimationUnderWay()
    assert shown(progress_of(run)[1]) == "50 %, noch 42 s (Bild 13, 3/4)"
    assert shown(stage_and_saved(run_progress(run))).endswith(", bisher 3 min 10 s gespart mit 2 Bildern")
    how = reported("To go on with the others, switch off Overwrite in Output first")
    assert reported(cancelled_and_on(cancelled_words(run), "overwrite")) == f"Abgebrochen: 2 Bilder bleiben. {how}"
    assert how.startswith("Dazu")
    run.is_ending = True
    assert shown(progress_of(run)[1]) == "Endet"


def made_scene():
    from tests.blender.toolbox import add_camera, add_cube, diffuse, empty_scene

    scene = empty_scene(64, 36)
    add_camera(scene)
    add_cube(scene, diffuse(), location=(0, 0, 5)).name = "Behind"
    return scene


def said_by(operator, **options):
    """What an operator says that fails."""
    with pytest.raises(RuntimeError) as caught:
        operator(**options)
    return str(caught.value).strip().removeprefix("Error: ")


def test_why_a_button_is_grey_is_translated(german):
    data = made_scene().camera.data
    data.type, data.panorama_type = "PANO", "MIRRORBALL"
    assert said_by(bpy.ops.stereo_reproject.measure_depth).endswith("Kugelförmig ist 'Camera'")


def test_an_error_of_an_operator_is_translated(german):
    made_scene()
    assert said_by(bpy.ops.stereo_reproject.fit_to_comfort, in_front=0.0, behind=0.0) == "Keine Tiefe"
    bpy.context.view_layer.objects.active = bpy.data.objects["Behind"]
    assert said_by(bpy.ops.stereo_reproject.set_convergence) == "Davor liegt nicht 'Behind'"


def test_an_error_of_the_core_is_translated(german):
    scene = made_scene()
    scene.view_layers[0].use = False
    assert said_by(bpy.ops.render.stereo_reproject_image) == f"Keine Ebene in {scene.name!r}"


def test_words_in_an_error_are_translated(german):
    from stereo_reproject_extension.operators.text import reported
    from stereo_reproject_extension.stereo_reproject.errors import BadInputError
    from stereo_reproject_extension.stereo_reproject.words import Words

    error = BadInputError(Words("{what} is not in front of the camera", what=Words("The focus distance")))
    assert reported(error) == "davor liegt nicht der Fokus"


def test_where_a_pair_is_kept_is_translated(german, tmp_path, monkeypatch):
    from stereo_reproject_extension.operators import jobs
    from stereo_reproject_extension.operators.text import reported

    monkeypatch.setattr(jobs, "keep_files", lambda _: tmp_path)
    assert reported(jobs._words_of_kept(None)) == f". Das Paar ist in {tmp_path}: Paar öffnen"


def test_a_warning_in_the_panel_is_translated(german):
    from stereo_reproject_extension.operators.render import _deleted
    from stereo_reproject_extension.operators.text import sentence, shown
    from stereo_reproject_extension.stereo_reproject.words import Words

    error = _deleted(SimpleNamespace(scene_name="Room"))
    warning = Words("the last frame is not shown: {reason}", reason=str(error))
    said = paragraph(Words("{sentence}.", sentence=sentence(shown(warning))))
    assert said == "Letztes Bild nicht gezeigt: die Szene 'Room' ist gelöscht!"


def test_a_wiggle_that_cannot_be_written_is_told_in_the_interface_s_language(german, tmp_path, monkeypatch):
    import errno

    from stereo_reproject_extension.operators import wiggle_export

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    told = []
    monkeypatch.setattr(wiggle_export, "pair_in", lambda _: object())
    monkeypatch.setattr(wiggle_export, "_export", full)
    path = tmp_path / "a.gif"
    operator = SimpleNamespace(
        filepath=str(path), percentage=50, seconds=0.2, report=lambda kind, text: told.append((kind, text))
    )
    wiggle_export.STEREO_REPROJECT_OT_export_wiggle.execute(operator, bpy.context)
    assert told == [({"ERROR"}, f"nicht zu schreiben: {path}, die Platte ist voll")]


def test_in_english_all_is_as_written(extension):
    from stereo_reproject_extension.operators.prediction import gain_words
    from stereo_reproject_extension.operators.text import reported

    gain = {"gain": {"low": 1.2, "high": 1.6}, "fill": {}}
    assert reported(gain_words(gain)) == "Predicted: 1.2 to 1.6 times as fast as multiview"
