"""The folder in which this user's own files are kept from one session to the next."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path

import bpy

USER_FOLDER_VARIABLE = "STEREO_REPROJECT_USER_FOLDER"
"""Environment variable that names the folder in place of the usual one. Empty: nothing is kept, and nothing read."""

EXTENSIONS_PACKAGE = "bl_ext"
"""Package below which Blender has all extensions."""

COSTS_FOLDER_PREFERENCE = "costs_folder"
"""Name of the extension's preference for the folder."""

FOLDER_NAME = "stereo_reproject"


def user_folder() -> Path | None:
    """Return the folder of this user's own files, which may not exist yet; None where nothing is to be kept.

    It is the one that the environment names, else the one that the extension's preferences name, else that which
    Blender has for the extension. Without the extension it is one in the user's folder of caches, as the platform has
    it.
    """
    named = os.environ.get(USER_FOLDER_VARIABLE)
    if named is not None:
        return Path(named).absolute() if named else None
    package = __name__.split(".")[:3]
    if package[0] == EXTENSIONS_PACKAGE:
        return _folder_of_extension(".".join(package))
    caches = _cache_folder()
    return None if caches is None else caches / FOLDER_NAME


def _folder_of_extension(package: str) -> Path | None:
    """Return the folder that the preferences of the extension name, or else the one that Blender has for it; None where
    Blender has none.
    """
    addon = bpy.context.preferences.addons.get(package)
    path = getattr(addon and addon.preferences, COSTS_FOLDER_PREFERENCE, "") or bpy.utils.extension_path_user(package)
    return Path(bpy.path.abspath(path)) if path else None


def _cache_folder() -> Path | None:
    """Return the user's folder of caches, as the platform has it; None for a user without a home."""
    named = os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME", "")
    if sys.platform != "darwin" and Path(named).is_absolute():
        return Path(named)
    with suppress(RuntimeError):
        beneath = {"win32": "AppData/Local", "darwin": "Library/Caches"}.get(sys.platform, ".cache")
        return Path.home() / beneath
    return None
