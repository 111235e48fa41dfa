"""Look at the pair from a panel elsewhere than in an Image Editor: in the editor that shows it, or in a new one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ..stereo_reproject.errors import BadInputError
from ..stereo_reproject.words import Words
from .jobs import running
from .pictures import bring_forward, find_editor, image_editors
from .redraw import redraw_panels
from .slots import content_now
from .text import reported, shown
from .view_modes import MODES, NO_PAIR, WIGGLE, mode_in, pair_in

IS_RUNNING = "A stereo job is running: its pictures are shown in the Image Editor"


class STEREO_REPROJECT_OT_look(bpy.types.Operator):
    """Look at the stereo pair in the Image Editor that shows it; where none does, one opens"""

    bl_idname = "stereo_reproject.look"
    bl_label = "Look at Stereo Pair"

    mode: bpy.props.EnumProperty(name="Mode", items=[(mode, *texts) for mode, texts in MODES.items()])

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the button's tooltip, which is its mode's."""
        return MODES[properties.mode][1]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether there is a pair and no job that is about to replace it: beside a job's thread no operator may
        run under another context, see `zoom_to_fit` in `pictures`.
        """
        cls.poll_message_set(shown(NO_PAIR if running() is None else IS_RUNNING))
        return running() is None and context.window is not None and pair_in(context) is not None

    def execute(self, _context: bpy.types.Context) -> set[str]:
        """Show the pair in this mode; report an error where no Image Editor can be had."""
        try:
            with pair_editor():
                if self.mode == WIGGLE:
                    bpy.ops.stereo_reproject.wiggle("INVOKE_DEFAULT")
                else:
                    bpy.ops.stereo_reproject.show_view(mode=self.mode)
        except (BadInputError, RuntimeError) as error:
            # What the operator of the editor reports comes as an error of Python's.
            self.report({"ERROR"}, reported(str(error).removeprefix("Error: ").strip()))
            return {"CANCELLED"}
        return {"FINISHED"}


@contextmanager
def pair_editor() -> Iterator[None]:
    """Have the Image Editor that shows the pair be that of the context, for the time of a `with` block; where none
    does, one opens, and a window of its own comes forward. Raises BadInputError where none can be had.
    """
    found = _window_and_editor()
    if found is None:
        bpy.ops.render.view_show("INVOKE_DEFAULT")
        found = _window_and_editor()
    else:
        bring_forward(found[0])
    if found is None:
        raise BadInputError(Words("No Image Editor could be opened: turn an editor into one"))
    window, area = found
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
        yield


def _window_and_editor() -> tuple[bpy.types.Window, bpy.types.Area] | None:
    """Return the Image Editor that shows the pair, with its window; None where there is none."""
    area = find_editor()
    return next(((window, other) for window, other in image_editors() if other == area), None)


def mode_elsewhere() -> str | None:
    """Return the mode in which an Image Editor shows the pair, a key of `MODES`; None if in none."""
    found = _window_and_editor()
    return None if found is None else mode_in(found[0], found[1].spaces.active)


_drawn: list[object] = []
"""The way in which the pair was looked at, and the content of its slot, when an Image Editor was drawn last."""

_handlers: list[object] = []


def _note_drawn() -> None:
    """Have all panels drawn anew where the pair is looked at in another way than before, or another slot is: Blender
    draws those of other editors anew for neither. Blender calls this after it has drawn an Image Editor.
    """
    now = mode_elsewhere(), content_now()
    if _drawn != [now]:
        _drawn[:] = [now]
        # Within a drawing nothing can be asked to be drawn.
        bpy.app.timers.register(redraw_panels, first_interval=0.0)


def watch() -> None:
    """Begin to look after the panels of other editors. Called when the extension is switched on."""
    add = bpy.types.SpaceImageEditor.draw_handler_add
    _handlers.append(add(_note_drawn, (), "WINDOW", "POST_PIXEL"))


def unwatch() -> None:
    """Undo `watch`. Called when the extension is switched off."""
    while _handlers:
        bpy.types.SpaceImageEditor.draw_handler_remove(_handlers.pop(), "WINDOW")
    _drawn.clear()
