"""The renderer of a scene's own views: each by a camera of its own, at any place, in any direction and with any lens.

Blender renders a view with its own camera, in whole renders as in traces that cannot be packed with those of other
views. The working scene has copies of all of them.
"""

from __future__ import annotations

import math
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...settings.frame import SceneOverrides
from ...views.camera import PerspectiveCamera, target_from_source
from ...views.frustum import Lens
from ..scene.motion import while_open
from ..scene.rig import stereo_cameras
from ..scene.visible import lens_of
from ..scene.vr_cameras import copy_of_camera
from ..scene.working import KEPT_OBJECT, changed, evaluate_anew, evaluated, remove_kept, rendered_layer
from .portal_sheet import hide_sheet
from .views_renderer import ONE_VIEW_AT_A_TIME, ManyViewsRenderer, check_views

SAME_LENS = 1e-4
"""Share by which two numbers of cameras' lenses may differ, so that they count as the same."""

SAME_PLACE = 1e-5
"""Share by which cameras may move against each other while the shutter is open, so that they count as one rig."""

APERTURE = ("aperture_blades", "aperture_rotation", "aperture_ratio")


@contextmanager
def copies_of_cameras(working: bpy.types.Scene, cameras: Mapping[str, bpy.types.Object]) -> Iterator[Mapping[str, str]]:
    """Have copies of the user's cameras in a working scene for the time of a `with` block; gives their names by view
    name, since a reference may not survive a render. While any of them is the scene's camera, Blender finds all of them
    by the views of these names.

    Raises BadInputError for an engine or a camera that many views cannot be rendered with.
    """
    for camera in cameras.values():
        check_views(camera, working.render.engine)
    # Vector is of one camera's motion; between views of one moment there is none.
    rendered_layer(working).use_pass_vector = False
    stem = f"stereo_reproject {secrets.token_hex(4)} "
    with ExitStack() as copies:
        found = {}
        for name, camera in cameras.items():
            copy = copy_of_camera(camera, SceneOverrides())
            copy.name = f"{stem}{name}"
            found[name] = copy.name
            copies.callback(_remove, copy.name, copy.data.name)
            # A property of the user's own may have the name of ours.
            copy.pop(KEPT_OBJECT, None)
            working.collection.objects.link(copy)
            stereo = copy.data.stereo
            # With this pivot the left eye is the camera itself.
            stereo.pivot, stereo.convergence_mode, stereo.use_spherical_stereo = "LEFT", "PARALLEL", False
        _name_views(working.render, list(found))
        evaluate_anew(working)
        yield found


def _name_views(render: bpy.types.RenderSettings, names: Sequence[str]) -> None:
    """Give a working scene views of these names, each with its name as the end of its camera's."""
    for name in names:
        if name not in render.views:
            render.views.new(name)
    for view in render.views:
        # Blender takes the longest suffix that the scene's camera ends with.
        view.camera_suffix = view.name if view.name in names else ""


@contextmanager
def own_view(working: bpy.types.Scene, name: str) -> Iterator[str]:
    """Have Blender render the view of this name by its own camera, for the time of a `with` block; gives the name.
    Unlike another scene camera, it makes Blender work out nothing anew."""
    with changed(working.render, views_format="MULTIVIEW"):
        yield name


def _remove(camera: str, data: str) -> None:
    """Remove the copy of a camera, by the names of the object and of its data: a reference may not survive a render."""
    copy = bpy.data.objects[camera]
    remove_kept(copy)
    bpy.data.objects.remove(copy)
    bpy.data.cameras.remove(bpy.data.cameras[data])


@contextmanager
def looking_through(working: bpy.types.Scene, camera: str) -> Iterator[str]:
    """Have a working scene's camera be the one of this name, for the time of a `with` block; gives the name of the eye
    that shows its view."""
    with changed(working, camera=bpy.data.objects[camera]):
        yield "left"


def camera_of(working: bpy.types.Scene, camera: str) -> PerspectiveCamera:
    """Return the camera of this name, of those of `copies_of_cameras`, as it is at the present time. Raises
    BadInputError where it has no view."""
    eye = stereo_cameras(evaluated(bpy.data.objects[camera], working), working.render)["left"]
    assert isinstance(eye, PerspectiveCamera)
    return eye


