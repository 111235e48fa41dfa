"""The trial of a GPU: small pictures that it has to warp as NumPy does before it is used."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...images.passes import COLOUR_PASS, DEPTH_PASS, Passes
from ...views.camera import Camera, PerspectiveCamera, ViewPlane
from ...views.panorama import PanoramicCamera
from ...views.projections import Equirectangular
from ...views.spherical import SphericalStereo
from ...views.view import View
from ...warp.options import WarpOptions
from ...warp.rendered_view import RenderedView
from ...warp.warped_view import WarpedView

MAX_TRIAL_DIFFERENCE, MAX_TRIAL_SHARE = 1e-3, 0.01
"""Difference of a colour, and share of the few pixels of the trial, by which the GPU and NumPy may differ."""

WIDTH, HEIGHT = 45, 34
"""Size of the pictures, in pixels."""


def trials() -> Iterator[tuple[RenderedView, View, WarpOptions]]:
    """Yield small made-up sources with passes of every kind, the views to warp them to, and how: along rows, quad by
    quad, and along the rows of a whole turn."""
    passes = _passes()
    for cameras, interpolation in ((_planar(0.0), "linear"), (_planar(0.02), "cubic"), (_all_around(), "linear")):
        source, target = (View(name, camera) for name, camera in zip(("source", "target"), cameras, strict=True))
        yield (
            RenderedView(source, passes),
            target,
            WarpOptions(interpolation=interpolation, colour_interpolation="cubic"),
        )


def are_alike(ours: WarpedView, numpys: WarpedView) -> bool:
    """Return whether two warps of a trial are the same, but for what rounding decides."""
    both = ours.warp.covered & numpys.warp.covered
    apart = np.abs(ours.passes[COLOUR_PASS] - numpys.passes[COLOUR_PASS]).max(axis=-1) > MAX_TRIAL_DIFFERENCE
    return float(np.mean(ours.empty != numpys.empty) + np.mean(apart & both)) <= MAX_TRIAL_SHARE


def _planar(yaw: float) -> tuple[Camera, Camera]:
    """Return two perspective cameras. yaw turns the second, in radians, so that rows are not enough."""
    plane = ViewPlane(-0.5, 0.5, -0.4, 0.4)
    turned = np.eye(4)
    turned[0, (0, 2)], turned[2, (0, 2)], turned[0, 3] = (np.cos(yaw), np.sin(yaw)), (-np.sin(yaw), np.cos(yaw)), 0.2
    return PerspectiveCamera(WIDTH, HEIGHT, np.eye(4), plane), PerspectiveCamera(WIDTH, HEIGHT, turned, plane)


def _all_around() -> tuple[Camera, Camera]:
    """Return two eyes of spherical stereo that look all around."""
    window, projection = ViewPlane(0.0, 1.0, 0.0, 1.0), Equirectangular((-np.pi, np.pi), (-1.5, 1.5))

    def eye(offset: float) -> PanoramicCamera:
        return PanoramicCamera(WIDTH, HEIGHT, np.eye(4), window, projection, SphericalStereo(offset, 3.0))

    return eye(-0.1), eye(0.1)


def _passes() -> Passes:
    """Return the passes of the pictures: every kind of lookup, so that what compiles here compiles later on."""
    x, y = np.meshgrid(np.arange(WIDTH) / WIDTH, np.arange(HEIGHT) / HEIGHT)
    depth = 4.0 + x + 0.5 * y
    depth[5:20, 12:20], depth[:4, 30:], depth[25, 25] = 1.5, np.inf, np.nan
    colour = np.stack([np.sin(9 * x + k) * np.cos(7 * y) for k in range(4)], axis=-1).astype(np.float32)
    return {
        COLOUR_PASS: colour,
        DEPTH_PASS: depth[..., None].astype(np.float32),
        "Diffuse Color": colour[..., :3],
        "An AOV": colour,
        "Object Index": np.round(4.0 * colour[..., :1]),
        "CryptoObject00": np.round(4.0 * colour),
    }
