"""Requests for pixels of several views, answered by one packed render where that is exact."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import BadInputError
from ...images.passes import Passes
from ...settings.frame import EYES
from ...trace.requests import TraceRequest
from ...views.camera import Camera
from ...words import Words
from ..scene.effects import is_animated, may_read_camera, shader_nodes, uses_output
from ..scene.motion import vector_pass_asked_for, while_open
from ..scene.working import evaluated, rendered_layer
from .packed_camera import PackedCamera
from .packed_trace import trace_packed
from .packed_views import PackedPixels, may_begin_in, surely_inside
from .render import Rendered

CAMERA_OUTPUTS = (
    ("ShaderNodeCameraData", "View Vector"),
    ("ShaderNodeCameraData", "View Z Depth"),
    ("ShaderNodeCameraData", "View Distance"),
    ("ShaderNodeTexCoord", "Camera"),
)
"""Nodes that tell a shader where Cycles' camera is, and by which outputs."""

MAX_TURN_RADIANS = 2e-3
"""Turn of the camera while the shutter is open up to which views keep their places to each other: Cycles moves each
camera along straight lines, which are off the arcs by less than 1e-6 of the distance between views."""


def trace_together(
    scene: bpy.types.Scene,
    cameras: Mapping[str, Camera],
    volumes: Sequence[NDArray[np.float64]],
    requests: Sequence[TraceRequest],
    folder: Path,
    next_seed: Callable[[], int],
    by: PackedCamera,
) -> tuple[list[Rendered], list[Passes]]:
    """Trace all requests packed, in as few renders as is exact. Return the renders, and each request's passes (N, C),
    in the order of the requests.

    cameras has those of the requests' views by name, both eyes included. volumes has, for each volume of the scene, the
    corners (8, 3) of a box around it. next_seed returns a new seed for each render. by is the packed camera. Raises
    BadInputError for a view that is no eye where its pixels could not be right.
    """
    renders: list[Rendered] = []
    answers: dict[int, Passes] = {}
    for view, numbers in _renders(scene, cameras, volumes, [request.view for request in requests]):
        packed = [_pixels_of(requests[number], cameras) for number in numbers]
        rendered, traced = trace_packed(scene, view, cameras[view], packed, folder, seed=next_seed(), by=by)
        renders.append(rendered)
        answers.update(zip(numbers, traced, strict=True))
    return renders, [answers[number] for number in range(len(requests))]


def _pixels_of(request: TraceRequest, cameras: Mapping[str, Camera]) -> PackedPixels:
    """Return the camera and the pixels that a request asks for, those of its second mask after those of the first."""
    return PackedPixels(cameras[request.view], np.concatenate([np.argwhere(mask) for mask in request.masks]))


def _renders(
    scene: bpy.types.Scene,
    cameras: Mapping[str, Camera],
    volumes: Sequence[NDArray[np.float64]],
    asked: Sequence[str],
) -> list[tuple[str, list[int]]]:
    """Return the renders that it takes for requests of these views, in their order: for each render the view that
    Blender renders, and the numbers of the requests that are traced in it.
    """
    rendered = next((view for view in asked if view in EYES), EYES[0])
    if not asked or set(asked) == {rendered}:
        return [(rendered, list(range(len(asked))))] if asked else []
    reason = why_apart(scene, cameras[rendered], [cameras[view] for view in asked], volumes)
    elsewhere = [view for view in asked if view not in EYES]
    if reason and elsewhere:
        raise BadInputError(Words("view {view} cannot be traced: {reason}", view=repr(elsewhere[0]), reason=reason))
    if not reason and not turns_in_shutter(scene):
        return [(rendered, list(range(len(asked))))]
    by_view: dict[str, list[int]] = {}
    for number, view in enumerate(asked):
        # Views that Blender does not have move with the one that it renders, as parts of a rigid rig.
        by_view.setdefault(view if view in EYES else rendered, []).append(number)
    return list(by_view.items())


def why_apart(
    scene: bpy.types.Scene, rendered: Camera, views: Sequence[Camera], volumes: Sequence[NDArray[np.float64]]
) -> str | None:
    """Return why pixels of these views cannot be traced in a render of the camera `rendered`, in words; None if they
    can.

    The rays themselves do not depend on Cycles' camera, but some of what Cycles makes of them does. volumes are as for
    `trace_together`.
    """
    layer = rendered_layer(scene).cycles
    follows = getattr(layer, "denoising_pass_follow_reflections", True)
    checks = {
        "the Vector pass is that of Cycles' own camera": vector_pass_asked_for(scene),
        "the Mist pass is that of Cycles' own camera": rendered_layer(scene).use_pass_mist,
        # Else that pass is of the rays' lengths.
        "the Denoising Depth pass is that of Cycles' own camera": layer.denoising_store_passes and not follows,
        "a shader reads where the camera is": any(uses_output(*output) for output in CAMERA_OUTPUTS)
        or any(map(may_read_camera, shader_nodes())),
        # Of its own camera alone Cycles asks whether its rays begin in a volume.
        "a view may begin in a volume": not surely_inside(rendered, volumes) and may_begin_in(scene, volumes, views),
    }
    return next((reason for reason, holds in checks.items() if holds), None)


def turns_in_shutter(scene: bpy.types.Scene) -> bool:
    """Return whether the camera turns while the shutter is open.

    Cycles moves each view's camera along a straight line and turns it besides, so only views that do not turn keep
    their places to each other. The scene is set to the times in question, and then to its own frame again.
    """
    if not scene.render.use_motion_blur or not _may_turn(scene.camera):
        return False
    shares = (0.0, 0.25, 0.5, 0.75, 1.0)
    turns = while_open(scene, shares, lambda: evaluated(scene.camera, scene).matrix_world.to_quaternion())  # noqa: PLW0108 - anew each time
    return any(turns[0].rotation_difference(turn).angle > MAX_TURN_RADIANS for turn in turns)


def _may_turn(item: bpy.types.Object | None) -> bool:
    """Return whether the object, or one that it hangs on, could turn with time; None cannot."""
    while item is not None:
        if is_animated(item) or item.constraints or item.rigid_body or item.parent_type not in ("OBJECT", ""):
            return True
        item = item.parent
    return False