class SceneViewsRenderer(ManyViewsRenderer):
    """Renderer of a working scene for its own views.

    cameras are those of `copies_of_cameras`, by view name, which must not be those of Blender's eyes; one of them is
    the scene's camera. The other parameters are those of `BlenderRenderer`.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        folder: Path,
        cameras: Mapping[str, str],
        *,
        user_scene: bpy.types.Scene | None = None,
        packed_by: str = "auto",
    ) -> None:
        self._camera_names = dict(cameras)
        views = {view: camera_of(scene, camera) for view, camera in cameras.items()}
        self._unlike = _why_unlike(scene, list(cameras.values()))
        super().__init__(scene, folder, views, user_scene=user_scene, packed_by=packed_by)
        self._hide_sheets()

    def _hide_sheets(self) -> None:
        """Hide the portal's sheets that hang on cameras since an earlier frame, where any camera might see them."""
        for name in self._camera_names.values():
            if KEPT_OBJECT in bpy.data.objects[name]:
                with looking_through(self.scene, name):
                    hide_sheet(self.scene, self.cameras.values())

    def standing_at(self, view: str) -> AbstractContextManager[str]:
        """Have Blender render the view of this name whole, as `ManyViewsRenderer.standing_at` says."""
        return own_view(self.scene, view) if view in self._camera_names else nullcontext(view)

    @contextmanager
    def traced_at(self, view: str) -> Iterator[str]:
        """Have the scene look through the camera of the view of this name, as `ManyViewsRenderer.traced_at` says."""
        # A portal's sheet hangs on the camera that it was made for, and stays there.
        hide_sheet(self.scene, self.cameras.values())
        with looking_through(self.scene, self._camera_names[view]) as eye:
            yield eye
            hide_sheet(self.scene, self.cameras.values())

    def fill_blockers(self, deepest: float = 0.0) -> dict[str, str | None]:
        """Return what `BlenderRenderer.fill_blockers` does. Of cameras whose pictures differ by more than their places,
        directions and focal lengths none can be made from others."""
        if self._unlike is not None:
            return {"packed": self._unlike, "card": ONE_VIEW_AT_A_TIME}
        return super().fill_blockers(deepest)


def _why_unlike(scene: bpy.types.Scene, cameras: Sequence[str]) -> str | None:
    """Return why views of the cameras of these names cannot be made from each other, in words; None where they can."""
    lenses = []
    for camera in cameras:
        with looking_through(scene, camera):
            lenses.append(lens_of(scene))
    if not all(_same_lens(lens, lenses[0]) for lens in lenses[1:]):
        return "the cameras have other clip distances or another depth of field"
    seen = [evaluated(bpy.data.objects[camera], scene).data.dof for camera in cameras]
    shapes = {tuple(getattr(dof, name) for name in APERTURE) for dof in seen}
    if lenses[0].aperture > 0.0 and len(shapes) > 1:
        return "the apertures of the cameras have other shapes"
    if scene.render.use_motion_blur and not _is_rigid(scene, cameras):
        return "the cameras move or zoom against each other while the shutter is open"
    return None


def _same_lens(one: Lens, other: Lens) -> bool:
    """Return whether two lenses clip and blur alike."""
    pairs = ((one.near, other.near), (one.far, other.far), (one.aperture, other.aperture), (one.focus, other.focus))
    return all(math.isclose(a, b, rel_tol=SAME_LENS) for a, b in pairs)


def _is_rigid(scene: bpy.types.Scene, cameras: Sequence[str]) -> bool:
    """Return whether the cameras of these names keep their places to each other, and their lenses, while the shutter is
    open."""
    moments = while_open(scene, (0.0, 0.5, 1.0), lambda: [camera_of(scene, camera) for camera in cameras])
    first, *later = (np.array([_seen_from(moment[0], camera) for camera in moment]) for moment in moments)
    # Places are in scene units, all else in shares of 1.
    units = np.ones(first.shape[1])
    units[:3] = max(float(np.abs(first[:, :3]).max()), np.finfo(np.float64).tiny)
    return all(bool(np.all(np.abs(now - first) <= SAME_PLACE * units)) for now in later)


def _seen_from(first: PerspectiveCamera, camera: PerspectiveCamera) -> NDArray[np.floating]:
    """Return the place of a camera and its directions in another one's space, and its view plane, as numbers (16,)."""
    pose, plane = target_from_source(camera, first), camera.plane
    sides = (plane.left, plane.right, plane.bottom, plane.top)
    return np.concatenate([pose[:3, 3], pose[:3, :3].ravel(), sides])
