"""Sources around a target, of any cameras, and what each of them sees of an analytic world. Not a test itself."""

from __future__ import annotations

import numpy as np

from stereo_reproject.views.view import View
from stereo_reproject.warp.rendered_view import RenderedView
from tests.warp.analytic import Plane, World, camera, pose

SIZE = (96, 64)
WALL = 5.0

ROOM = World((Plane((0.0, 0.0, -WALL)), Plane((0.1, 0.0, -2.5), half=0.35)))
"""A wall, and a panel before it."""

CONVERGENCE = 4.0


def _toed(x):
    return pose((x, 0.0, 0.0), yaw=float(np.arctan(x / CONVERGENCE)))


def _off_axis(x):
    return camera(SIZE, pose((x, 0.0, 0.0)), shift=(-x / CONVERGENCE, 0.0))


def _turned(x, **angles):
    return camera(SIZE, pose((x, 0.04, 0.03), **angles))


CAMERAS = {
    "parallel": (camera(SIZE), camera(SIZE, pose((-0.1, 0.0, 0.0))), camera(SIZE, pose((0.3, 0.0, 0.0)))),
    "off-axis": (_off_axis(0.0), _off_axis(-0.1), _off_axis(0.3)),
    "toe-in": (camera(SIZE), camera(SIZE, _toed(-0.1)), camera(SIZE, _toed(0.3))),
    "turned": (camera(SIZE), _turned(-0.1, yaw=0.02, roll=0.03), _turned(0.35, yaw=-0.04, pitch=0.02)),
    "parallel and turned": (camera(SIZE), camera(SIZE, pose((-0.1, 0.0, 0.0))), _turned(0.35, roll=0.05)),
    "of other sizes": (camera(SIZE), camera((121, 90), pose((-0.1, 0.0, 0.0))), camera((80, 50), _toed(0.3))),
    "of other distances": (camera(SIZE), camera(SIZE, pose((-0.1, 0.0, 0.2))), camera(SIZE, pose((0.3, 0.0, -0.3)))),
    "orthographic": tuple(
        camera(SIZE, pose((x, 0.0, 0.0), yaw=yaw), orthographic=True)
        for x, yaw in ((0.0, 0.0), (-0.1, -0.06), (0.3, 0.12))
    ),
}
"""By name the target's camera, and those of two sources, of which the first is the nearer one."""


def rendered(eye, number, world=ROOM, **masks):
    """A source of this world whose colour is its number, everywhere and in all channels, from 1 on."""
    passes = world.render(eye)
    passes["Combined"] = np.full_like(passes["Combined"], number + 1)
    return RenderedView(View(f"source {number}", eye), passes, **masks)


def sources_of(kind, world=ROOM):
    """The target's view and two sources."""
    target, *eyes = CAMERAS[kind]
    return View("target", target), [rendered(eye, number, world) for number, eye in enumerate(eyes)]
