"""A camera in the frames around the one that is rendered: motion vectors are measured against its places there."""

from __future__ import annotations

from dataclasses import dataclass, replace

from .camera import Camera, PerspectiveCamera, ViewPlane, is_planar, planar


@dataclass(frozen=True)
class Moving:
    """The motion of a view's camera: the camera in the frame that is rendered, in the frame before it and in the one
    after."""

    now: Camera
    before: Camera
    after: Camera


def standing_still(camera: Camera) -> Moving:
    """Return the motion of a camera that does not move."""
    return Moving(camera, camera, camera)


def moving(now: Camera, before: Camera, after: Camera) -> Moving:
    """Return a camera's motion as Cycles measures it for motion vectors, from the cameras of three frames.

    Cycles uses the view plane of the rendered frame in all three, scaled by the focal length. So no other change of the
    lens counts, and none at all for an orthographic camera.
    """
    return Moving(now, _with_plane_of(now, before), _with_plane_of(now, after))


def _with_plane_of(now: Camera, then: Camera) -> Camera:
    """Return the camera `then` with the view plane of `now`, scaled by the change of focal length between them."""
    if not is_planar(now):
        return then
    plane, before = now.plane, planar(then).plane
    zoom = (before.right - before.left) / (plane.right - plane.left)
    if not isinstance(now, PerspectiveCamera):
        zoom = 1.0
    scaled = ViewPlane(*(zoom * side for side in (plane.left, plane.right, plane.bottom, plane.top)))
    return replace(then, plane=scaled)  # pyright: ignore[reportArgumentType] - both models are dataclasses
