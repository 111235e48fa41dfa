"""The cameras of many views: side by side before the scene's camera, or where the scene has them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import bpy

from ...pipeline.views_maker import FinishedView, PlanStep
from ...report.views_report import plan_lines
from ...settings.frame import SceneOverrides
from ...settings.views import ViewsSettings, view_names
from ...views.camera import Camera
from ...views.camera_order import line_order, order_of
from ...views.cone import baseline_of, cone_degrees, offsets_of
from ...words import Words
from ..engines.scene_views_renderer import (
    SceneViewsRenderer,
    camera_of,
    copies_of_cameras,
    looking_through,
    own_view,
)
from ..engines.views_renderer import ManyViewsRenderer, ViewsRenderer, check_views, set_up_middle, standing_beside
from ..scene.cone_room import cone_warnings
from ..scene.rendered import camera_at, engine_of
from ..scene.rig import check_camera
from ..scene.view_cameras import cameras_of_views, file_name_of
from ..scene.working import evaluated

Standing = Callable[[str], AbstractContextManager[str]]
"""Has a working scene stand as the view of this name for the time of a `with` block; gives the eye that shows it."""


class MakeRenderer(Protocol):
    """Protocol of a function that has a renderer of many views for the time of a `with` block; its parameters are those
    of `BlenderRenderer`."""

    def __call__(
        self, working: bpy.types.Scene, folder: Path, *, user_scene: bpy.types.Scene, packed_by: str
    ) -> AbstractContextManager[ManyViewsRenderer]:
        """Have the renderer of a working scene."""
        ...


@dataclass(frozen=True)
class ViewRig:
    """The cameras of many views.

    names are the views' names, in the order in which they are delivered. made has them in their order on the way from
    one end to the other, in which they are made, and shown one after the other. is_line tells whether that way is a
    line, which goes from the leftmost camera to the rightmost. facts are the fields of the report that tell where the
    cameras stand; cameras are the names of the scene's own by view. standing has a working scene set up to render each
    view plainly, for the time of a `with` block.
    """

    names: tuple[str, ...]
    made: tuple[str, ...]
    is_line: bool
    renderer: MakeRenderer
    standing: Callable[[bpy.types.Scene], AbstractContextManager[Standing]]
    facts: Mapping[str, Any] = field(default_factory=dict)
    cameras: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def file_names(self) -> tuple[str, ...]:
        """The names of the views' files, without their extension, in the order of the views."""
        return tuple(map(file_name_of, self.names))

    @property
    def files(self) -> dict[str, str]:
        """The names of the views' files, without their extension, by view."""
        return dict(zip(self.names, self.file_names, strict=True))

    @property
    def asked(self) -> tuple[str, ...]:
        """The names by which the renderer knows the views, in the order in which they are made: those of the scene may
        be those of Blender's eyes."""
        asked = asked_names(self.names)
        return tuple(asked[name] for name in self.made)

    @property
    def in_quilt(self) -> tuple[str, ...]:
        """The names of the views' files, without their extension, in the order of their places in a quilt: cameras on a
        line from the leftmost to the rightmost, others in the order of the views."""
        files = self.files
        return tuple(files[name] for name in (self.made if self.is_line else self.names))

    def named(self, view: FinishedView) -> FinishedView:
        """Return a finished view with the names that it and its sources have for users."""
        known = dict(zip(self.asked, self.made, strict=True))
        shown = {known[name]: share for name, share in view.shown_from.items()}
        sources = tuple(known[name] for name in view.sources)
        return replace(view, name=known[view.name], sources=sources, shown_from=shown)

    def named_cameras(self, cameras: Mapping[str, Camera]) -> dict[str, Camera]:
        """Return a renderer's cameras by the names that the views have for users."""
        return {made: cameras[asked] for asked, made in zip(self.asked, self.made, strict=True)}

    def plan(self, steps: Iterable[PlanStep]) -> tuple[str, ...]:
        """Return a line for each step of the plan, with the names that the views have for users."""
        known = dict(zip(self.asked, self.made, strict=True))
        return plan_lines([replace(step, views=tuple(known[name] for name in step.views)) for step in steps])


def count_of_views(scene: bpy.types.Scene, views: ViewsSettings, frame: int | None) -> int:
    """Return the number of views that are asked for of a user's scene at a frame, None for the present one. Raises
    BadInputError where the scene's own are asked for, and cannot be found."""
    if not views.from_scene:
        return views.count
    return len(cameras_of_views(scene, scene.frame_current if frame is None else frame))


def asked_names(names: Iterable[str]) -> dict[str, str]:
    """Return the names by which a renderer knows views, by the names that they have for users."""
    names = list(names)
    return dict(zip(names, view_names(len(names)), strict=True))


def files_of_views(
    scene: bpy.types.Scene, overrides: SceneOverrides, views: ViewsSettings, frames: Iterable[int]
) -> dict[str, str]:
    """Return the names of the views' files, without their extension, by view, for these frames of a user's scene, each
    of which is looked at. Raises BadInputError where the views cannot be rendered in one of them."""
    engine = engine_of(scene, overrides)
    # Where no marker switches cameras, all frames have one.
    frame_by_camera = {camera and camera.session_uid: frame for frame in frames for camera in [camera_at(scene, frame)]}
    names: tuple[str, ...] = views.names
    for frame in frame_by_camera.values():
        if views.from_scene:
            cameras = cameras_of_views(scene, frame)
            names = tuple(cameras)
            views.check_places(len(names))
        else:
            cameras = {"": check_camera(camera_at(scene, frame))}
        for camera in cameras.values():
            check_views(camera, engine)
    return {name: file_name_of(name) for name in names}


