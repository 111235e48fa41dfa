"""Headings of figures have tooltips that explain these."""

from types import SimpleNamespace

import bpy
import pytest


def test_every_heading_has_a_tooltip(extension):
    from stereo_reproject_extension.operators.explained import EXPLANATIONS, STEREO_REPROJECT_OT_explain

    for heading, lines in EXPLANATIONS.items():
        told = STEREO_REPROJECT_OT_explain.description(bpy.context, SimpleNamespace(heading=heading))
        assert told == "\n".join(lines)
        assert not told.endswith("."), "Blender adds a full stop"
        assert bpy.ops.stereo_reproject.explain(heading=heading) == {"FINISHED"}


def test_every_reason_for_which_pixels_are_rendered_again_is_explained(extension):
    from stereo_reproject_extension.operators.explained import EXPLANATIONS, TRACED
    from stereo_reproject_extension.stereo_reproject.images.reasons import Reason

    for reason in Reason:
        (line,) = (line for line in EXPLANATIONS[TRACED] if line.startswith(f"{reason.words}: "))
        assert "{" not in line


@pytest.mark.parametrize(("width", "scale", "rows"), [(250, 1.0, 2), (250, 1.5, 1), (400, 1.5, 2)])
def test_a_heading_bears_its_own_explanation(extension, monkeypatch, width, scale, rows):
    from stereo_reproject_extension.operators import explained
    from stereo_reproject_extension.operators.explained import ESTIMATED, draw_heading

    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=scale), ui_styles=bpy.context.preferences.ui_styles)
    where = SimpleNamespace(region=SimpleNamespace(width=width), preferences=preferences)
    monkeypatch.setattr(explained, "bpy", SimpleNamespace(context=where))

    class Drawn:
        rows = 0

        def label(self, *, text):
            self.text = text

        def row(self):
            self.rows += 1
            return self

        def operator(self, *_, **__):
            self.button = SimpleNamespace()
            return self.button

    drawn = Drawn()
    draw_heading(drawn, ESTIMATED)
    assert (drawn.text, drawn.button.heading) == (ESTIMATED, ESTIMATED)
    assert drawn.rows == rows, "the mark has a line of its own where the heading needs the whole"
