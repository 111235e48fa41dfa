"""Multiview's own pair after a comparison: in a render slot beside ours, so that J flips between the two."""

from __future__ import annotations

from functools import partial

import bpy

from ..stereo_reproject.blender.output.delivery import deliver_to_result
from ..stereo_reproject.errors import StereoReprojectError
from ..stereo_reproject.images.exr import read_eye, read_metadata
from ..stereo_reproject.jobs.work_folder import MULTIVIEW_EYES
from ..stereo_reproject.words import Words
from .pictures import kind_of, render_result
from .results import Delivery, SlotContent, result_of
from .run import BackgroundJob
from .slots import content_now, holds, multiview_slot, note_own_render, show_slot
from .text import reported, sentence, shown
from .view_images import pair_shown_in, renew

OURS, MULTIVIEW = "OURS", "MULTIVIEW"

SIDES = [
    (OURS, "Ours", "The pair whose second eye was made from the first. J flips between render slots"),
    (MULTIVIEW, "Multiview", "Blender's own pair of the same frame, rendered by Compare. J flips between render slots"),
]


def hand_over_multiview(scene: bpy.types.Scene, run: BackgroundJob, *, frame: int | None) -> None:
    """Make multiview's eyes, if a run has written them, the content of a render slot of their own; the scene's
    compositor is run on them, and its File Output nodes write nothing. The files are removed.

    Where that is not possible, the run gets a warning: the pair itself is handed over all the same.
    """
    paths = {view: run.folder / name for view, name in MULTIVIEW_EYES.items()}
    if not all(path.exists() for path in paths.values()):
        return
    eyes = {view: read_eye(path) for view, path in paths.items()}
    metadata = read_metadata(next(iter(paths.values())))
    deliver = partial(
        deliver_to_result, scene, eyes, frame=frame, to_look_at=True, metadata=metadata, layers_then=run.layers
    )
    try:
        if render_result() is None:
            # Only a render makes one, and with it the slots.
            deliver()
            note_own_render()
        with multiview_slot():
            deliver()
    except StereoReprojectError as error:
        run.warnings.append(Words("multiview's pair is in no render slot: {reason}", reason=str(error)))
    for path in paths.values():
        path.unlink()


def sides_of(delivery: Delivery | None) -> dict[str, SlotContent]:
    """Return where ours and multiview's pair are, by `OURS` and `MULTIVIEW`; empty where they were not compared."""
    if delivery is None or delivery.content is None or delivery.multiview is None:
        return {}
    return {OURS: delivery.content, MULTIVIEW: delivery.multiview}


class STEREO_REPROJECT_OT_show_side(bpy.types.Operator):
    """Show the pair or Blender's own of the same frame"""

    bl_idname = "stereo_reproject.show_side"
    bl_label = "Compare with Multiview"

    side: bpy.props.EnumProperty(name="Side", items=SIDES)

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the button's tooltip, which is its side's."""
        return next(text for key, _, text in SIDES if key == properties.side)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene's last pair was compared with multiview, in an Image Editor."""
        cls.poll_message_set(shown("Render with Compare (under Advanced) first"))
        in_editor = context.space_data is not None and context.space_data.type == "IMAGE_EDITOR"
        return in_editor and bool(sides_of(result_of(context.scene).delivery))

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Have the side's render slot active, and show it as the editor shows pairs now; report an error where another
        render has taken the slot.
        """
        content = sides_of(result_of(context.scene).delivery)[self.side]
        if not holds(content):
            what = Words("The render slot {slot} holds another render by now", slot=repr(content.name))
            self.report({"ERROR"}, reported(what))
            return {"CANCELLED"}
        before = content_now()
        show_slot(content)
        space = context.space_data
        try:
            renew(context.scene)
        except (StereoReprojectError, OSError) as error:
            # An undo to before the first render empties the slots.
            if before is not None:
                show_slot(before)
            self.report({"ERROR"}, sentence(reported(error)))
            return {"CANCELLED"}
        result = render_result()
        if result not in (space.image, kind_of(space.image) and pair_shown_in(space)):
            space.image = result
        return {"FINISHED"}


def draw_sides(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw a button for ours and one for multiview's pair, that of the active slot pressed; nothing where the scene's
    last pair was not compared.
    """
    sides = sides_of(result_of(context.scene).delivery)
    if not sides:
        return
    row, now = layout.row(align=True), content_now()
    for side, name, _ in SIDES:
        part = row.row(align=True)
        part.enabled = holds(sides[side])
        part.operator(STEREO_REPROJECT_OT_show_side.bl_idname, text=name, depress=now == sides[side]).side = side
