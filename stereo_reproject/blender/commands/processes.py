"""Commands that start another process of this Blender."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy

from ...errors import BadInputError
from ...jobs.worker_process import PACKAGE
from ...words import Words
from ..scene.user_folder import USER_FOLDER_VARIABLE, user_folder

SAMPLES_LOGGED_BY_DEFAULT_BEFORE = (5, 0, 0)
"""Version of Blender from which the log has the samples of a render only where it is asked for them."""

UNSAVED = "Unsaved.blend"
"""Name that Blender's path templates give to a file that was never saved."""


def module_in_blender(name: str) -> Sequence[str] | None:
    """Return the command that runs a module of this package in this very Blender, without a window and without add-ons.

    None where Blender is a Python module: then `worker_process.module_command` has the command."""
    if not bpy.app.binary_path:
        return None
    options = ["--background", "--factory-startup"]
    if bpy.app.version >= SAMPLES_LOGGED_BY_DEFAULT_BEFORE:
        options += ["--log", "render", "--log-level", "info"]
    options += ["--python-use-system-env"]  # it names the folders of this package and of its libraries
    return [bpy.app.binary_path, *options, "--python-expr", program_of(name)]


def program_of(name: str) -> str:
    """Return the Python program, in one line, that runs a module of this package in another Blender.

    There the package is no extension, and would not find the extension's folder of the user: so it is given that.
    """
    folder = user_folder()
    given = f"import os; os.environ[{USER_FOLDER_VARIABLE!r}] = {'' if folder is None else str(folder)!r}"
    return f"{given}; from {PACKAGE}.{name} import main; main()"


def save_copy(folder: Path) -> Path:
    """Save the open file, unsaved changes included, into a folder, and return the copy's path.

    Files that it refers to are found from there too. The copy has the file's own name, which Blender's path templates
    know. Raises BadInputError if it cannot be saved.
    """
    blend = folder / (Path(bpy.data.filepath).name or UNSAVED)
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True, relative_remap=True, compress=False)
    except RuntimeError as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise BadInputError(
            Words(
                "no copy of the file can be saved in {folder} ({reason}): free some space there, or set another folder"
                " for temporary files in the preferences",
                folder=folder,
                reason=reason,
            )
        ) from error
    return blend