Copies = Mapping[str, str]
"""Names of the cameras in a working scene for a scene's own views, by the names by which the renderer knows these."""


@contextmanager
def cameras_in(scene: bpy.types.Scene, working: bpy.types.Scene, views: ViewsSettings) -> Iterator[Copies]:
    """Have the cameras of a user's scene for its own views in a working scene, for the time of a `with` block; no
    others than the scene's camera where other views are asked for. They may stay from frame to frame. Raises
    BadInputError."""
    if not views.from_scene:
        yield {}
        return
    cameras = cameras_of_views(scene, working.frame_current)
    asked = asked_names(cameras)
    with copies_of_cameras(working, {asked[name]: camera for name, camera in cameras.items()}) as copies:
        yield copies


def rig_of(scene: bpy.types.Scene, working: bpy.types.Scene, views: ViewsSettings, copies: Copies) -> ViewRig:
    """Return the cameras of the views that are asked for, as they stand in the present frame; working is a working
    scene of the user's scene, and copies are those of `cameras_in`. Raises BadInputError."""
    if views.from_scene:
        return _scene_rig(scene, working, views, copies)
    cone = cone_of(working, views)
    names = view_names(cone.count)
    degrees = cone_degrees(cone.baseline, cone.focus_distance)
    facts = {"cone_degrees": degrees, "baseline": cone.baseline, "focus_distance": cone.focus_distance}
    warnings = cone_warnings(working, cone.offsets, cone.focus_distance)
    return ViewRig(
        names, names, True, partial(_cone_renderer, cone), partial(_beside, cone), facts, warnings=tuple(warnings)
    )


@dataclass(frozen=True)
class Cone:
    """The places of many views: the distance of the plane that all show alike, and that between the outermost cameras,
    in scene units."""

    focus_distance: float
    baseline: float
    count: int

    @property
    def offsets(self) -> list[float]:
        """Places of the cameras beside the scene's camera, in scene units, from the leftmost on."""
        return offsets_of(self.count, self.baseline)


def cone_of(working: bpy.types.Scene, views: ViewsSettings) -> Cone:
    """Return the places of the views that are asked for, before the camera of a working scene."""
    stereo = evaluated(working.camera, working).data.stereo
    focus = stereo.convergence_distance if views.focus_distance is None else views.focus_distance
    return Cone(focus, baseline_of(views, focus), views.count)


@contextmanager
def _cone_renderer(
    cone: Cone, working: bpy.types.Scene, folder: Path, *, user_scene: bpy.types.Scene, packed_by: str
) -> Iterator[ManyViewsRenderer]:
    """Have a renderer of views side by side, as `MakeRenderer` says."""
    yield ViewsRenderer(working, folder, cone.offsets, cone.focus_distance, user_scene=user_scene, packed_by=packed_by)


@contextmanager
def _beside(cone: Cone, working: bpy.types.Scene) -> Iterator[Standing]:
    """Have a working scene set up to render views side by side, as `ViewRig` says of `standing`."""
    set_up_middle(working, cone.focus_distance)
    offsets = dict(zip(view_names(cone.count), cone.offsets, strict=True))
    yield lambda name: standing_beside(working, offsets[name])


Cameras = Mapping[str, bpy.types.Object]
"""Cameras of a user's scene by view name."""


def _scene_rig(scene: bpy.types.Scene, working: bpy.types.Scene, views: ViewsSettings, copies: Copies) -> ViewRig:
    """Return the cameras of a user's scene for its own views."""
    cameras = cameras_of_views(scene, working.frame_current)
    names, asked = tuple(cameras), asked_names(cameras)
    seen = [camera_of(working, copies[asked[name]]) for name in names]
    line = line_order(seen)
    made = tuple(names[number] for number in line or order_of(seen))
    warnings = []
    if line is None and views.columns is not None:
        warnings.append(
            Words(
                "the cameras do not stand on a line across one direction that all look in: a display cannot show such"
                " a quilt"
            )
        )
    places = (views.columns or 0) * (views.rows or 0)
    if places > len(names):
        message = "the scene has {count} views: of the {places} places of the quilt, {empty} stay black"
        warnings.append(Words(message, count=len(names), places=places, empty=places - len(names)))
    return ViewRig(
        names,
        made,
        line is not None,
        partial(_scene_renderer, {asked[name]: copies[asked[name]] for name in made}),
        partial(_own_views, cameras),
        cameras={name: camera.name for name, camera in cameras.items()},
        warnings=tuple(warnings),
    )


@contextmanager
def _scene_renderer(
    cameras: Copies, working: bpy.types.Scene, folder: Path, *, user_scene: bpy.types.Scene, packed_by: str
) -> Iterator[ManyViewsRenderer]:
    """Have a renderer of a scene's own views, as `MakeRenderer` says. Their cameras are in the order in which they are
    made."""
    with looking_through(working, next(iter(cameras.values()))):
        yield SceneViewsRenderer(working, folder, cameras, user_scene=user_scene, packed_by=packed_by)


@contextmanager
def _own_views(cameras: Cameras, working: bpy.types.Scene) -> Iterator[Standing]:
    """Have a working scene set up to render its own views, as `ViewRig` says of `standing`."""
    asked = asked_names(cameras)
    with (
        copies_of_cameras(working, {asked[name]: camera for name, camera in cameras.items()}) as copies,
        looking_through(working, next(iter(copies.values()))),
    ):
        yield lambda name: own_view(working, asked[name])
