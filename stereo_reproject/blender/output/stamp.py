"""The render time in a picture's metadata and in its stamp: the pair's, not that of the call that hands it over."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import bpy

from ..scene.working import changed

RENDER_TIME = "RenderTime"
"""Name of the render time among a picture's metadata, and before it in the stamp, as Blender has it."""

NOTE = "Note"


def with_render_time(metadata: Mapping[str, str], seconds: float | None) -> dict[str, str]:
    """Return the metadata together with the seconds that a picture took, in the form of Blender's render time; without
    them where they are not known.
    """
    return dict(metadata) if seconds is None else {**metadata, RENDER_TIME: timecode(seconds)}


def timecode(seconds: float) -> str:
    """Return seconds as Blender writes a render time: "03:25.07", with hours where there are any."""
    hundredths = round(100.0 * seconds)
    minutes, rest = divmod(hundredths, 6000)
    hours, minutes = divmod(minutes, 60)
    text = f"{minutes:02d}:{rest // 100:02d}.{rest % 100:02d}"
    return f"{hours:02d}:{text}" if hours else text


@contextmanager
def stamped(render: bpy.types.RenderSettings, metadata: Mapping[str, str]) -> Iterator[dict[str, str]]:
    """Have Blender stamp a delivered picture with the render time that `metadata` has, where the scene's settings ask
    for one, for the time of a `with` block. Yield the metadata that the picture is to have.

    Blender itself would take the seconds and the memory of the call that hands the picture over.
    """
    time = metadata.get(RENDER_TIME)
    if time is None:
        yield dict(metadata)
        return
    if not render.use_stamp_render_time:
        with changed(render, use_stamp_memory=False):
            yield {key: text for key, text in metadata.items() if key != RENDER_TIME}
        return
    note = render.stamp_note_text if render.use_stamp_note else ""
    line = f"{RENDER_TIME} {time}" if render.use_stamp_labels else time
    values: dict[str, Any] = {"use_stamp_render_time": False, "use_stamp_memory": False}
    if render.use_stamp:
        # A stamp's own lines cannot be set; its note can have several, and stands where the render time does.
        values |= {"use_stamp_note": True, "stamp_note_text": f"{line}\n{note}" if note else line}
    with changed(render, **values):
        yield {**metadata, **({NOTE: note} if note else {})}
