"""The renderer of views side by side: each is an eye of the scene's camera, at an interocular distance of its own.

So Blender itself places the camera and shifts its lens, in whole renders as in traces, and moves it while a shutter is
open.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path

import bpy

from ...errors import BadInputError
from ...images.passes import Passes
from ...settings.views import view_names
from ...trace.requests import TraceRequest
from ...views.camera import PerspectiveCamera
from ...views.cone import beside
from ...words import Words
from ..scene.animated import animated_values
from ..scene.rendered import CYCLES
from ..scene.rig import MODES, convergence_of_screen, stereo_cameras
from ..scene.working import changed, evaluated, rendered_layer
from .render import Rendered
from .renderer import BlenderRenderer, shifted_seed
from .shared_render import trace_together, turns_in_shutter, why_apart

VIEW_SEED_STEP = 15_485_863
"""Added to the scene's seed from view to view, so that no noise is common to all views."""

STEREO_SETTINGS = ("interocular_distance", "convergence_distance", "convergence_mode", "pivot", "use_spherical_stereo")
"""Properties of a camera's stereo settings that views are placed by."""

ONE_VIEW_AT_A_TIME = "it renders one view at a time"


class ManyViewsRenderer(BlenderRenderer, ABC):
    """Renderer of a working scene for many views, each of which it can render by Blender's own camera.

    views are the cameras by view name. The other parameters are those of `BlenderRenderer`. Raises BadInputError for an
    engine or a camera that cannot do it.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        folder: Path,
        views: Mapping[str, PerspectiveCamera],
        *,
        user_scene: bpy.types.Scene | None = None,
        packed_by: str = "auto",
    ) -> None:
        super().__init__(scene, folder, user_scene=user_scene, views=views, packed_by=packed_by)
        self.motion = None
        self.own_seeds = {name: shifted_seed(self.seed, VIEW_SEED_STEP * number) for number, name in enumerate(views)}

    @abstractmethod
    def standing_at(self, view: str) -> AbstractContextManager[str]:
        """Have the scene's camera stand as the view of this name for the time of a `with` block; gives the name of the
        eye that shows it."""

    def traced_at(self, view: str) -> AbstractContextManager[str]:
        """Have the scene's camera stand as this view to trace its pixels packed, as `standing_at` does."""
        return self.standing_at(view)

    def fill_blockers(self, deepest: float = 0.0) -> dict[str, str | None]:
        """Return what `BlenderRenderer.fill_blockers` does; a card is no way for many views."""
        return {**super().fill_blockers(deepest), "card": ONE_VIEW_AT_A_TIME}

    def _traced_together(self, requests: Sequence[TraceRequest]) -> tuple[list[Rendered], list[Passes]]:
        """Trace all requests packed, in one render where that is exact, else each view as Blender's own camera."""
        rendered = self.cameras["left"]
        others = [self.cameras[request.view] for request in requests]
        reason = why_apart(self.traced_scene, rendered, others, self.volumes)
        if reason is None and not turns_in_shutter(self.traced_scene):
            return super()._traced_together(requests)
        renders: list[Rendered] = []
        answers: list[Passes] = []
        for request in requests:
            with self.traced_at(request.view) as eye:
                of_eye = {**self.cameras, eye: self.cameras[request.view]}
                asked = [replace(request, view=eye)]
                done = trace_together(
                    self.traced_scene, of_eye, self.volumes, asked, self.folder, self._next_seed, self.packed
                )
            renders += done[0]
            answers += done[1]
        return renders, answers


class ViewsRenderer(ManyViewsRenderer):
    """Renderer of a working scene for many views side by side.

    offsets are the places of the views beside the scene's camera, in scene units, from the leftmost on. All show the
    plane at focus_distance, in scene units, alike. The other parameters are those of
    `BlenderRenderer`. The working camera's stereo settings are changed for good. Raises BadInputError for an engine or
    a camera that cannot do it.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        folder: Path,
        offsets: Sequence[float],
        focus_distance: float,
        *,
        user_scene: bpy.types.Scene | None = None,
        packed_by: str = "auto",
    ) -> None:
        middle = set_up_middle(scene, focus_distance)
        self._offsets = dict(zip(view_names(len(offsets)), offsets, strict=True))
        views = {name: beside(middle, offset, focus_distance) for name, offset in self._offsets.items()}
        super().__init__(scene, folder, views, user_scene=user_scene, packed_by=packed_by)

    @contextmanager
    def standing_at(self, view: str) -> Iterator[str]:
        """Have the scene's camera stand as the view of this name, as `ManyViewsRenderer.standing_at` says."""
        if view not in self._offsets:
            yield view
            return
        with standing_beside(self.scene, self._offsets[view]) as eye:
            yield eye


