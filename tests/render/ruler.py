"""How good a frame is, held against several plain renders of the same eye: over the frame, and where an effect is."""

from __future__ import annotations

import math
import operator
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from stereo_reproject.blender.commands.compare import MultiviewReference, flips
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.rig import stereo_cameras
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.images.metrics import judged
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.pipeline.stereo_frame import StereoFrame
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from stereo_reproject.views.camera import Camera
from tests.blender.toolbox import colour, evaluated_camera, px_from_world, render_plain

TARGET = "right"

PLAIN_SEEDS = (101, 102, 103, 104)
"""Of the plain renders: with four, the noise of the ruler itself is a quarter of a render's."""


def measured_noise_ratio(ours: NDArray, renders: NDArray, *, where: NDArray[np.bool_] | None = None) -> float:
    """rmse(ours, A) / rmse(B, A), A and B running over all the plain `renders` (N, H, W, C) and all pairs of them.

    ours (H, W, C), C >= 3; alpha counts where the pictures have it. Only pixels in `where` (H, W) count. The
    expectation is that of `metrics.noise_ratio`, sqrt((bias^2 + var(ours) + var) / 2 var), and both terms are averaged
    over more noise.
    """
    where = np.ones(ours.shape[:2], bool) if where is None else where
    plain = judged(renders)[:, where].astype(np.float64)
    variance = plain.var(axis=0, ddof=1).mean()
    from_mean = np.mean((judged(ours)[where] - plain.mean(axis=0)) ** 2)
    error = from_mean + variance * (1.0 - 1.0 / len(plain))
    if variance == 0.0:
        return 1.0 if error == 0.0 else math.inf
    return math.sqrt(error / (2.0 * variance))


def measured_honest_ratio(
    ours: NDArray, renders: NDArray, variance_share: NDArray, *, where: NDArray[np.bool_] | None = None
) -> float:
    """`metrics.honest_ratio` of ours (H, W, C), over all the plain `renders` (N, H, W, C) and all pairs of them.

    Alpha counts where the pictures have it. variance_share (H, W) is that of the frame. With m the mean of N renders
    and v their variance, (ours - m)^2 has the mean bias^2 + share v + v / N. Only pixels in `where` (H, W) count.
    """
    where = np.ones(ours.shape[:2], bool) if where is None else where
    plain = judged(renders)[:, where].astype(np.float64)
    variance = plain.var(axis=0, ddof=1)
    expected = (variance_share[where][:, None] + 1.0 / len(plain)) * variance
    squared = np.mean((judged(ours)[where] - plain.mean(axis=0)) ** 2 - expected)
    return math.sqrt(max(1.0 + 0.5 * squared / variance.mean(), 0.0))


def plain_renders(
    scene: bpy.types.Scene,
    folder: Path,
    *,
    view: str = TARGET,
    seeds: tuple[int, ...] = PLAIN_SEEDS,
    alpha: bool = False,
) -> NDArray[np.float32]:
    """(N, H, W, 3), or with alpha (N, H, W, 4): the view as Blender's own multiview renders it, once per seed; the
    scene's seed stays."""
    before, read = scene.cycles.seed, operator.itemgetter(COLOUR_PASS) if alpha else colour
    renders = [read(render_plain(scene, folder, seed=seed, views=(view,))[view]) for seed in seeds]
    scene.cycles.seed = before
    return np.stack(renders)


def measured_flip_ratio(
    scene: bpy.types.Scene, frame: StereoFrame, renders: NDArray[np.float32], folder: Path
) -> float:
    """FLIP of the frame's target over that between the first two plain `renders` (N, H, W, 4), as `--compare` has it.

    It must not be missing: `flips` would then return None.
    """
    rendered = MultiviewReference("CYCLES", 0.0, renders[0], renders[1], frame.light_scale)
    flip, noise_flip = flips(scene, StereoSettings(), frame.eyes[TARGET][COLOUR_PASS], rendered, folder)
    assert flip is not None
    assert noise_flip is not None
    return flip / noise_flip


def render_frame(scene: bpy.types.Scene, folder: Path, **settings) -> StereoFrame:
    """The pair of the scene as it stands, in this process."""
    with working_scene(scene, SceneOverrides()) as working:
        return render_stereo_frame(BlenderRenderer(working, folder), StereoSettings(**settings))


def on_screen(
    scene: bpy.types.Scene, objects: list[bpy.types.Object], *, grow: int = 0, view: str = TARGET
) -> NDArray[np.bool_]:
    """(H, W): the pixels of the boxes around the objects, as the view sees them, and `grow` more on every side."""
    camera = stereo_cameras(evaluated_camera(scene), scene.render)[view]
    result = np.zeros((camera.height, camera.width), bool)
    for item in objects:
        x, y = _corners(camera, item)
        top, left = (max(math.floor(values.min()) - grow, 0) for values in (y, x))
        bottom, right = (max(math.ceil(values.max()) + grow, 0) for values in (y, x))
        result[top:bottom, left:right] = True
    return result


def _corners(camera: Camera, item: bpy.types.Object) -> tuple[NDArray, NDArray]:
    matrix = np.array(item.matrix_world, np.float64)
    corners = np.array([corner[:] for corner in item.bound_box]) @ matrix[:3, :3].T + matrix[:3, 3]
    x, y, _ = px_from_world(camera, corners)
    return x, y
