"""The cameras of a scene's own views: those that Blender renders with Multi-View, a camera for each view.

Blender finds a view's camera by its name: that of the scene's camera, with the view's suffix in place of the one that
it ends with. Source: Blender, `BKE_camera_multiview_render`.
"""

from __future__ import annotations

import re

import bpy

from ...errors import BadInputError
from ...settings.views import MAX_COUNT, MIN_COUNT
from ...words import Words
from .rendered import camera_at
from .rig import check_camera

NOT_IN_FILE_NAMES = re.compile(r'[<>:"/\\|?*\x00-\x1f]|[. ]+$|^[. ]+')
"""Characters that a system does not take in the name of a file, or not at its ends."""


def cameras_of_views(scene: bpy.types.Scene, frame: int) -> dict[str, bpy.types.Object]:
    """Return the cameras of the views that a user's scene renders at a frame, by the names of the views, in the scene's
    order. Raises BadInputError where the scene has no Multi-View, a view has no camera of its own, or there are too few
    or too many views."""
    render = scene.render
    if not render.use_multiview or render.views_format != "MULTIVIEW":
        raise BadInputError(
            "the scene has no views of its own: switch on Output > Stereoscopy > Multi-View, and add a view for each"
            " camera"
        )
    views = [view for view in render.views if view.use]
    if not MIN_COUNT <= len(views) <= MAX_COUNT:
        raise BadInputError(
            Words(
                "the scene has {count} views that are switched on: there must be {least} to {most}",
                count=len(views),
                least=MIN_COUNT,
                most=MAX_COUNT,
            )
        )
    _check_file_names([view.name for view in views])
    stem = _stem_of(check_camera(camera_at(scene, frame)), render)
    return {view.name: _camera_called(scene, f"{stem}{view.camera_suffix}", view.name) for view in views}


def _stem_of(camera: bpy.types.Object, render: bpy.types.RenderSettings) -> str:
    """Return the name that the cameras of all views begin with: the camera's own, without the longest suffix of a view
    that it ends with. Raises BadInputError where it ends with none."""
    found = [view.camera_suffix for view in render.views if camera.name.endswith(view.camera_suffix)]
    if not found:
        suffixes = ", ".join(view.camera_suffix for view in render.views)
        raise BadInputError(
            Words(
                "the name of the scene's camera {camera} ends with no view's suffix ({suffixes}), by which Blender"
                " finds the cameras of the others: rename it",
                camera=repr(camera.name),
                suffixes=suffixes,
            )
        )
    return camera.name.removesuffix(max(found, key=len))


def _camera_called(scene: bpy.types.Scene, name: str, view: str) -> bpy.types.Object:
    """Return the camera of this name in the scene, which is that of a view. Raises BadInputError without it."""
    camera = scene.objects.get(name)
    if camera is None:
        raise BadInputError(
            Words(
                "view {view} has no camera: the scene needs one called {name}, or switch the view off",
                view=repr(view),
                name=repr(name),
            )
        )
    return check_camera(camera)


def file_name_of(view: str) -> str:
    """Return the name that the files of a view have, without an extension: its own, with _ for what no system takes."""
    return NOT_IN_FILE_NAMES.sub("_", view)


def _check_file_names(views: list[str]) -> None:
    """Raise BadInputError where two views would have one file."""
    seen: dict[str, str] = {}
    for view in views:
        # On many drives large and small letters are the same.
        other = seen.setdefault(file_name_of(view).casefold(), view)
        if other != view:
            raise BadInputError(
                Words(
                    "the views {one} and {other} would have one file: rename one of them",
                    one=repr(other),
                    other=repr(view),
                )
            )
