"""Texts for users, in the language that they have chosen for Blender's interface.

Blender translates by itself what stands in properties, and labels that are drawn as they are. Texts with figures or
names in them are `Words`, whose message is looked up before these are put in.
"""

from __future__ import annotations

from bpy.app.translations import pgettext_iface, pgettext_rpt

from ..stereo_reproject.report.words import in_language


def shown(text: str) -> str:
    """Return a text for a panel in the interface's language."""
    return in_language(text, pgettext_iface)


def reported(text: str) -> str:
    """Return a text for a report in the language of Blender's reports."""
    return in_language(text, pgettext_rpt)
