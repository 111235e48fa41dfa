"""The cone of many views in the 3D View: the line on which their cameras stand, what the outermost ones see, and the
focus plane, which all show alike."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..stereo_reproject.settings.views import ViewsSettings
from ..stereo_reproject.views.cone import baseline_of, offsets_of
from .plane_drawing import Colour, Plane, draw_labels, draw_lines, draw_planes
from .views import views_obstacle
from .views_properties import views_settings_of

FOCUS_COLOUR: Colour = (0.55, 0.95, 0.45, 1.0)
SIDE_COLOUR: Colour = (0.55, 0.95, 0.45, 0.4)

FOCUS_LABEL_SHARE = 0.7
"""Place of the focus plane's name along its upper edge: beside that of the stereo screen, which may be there too."""

TICK_SHARE = 0.02
"""Length of the mark of a camera on their line, over the height of the focus plane."""

_handlers: list[object] = []


@dataclass(frozen=True)
class ConeShape:
    """Shape of the cone in the world's coordinates: the focus plane, and lines (N, 2, 3) by their two ends.

    cameras are the line on which the cameras stand, and a mark for each of them; angle goes from the outermost ones to
    the middle of the plane, and sides from them to its corners.
    """

    plane: Plane
    cameras: NDArray[np.float64]
    angle: NDArray[np.float64]
    sides: NDArray[np.float64]


def cone_of(scene: bpy.types.Scene) -> ConeShape | None:
    """Return the cone of the views that are chosen in the scene's panel, for its camera as it stands; None where there
    can be none.
    """
    if views_obstacle(scene) is not None:
        return None
    views, data = views_settings_of(scene), scene.camera.data
    focus = data.stereo.convergence_distance
    world = np.array(scene.camera.matrix_world.normalized())

    def placed(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return points @ world[:3, :3].T + world[:3, 3]

    corners = frame_at(scene, views, focus)
    offsets = np.array(offsets_of(views.count, baseline_of(views, focus)))
    stands = np.stack([offsets, np.zeros_like(offsets), np.zeros_like(offsets)], axis=-1)
    ends = stands[[0, -1]]
    tick = np.array([0.0, 0.5 * TICK_SHARE * np.ptp(corners[:, 1]), 0.0])
    marks = np.stack([stands - tick, stands + tick], axis=1)
    middle = corners.mean(axis=0)
    return ConeShape(
        Plane("Focus Plane", placed(corners), FOCUS_COLOUR, FOCUS_LABEL_SHARE),
        placed(np.concatenate([ends[None], marks])),
        placed(np.array([[end, middle] for end in ends])),
        placed(np.array([[end, corner] for end in ends for corner in corners])),
    )


def frame_at(scene: bpy.types.Scene, views: ViewsSettings, distance: float) -> NDArray[np.float64]:
    """Return the corners (4, 3) of what a view shows at a distance from the camera, in its coordinates and scene units:
    lower left, lower right, upper right, upper left. A display may be of another shape than the scene's pictures.
    """
    data = scene.camera.data
    if views.aspect is None:
        upper_right, lower_right, lower_left, upper_left = np.array(data.view_frame(scene=scene), np.float64)
        frame = np.stack([lower_left, lower_right, upper_right, upper_left])
    else:
        # Without a scene it is square, of the side that the sensor's counts for.
        upper_right, _, lower_left, _ = np.array(data.view_frame(), np.float64)
        wide = data.sensor_fit == "HORIZONTAL" or (data.sensor_fit == "AUTO" and views.aspect >= 1.0)
        shape = np.array([1.0, 1.0 / views.aspect] if wide else [views.aspect, 1.0])
        middle, half = 0.5 * (upper_right + lower_left), 0.5 * (upper_right - lower_left)
        signs = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
        frame = np.repeat(middle[None], 4, axis=0)
        frame[:, :2] += signs * shape * half[:2]
    return frame * (distance / -frame[0, 2])


def _shown_cone() -> ConeShape | None:
    """Return the cone to be drawn in the 3D View that is being drawn; None where it is switched off there."""
    context = bpy.context
    if not context.scene.stereo_reproject.views.show_cone or not context.space_data.overlay.show_overlays:
        return None
    return cone_of(context.scene)


def _draw_cone() -> None:
    """Draw the cone among the objects of a 3D View."""
    cone = _shown_cone()
    if cone is None:
        return
    draw_planes([cone.plane])
    if bpy.context.region_data.view_perspective == "CAMERA":
        # All the lines would lie in one, across the picture.
        return
    draw_lines(cone.sides, SIDE_COLOUR)
    draw_lines(cone.angle, FOCUS_COLOUR)
    draw_lines(cone.cameras, FOCUS_COLOUR)


def _draw_label() -> None:
    """Draw the focus plane's name over a 3D View."""
    cone = _shown_cone()
    if cone is not None:
        draw_labels([cone.plane])


def add_drawing() -> None:
    """Have the cone drawn in all 3D Views, where it is switched on."""
    add = bpy.types.SpaceView3D.draw_handler_add
    for draw, when in ((_draw_cone, "POST_VIEW"), (_draw_label, "POST_PIXEL")):
        _handlers.append(add(draw, (), "WINDOW", when))


def remove_drawing() -> None:
    """Undo `add_drawing`."""
    while _handlers:
        bpy.types.SpaceView3D.draw_handler_remove(_handlers.pop(), "WINDOW")
