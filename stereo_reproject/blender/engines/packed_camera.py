"""Common parts of the cameras of packed renders: their task, their settings, and a lens that can be set."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...images.passes import Passes
from ...trace.packing import Packing
from ...views.camera import Camera
from ..scene.effects import is_animated
from ..scene.rig import FrameRegion
from ..scene.working import changed, evaluated
from .packed_views import PackedPixels

UNSHARED_NOISE = {"scrambling_distance": 1.0, "auto_scrambling_distance": False}
"""Cycles' settings while it renders a packed picture: a shorter scrambling distance has pixels share their random
numbers. Both traces of a probe would have one noise, and seem to have none."""

PACKED_RENDER_SETTINGS = (
    "resolution_x",
    "resolution_y",
    "resolution_percentage",
    "use_border",
    "pixel_aspect_x",
    "pixel_aspect_y",
)
"""Render settings that a packed picture has of its own."""

LENS_SETTINGS = ("clip_start", "clip_end", "lens", "sensor_fit", "sensor_width", "ortho_scale")
STEREO_SETTINGS = ("interocular_distance", "convergence_distance")
DOF_SETTINGS = (
    "use_dof",
    "focus_distance",
    "aperture_fstop",
    "aperture_blades",
    "aperture_rotation",
    "aperture_ratio",
)


@dataclass(frozen=True)
class PackedTask:
    """A packed render: pixels of views, and their places in the packed picture.

    view is the view of the scene that Blender renders, `rendered` its camera, clip_start that camera's near clip in
    scene units, and region the pixels of its frame that it renders. packing has the places of each view's pixels, in
    the order of `views`. pixel_filter is the kind and the width of the scene's pixel filter, as `sample_offsets` takes
    them.
    """

    view: str
    rendered: Camera
    clip_start: float
    views: Sequence[PackedPixels]
    packing: Packing
    region: FrameRegion
    pixel_filter: tuple[str, float]

    @property
    def others(self) -> list[Camera]:
        """Cameras of the views that Blender does not render, in the order of `views`."""
        return [pixels.camera for pixels in self.views if pixels.camera is not self.rendered]


@dataclass(frozen=True)
class PackedCamera:
    """A way to have Cycles shoot the rays of a packed picture.

    name is its name in settings, reports and files, and label the one in messages. costs_key is that of its
    costs, where they are not known by its name.
    blocker(scene, eyes, deepest) returns why it cannot do so in a working scene, in words, or None; its arguments are
    as for `packed_blocker`, and deepest counts only where it clips_by_distance. settings are the paths, from the scene,
    of what it sets, as drivers name them. in_place(scene, task, folder) is a context in which the scene renders the
    packed picture; folder is private. as_plain(passes, task, index) returns the passes (N, C) of the pixels of one of
    the task's views as a plain render of that view has them.
    """

    name: str
    label: str
    clips_by_distance: bool
    blocker: Callable[[bpy.types.Scene, Iterable[Camera], float], str | None]
    settings: frozenset[str]
    in_place: Callable[[bpy.types.Scene, PackedTask, Path], AbstractContextManager[None]]
    as_plain: Callable[[Passes, PackedTask, int], Passes]
    costs_key: str = ""


def compute_device(scene: bpy.types.Scene) -> str:
    """Return the kind of device that the scene is rendered on, as Cycles' preferences name it: "NONE" is the CPU."""
    if scene.cycles.device == "CPU":
        return "NONE"
    return bpy.context.preferences.addons["cycles"].preferences.compute_device_type


@contextmanager
def packed_resolution(scene: bpy.types.Scene, packing: Packing, *, aspect: float = 1.0) -> Iterator[None]:
    """Have a scene render a packed picture, whole, for the time of a `with` block. aspect is the height of a pixel over
    its width.
    """
    resolution = {"resolution_x": packing.width, "resolution_y": packing.height, "resolution_percentage": 100}
    whole = {"use_border": False, "pixel_aspect_x": max(1.0, 1.0 / aspect), "pixel_aspect_y": max(1.0, aspect)}
    with changed(scene.render, **resolution, **whole), changed(scene.cycles, **UNSHARED_NOISE):
        yield


@contextmanager
def lens_to_set(scene: bpy.types.Scene) -> Iterator[bpy.types.Camera]:
    """Have a lens that can be made the packed camera's, for the time of a `with` block: the working scene's own; or a
    copy of it where the own one is animated, since curves would undo what is set. The copy is removed afterwards.

    A copy costs time: Blender works out anew what depends on what, and Cycles syncs all objects again.
    """
    eye = scene.camera
    plain: bpy.types.Camera = eye.data  # pyright: ignore[reportAssignmentType] - a camera object has no other data
    if not is_animated(plain):
        yield plain
        return
    packed = plain.copy()
    try:
        _set_lens(packed, evaluated(eye, scene).data)
        eye.data = packed
        yield packed
    finally:
        eye.data = plain
        bpy.data.cameras.remove(packed)


def _set_lens(packed: bpy.types.Camera, plain: bpy.types.Camera) -> None:
    """Give the lens `packed` the values that `plain`, the evaluated lens, has in the rendered frame, and no
    animation.
    """
    packed.animation_data_clear()
    for owner, values, names in (
        (packed, plain, LENS_SETTINGS),
        (packed.stereo, plain.stereo, STEREO_SETTINGS),
        (packed.dof, plain.dof, DOF_SETTINGS),
    ):
        for name in names:
            setattr(owner, name, getattr(values, name))


@contextmanager
def without_shifts(packed: bpy.types.Camera) -> Iterator[None]:
    """Have a lens with neither a shift of its own nor one by stereo convergence, for the time of a `with` block: the
    views' planes hold both already.
    """
    mode = packed.stereo.convergence_mode
    with (
        changed(packed.stereo, convergence_mode="PARALLEL" if mode == "OFFAXIS" else mode),
        changed(packed, shift_x=0.0, shift_y=0.0),
    ):
        yield


@contextmanager
def without_offset(packed: bpy.types.Camera) -> Iterator[None]:
    """Have a lens with spherical stereo not moved to an eye, for the time of a `with` block: the rays begin at the eye.
    Blender moves a custom camera as it moves a plain lens, and not as it moves one with spherical stereo."""
    if not packed.stereo.use_spherical_stereo:
        yield
        return
    with changed(packed.stereo, interocular_distance=0.0):
        yield