@contextmanager
def standing_beside(scene: bpy.types.Scene, offset: float) -> Iterator[str]:
    """Have the camera of a scene that `set_up_middle` has set up stand so far to its right, in scene units, for the
    time of a `with` block; gives the name of the eye that does."""
    eye, pivot = ("right", "LEFT") if offset >= 0.0 else ("left", "RIGHT")
    with changed(scene.camera.data.stereo, pivot=pivot, interocular_distance=abs(offset)):
        yield eye


def check_views(camera: bpy.types.Object, engine: str) -> None:
    """Raise BadInputError for an engine, by its name in Blender, or a camera that many views cannot be rendered
    with."""
    if engine != CYCLES:
        raise BadInputError("many views are rendered by Cycles alone: set Cycles as engine")
    if camera.data.type != "PERSP":
        message = "camera {camera} is no perspective camera, which many views need: change its type"
        raise BadInputError(Words(message, camera=repr(camera.name)))


def set_up_middle(scene: bpy.types.Scene, focus_distance: float) -> PerspectiveCamera:
    """Have the camera of a working scene show the plane at this distance alike in both eyes (off-axis), both of which
    stand where the camera does; return it. Raises BadInputError for an engine or a camera that cannot do it.
    """
    camera = scene.camera
    check_views(camera, scene.render.engine)
    data = camera.data
    stereo = data.stereo
    _hold_stereo_still(scene)
    stereo.use_spherical_stereo = False
    stereo.convergence_mode = MODES["off-axis"]
    stereo.convergence_distance = convergence_of_screen(data, focus_distance)
    stereo.pivot, stereo.interocular_distance = "LEFT", 0.0
    # Vector is of one camera's motion; between views of one moment there is none.
    rendered_layer(scene).use_pass_vector = False
    eye = stereo_cameras(evaluated(camera, scene), scene.render)["left"]
    assert isinstance(eye, PerspectiveCamera)
    return eye


@contextmanager
def stereo_restored(scene: bpy.types.Scene) -> Iterator[None]:
    """Restore what `set_up_middle` changes of a working scene after a `with` block, so that the scene can go on to
    another frame. Not for stereo settings that move, see `stereo_moves`: to set them would stop them."""
    stereo, layer = scene.camera.data.stereo, rendered_layer(scene)
    kept = {name: getattr(stereo, name) for name in STEREO_SETTINGS}
    with changed(stereo, **kept), changed(layer, use_pass_vector=layer.use_pass_vector):
        yield


def stereo_moves(scene: bpy.types.Scene) -> bool:
    """Return whether curves or drivers move how the eyes of a working scene's camera stand."""
    data = scene.camera.data
    moved = animated_values(data)
    return any((data.stereo.as_pointer(), name) in moved for name in STEREO_SETTINGS)


def _hold_stereo_still(scene: bpy.types.Scene) -> None:
    """Have the settings of a working scene's camera stand still as they are in the present frame, where curves or
    drivers move how its eyes stand: in the next render they would move what is set here back."""
    if not stereo_moves(scene):
        return
    data, now = scene.camera.data, evaluated(scene.camera, scene).data
    moved = animated_values(data)
    pairs = ((data, now), (data.dof, now.dof), (data.stereo, now.stereo))
    values = [
        (own, known.identifier, getattr(seen, known.identifier))
        for own, seen in pairs
        for known in own.bl_rna.properties
        if (own.as_pointer(), known.identifier) in moved
    ]
    data.animation_data_clear()
    for own, name, value in values:
        setattr(own, name, value)
