"""Names of settings and figures stand beside their values where there is room, and above them where there is none."""

from types import SimpleNamespace

import bpy
import pytest


class Drawn:
    """A layout that notes what is drawn into it, and whether names stand beside; it stands for its parts too."""

    def __init__(self):
        self.items = []
        self.use_property_split = False

    def label(self, *, text, **_):
        self.items.append(("label", text))

    def prop(self, _owner, name, *, text, **_):
        self.items.append(("prop", name, text if not self.use_property_split else f"{text} beside"))

    def __getattr__(self, name):
        return lambda *_, **__: self


def context(width, scale=1.0):
    """A region of this width, with the interface at this scale."""
    system, styles = SimpleNamespace(ui_scale=scale), bpy.context.preferences.ui_styles
    preferences = SimpleNamespace(system=system, ui_styles=styles)
    return SimpleNamespace(region=SimpleNamespace(width=width), preferences=preferences)


def setting(name, where):
    from stereo_reproject_extension.operators.fitting import draw_setting

    drawn = Drawn()
    draw_setting(drawn, where, bpy.context.scene.stereo_reproject, name)
    return drawn.items


@pytest.mark.parametrize(("width", "scale"), [(400, 1.0), (600, 1.5)])
def test_a_name_with_room_stands_beside(extension, width, scale):
    assert setting("fill", context(width, scale)) == [("prop", "fill", "Hole Rendering beside")]


@pytest.mark.parametrize(("width", "scale"), [(250, 1.0), (400, 1.5), (250, 1.5)])
def test_a_name_without_room_stands_above(extension, width, scale):
    assert setting("fill", context(width, scale)) == [("label", "Hole Rendering"), ("prop", "fill", "")]


def test_a_checkbox_has_room_to_the_end_of_the_panel(extension):
    assert setting("use_scripts", context(400)) == [("prop", "use_scripts", "Run Scripts of the File beside")]
    box, *name = setting("use_scripts", context(250, 1.5))
    assert " ".join(text for _, text in name) == "Run Scripts of the File"
    assert box == ("prop", "use_scripts", "")


@pytest.mark.parametrize(("width", "scale", "in_header"), [(250, 1.0, True), (250, 1.5, True), (230, 1.5, False)])
def test_the_menu_of_presets_is_in_the_header_or_in_the_panel(extension, monkeypatch, width, scale, in_header):
    from stereo_reproject_extension.operators import panels

    popovers, headers = [], []
    drawn = Drawn()
    drawn.popover = lambda name, **texts: popovers.append((name, texts["text"]))
    where = context(width, scale)
    where.scene, where.space_data = bpy.context.scene, None
    monkeypatch.setattr(panels.STEREO_REPROJECT_PT_presets, "draw_panel_header", headers.append)
    panel = SimpleNamespace(layout=drawn, bl_label=panels._Main.bl_label)
    panels._Main.draw_header_preset(panel, where)
    panels._Main.draw(panel, where)
    assert len(headers) == in_header
    assert popovers == [("STEREO_REPROJECT_PT_presets", "Presets")] * (not in_header)


TITLE_PX, SUB_TITLE_PX = 11.0, 2.0
"""Pixels that a panel's header takes beside its title, at a scale of 1, more than a line of text does; and that of a
sub-panel, which is indented and has no grip. Seen in Blender 5.2 (tests/gui/drive_widths.py)."""


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_the_titles_of_all_panels_fit(extension, scale):
    from stereo_reproject_extension.operators.fitting import fits
    from stereo_reproject_extension.operators.image_panels import IMAGE_PANELS
    from stereo_reproject_extension.operators.panels import PANELS

    def is_whole(title, px):
        return fits(context(250, scale), title, 1.0, px)

    titles = {(cls.bl_label, bool(getattr(cls, "bl_parent_id", ""))) for cls in (*PANELS, *IMAGE_PANELS)}
    assert {is_sub for _, is_sub in titles} == {False, True}
    assert [title for title, is_sub in titles if not is_whole(title, SUB_TITLE_PX if is_sub else TITLE_PX)] == []
    assert is_whole("Stereo Reprojection", TITLE_PX) == (scale == 1.0)


def row(where, name, value, monkeypatch):
    from stereo_reproject_extension.operators import drawing

    drawn = Drawn()
    monkeypatch.setattr(drawing, "bpy", SimpleNamespace(context=where))
    drawing.draw_row(drawn, name, value)
    return drawn.items


@pytest.mark.parametrize("width", [120, 250, 400])
def test_a_row_of_figures_keeps_both(extension, width, monkeypatch):
    items = row(context(width), "Likely range", "0.95 - 1.05", monkeypatch)
    assert items == [("label", "Likely range"), ("label", "0.95 - 1.05")]


@pytest.mark.parametrize("scale", [1.0, 1.5])
@pytest.mark.parametrize("width", [250, 400])
def test_lines_of_a_paragraph_fit(extension, width, scale):
    from stereo_reproject_extension.operators import drawing, fitting

    drawn, where = Drawn(), context(width, scale)
    drawing.paragraph(drawn, where, "Will it be as good as both eyes? Mmmm: WWWW, for 12 % of it, see /tmp/il/" * 3)
    assert len(drawn.items) > 2
    widths = [fitting.text_width(where, text) for _, text in drawn.items]
    assert max(widths) <= fitting.room_for_text(where)
    assert max(widths) > 0.7 * fitting.room_for_text(where), "the room is used"
