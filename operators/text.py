"""Texts for users, in the language that they have chosen for Blender's interface.

Blender translates by itself what stands in properties, and labels that are drawn as they are. Texts with figures or
names in them are `Words`, whose message is looked up before these are put in. So an error is looked up before it is
made a sentence.
"""

from __future__ import annotations

from bpy.app.translations import pgettext_iface, pgettext_rpt

from ..stereo_reproject.words import in_language


def shown(text: str | Exception) -> str:
    """Return a text or an error for a panel in the interface's language."""
    return in_language(str(text), pgettext_iface)


def reported(text: str | Exception) -> str:
    """Return a text or an error for a report in the language of Blender's reports."""
    return in_language(str(text), pgettext_rpt)


def sentence(text: str) -> str:
    """Return a text as one line that begins with a capital letter."""
    line = " ".join(text.split())
    return line[:1].upper() + line[1:]
