"""The warp on a GPU, by the compute shaders of `shaders`: the same view as NumPy's `warper.warp_view` makes.

The grid is numpy's: judging its cells takes 5 ms at 1920 x 1080, wants doubles, and everything on the GPU would wait
for the answer. All that follows stays there, and every picture goes there and comes back once.

float32 is all that there is. What numpy computes in doubles is computed with differences here (`_moves`), so that what
the two disagree on is what rounding decides: an edge within some 1e-5 px of a pixel's centre, a step in depth that is
just about a tear.
"""

from __future__ import annotations

import threading
from functools import cache

import gpu
import numpy as np
from numpy.typing import NDArray

from ...images.passes import DEPTH_PASS
from ...views.camera import (
    Camera,
    OrthographicCamera,
    PlanarCamera,
    disparity_per_nearness,
    goes_round,
    is_planar,
    pixel_size,
    target_from_source,
)
from ...views.panorama import has_lens_edge
from ...views.view import View
from ...warp import warper
from ...warp.composite import passes_seen, target_depth
from ...warp.corners import lattice_corners
from ...warp.empty import empty_reasons
from ...warp.forward import Warp, with_nothing_beyond_lens
from ...warp.grid import CELL_QUADS, Grid, build_grid
from ...warp.options import WarpOptions
from ...warp.quads import widest_quad
from ...warp.rendered_view import RenderedView
from ...warp.scanline import LARGEST_NEARNESS, RowLaw, row_law_of
from ...warp.tuning import TUNING as WARP_TUNING
from ...warp.warped_view import WarpedView
from ...warp.warper import DEFAULTS, Warper
from .context import in_silence, started
from .textures import Constant, NoRoomError, ShaderRun, downloaded, fold, uploaded
from .trial import are_alike, trials

NO_INTERVAL_KEY, NO_QUAD_KEY = -1, -(2**31)
"""Keys of a pixel that nothing covers yet, smaller than any key of an interval, or of a quad."""

SAME_DEPTH: dict[str, Constant] = {"move_depth": (0.0, 0.0, 1.0, 0.0), "move_scale": (0.0, 0.0, 1.0, 0.0)}
"""Those of `_moves` by which a point is as far from the target as from the source."""


def usable() -> str | None:
    """Return the GPU's name; None where there is none that warps as NumPy does. It is tried once per process, in
    silence. None in any thread but the main one, and once the GPU has failed.
    """
    return None if _given_up or threading.current_thread() is not threading.main_thread() else _tried()


def gpu_warper() -> Warper | None:
    """Return the warp on the GPU for the pipeline; None where no GPU can be used. The first call in a process takes a
    while.
    """
    device = usable()
    return None if device is None else Warper(warp_view, device)


_given_up: list[str] = []
"""Reasons for which the GPU is not asked any more in this process, in words."""


@cache
def _tried() -> str | None:
    """Return the GPU's name if it passes some small trials against NumPy; None if it does not, or if anything fails."""
    try:
        with in_silence():
            if started() and all(_agrees(*trial) for trial in trials()):
                return gpu.platform.renderer_get()
    # SystemError without a GPU, others where a driver fails; Exception itself is what a shader's compilation raises.
    except Exception:  # noqa: BLE001 - whatever it is, there is no GPU that works
        return None
    return None


def _agrees(source: RenderedView, target: View, options: WarpOptions) -> bool:
    """Return whether the GPU warps a small picture as NumPy does."""
    return are_alike(_warp_on_gpu(source, target, options), warper.warp_view(source, target, options))


def warp_view(source: RenderedView, target: View, options: WarpOptions = DEFAULTS) -> WarpedView:
    """Return what `warper.warp_view` returns, made by the GPU; by NumPy where there is none, where the pictures do not
    fit, or where the GPU fails. After a failure other than a lack of room, the GPU is not used in this process any
    more.
    """
    if usable() is not None and _fits(source, target):
        try:
            return _warp_on_gpu(source, target, options)
        # What does not fit is known when the memory is asked for.
        except NoRoomError:
            pass
        # As in the trial. The frame is numpy's then, and so are all others.
        except Exception as error:  # noqa: BLE001 - whatever a driver does, numpy still can
            _given_up.append(str(error))
    return warper.warp_view(source, target, options)


def _fits(source: RenderedView, target: View) -> bool:
    """Return whether the shaders know these cameras, and the pictures are not too large for textures."""
    cameras = (source.camera, target.camera)
    if type(source.camera) is not type(target.camera):
        return False
    longest = max(max(camera.width, camera.height) for camera in cameras) + 2
    texels = {image.shape[-1] // _lanes(image) for image in source.passes.values()}
    folds = [fold(camera.width, camera.height, each) for camera in cameras for each in texels]
    return longest <= gpu.capabilities.max_texture_size_get() and None not in folds


def _warp_on_gpu(source: RenderedView, target: View, options: WarpOptions) -> WarpedView:
    """Return the warped view, made by the GPU, without any way out: raises NoRoomError where something does not fit,
    and whatever a driver raises. The GPU must be usable.
    """
    camera, other = source.camera, target.camera
    grid = build_grid(source.depth, camera, other, threshold=options.grid_threshold, most=WARP_TUNING.tear_pixels)
    law = row_law_of(camera, other)
    shaders = _shader_run(source.passes[DEPTH_PASS], camera, other, grid, law)
    try:
        shaders.create("cut", _size(camera))
        shaders.run("cuts", _size(camera))
        if law is None:
            _draw(shaders, source, other, grid)
        else:
            _along_rows(shaders, camera, other, law)
        warp = _map(shaders, camera, other)
        empty, depth = (step(shaders, source, other, warp) for step in (_empty, _target_depth))

        def look_up(image: NDArray[np.float32], how: str) -> NDArray[np.float32]:
            return _looked_up(shaders, image, how, other)

        seen = passes_seen(source, target, warp, depth, look_up, options)
    finally:
        gpu.shader.unbind()
    return WarpedView(seen.passes, grid, warp, empty, sharpness=seen.sharpness, by="gpu")


def _size(camera: Camera) -> tuple[int, int]:
    """Return the camera's size (width, height) in pixels."""
    return camera.width, camera.height


def _shader_run(
    depth: NDArray[np.float32], source: Camera, target: Camera, grid: Grid, law: RowLaw | None
) -> ShaderRun:
    """Return the run of all shaders of one warp: with its constants, and as textures the source's depth (H, W, 1), the
    grid, and the map that is to be made. law is that of a pair whose rows match.
    """
    rows, columns = grid.subdivided.shape
    constants: dict[str, Constant] = {
        "source_size": _size(source),
        "target_size": _size(target),
        "cell_count": (columns, rows),
        "is_parallel": int(isinstance(source, OrthographicCamera)),
        "disparity_scale": disparity_per_nearness(source, target),
        "wraps": int(goes_round(source)),
    }
    # Rows that go on beyond their sides are drawn without coarse cells.
    subdivided = np.ones_like(grid.subdivided) if law is not None and law.wraps else grid.subdivided
    split = uploaded(subdivided.astype(np.float32), (columns, rows))
    shaders = ShaderRun(constants, {"depth": uploaded(depth, _size(source)), "split": split})
    for name in ("x", "y", "near"):
        shaders.create(name, _size(target))
    return shaders


def _map(shaders: ShaderRun, source: Camera, target: Camera) -> Warp:
    """Return the map from target to source that was drawn. Its textures "x", "y" and "near" stay in the run for later
    shaders."""
    shaders.drop("cut", "split", "owner")
    drawn = Warp(*(downloaded(shaders.textures[name]) for name in ("x", "y", "near")))
    if not (has_lens_edge(source) and has_lens_edge(target)):
        return drawn
    warp = with_nothing_beyond_lens(drawn, source, target)
    shaders.textures |= {name: uploaded(getattr(warp, name), _size(target)) for name in ("x", "y")}
    return warp


def _along_rows(shaders: ShaderRun, source: Camera, target: Camera, law: RowLaw) -> None:
    """Draw the rows of a pair whose rows match into the textures of the map, as `scanline.warp_rows` does."""
    width, height = _size(source)
    shaders.textures["line"] = uploaded(law.lines(height), (2, height))
    shaders.create("corner", (width + 2, height))
    shaders.run("corners", (width + 2, height), tangent_scale=law.pixels_per_tangent or 0.0)
    shaders.create("owner", _size(target), fill=NO_INTERVAL_KEY)
    # Of a picture that goes on beyond its sides, intervals count from a turn before it to a turn after it.
    turn = width * int(law.wraps)
    key_way = (width + turn, -1) if law.grows else (turn, 1)
    shaders.run("intervals", (width + 1, height), key_way=key_way)
    shaders.run("places", _size(target), key_way=key_way)
    shaders.drop("corner", "line")


def _draw(shaders: ShaderRun, source: RenderedView, target: Camera, grid: Grid) -> None:
    """Draw the grid's quads into the textures of the map, as `quads.draw_quads` does. Raises NoRoomError where a quad
    is too broad.

    The shaders do their own depth test: the GPU's would round corners to 1/256 pixel.
    """
    width, height = _size(source.camera)
    if is_planar(source.camera) and is_planar(target):
        shaders.create("vertex", (width + 2, height + 2))
        shaders.run("vertices", (width + 2, height + 2), **_moves(source.camera, target))
        period, widest = 0.0, LARGEST_NEARNESS
    else:
        corners = lattice_corners(source.depth, source.camera, target, grid)
        shaders.textures["vertex"] = uploaded(corners, (width + 2, height + 2), lanes=4)
        period, widest = target.period_px if np.isfinite(target.period_px) else 0.0, widest_quad(target)
    for name in ("owner", "drawn"):
        shaders.create(name, _size(target), fill=NO_QUAD_KEY)
    broad = shaders.create("broad", (1, 1), fill=0)
    coarse = (-(-(width + 1) // CELL_QUADS), -(-(height + 1) // CELL_QUADS))
    places: dict[str, Constant] = {"period": period, "widest": widest}
    for to_settle in (0, 1):
        shaders.run("draw", coarse, quad_span=CELL_QUADS, to_settle=to_settle, **places)
        shaders.run("draw", (width + 1, height + 1), quad_span=1, to_settle=to_settle, **places)
    shaders.run("settled", _size(target), period=period)
    if downloaded(broad).any():
        raise NoRoomError("a quad covers more pixels than one invocation of a shader should fill")
    shaders.drop("vertex", "drawn", "broad")


def _empty(shaders: ShaderRun, source: RenderedView, target: Camera, warp: Warp) -> NDArray[np.uint16]:
    """Return the `Reason` flags (H, W) of target pixels that the warp cannot answer for, as `empty.empty_reasons` does:
    it does so itself for panoramas. Textures that only this step needs are dropped.
    """
    camera = source.camera
    if not (is_planar(camera) and is_planar(target)):
        shaders.drop("near")
        return empty_reasons(warp, camera, target)
    for name in ("before", "after"):
        shaders.create(name, _size(target))
    shaders.run("neighbours", (target.height, 1))
    flags = shaders.create("flag", _size(target))
    shaders.run("flags", _size(target), **_moves(target, camera))
    shaders.drop("before", "after", "flag", "near")
    return downloaded(flags).astype(np.uint16)


def _target_depth(shaders: ShaderRun, source: RenderedView, target: Camera, warp: Warp) -> NDArray[np.float32]:
    """Return the depth (H, W) that the target sees at each pixel, as `composite.target_depth` computes it: it does so
    itself for panoramas whose rows do not match."""
    camera = source.camera
    if is_planar(camera) and is_planar(target):
        moves = _moves(camera, target)
    elif row_law_of(camera, target) is not None:
        moves = SAME_DEPTH
    else:
        shaders.drop("depth")
        return target_depth(source.passes[DEPTH_PASS], warp, camera, target)
    result = shaders.create("result", _size(target))
    shaders.run("depth", _size(target), **moves)
    shaders.drop("depth", "result")
    return downloaded(result)


def _lanes(image: NDArray) -> int:
    """Return how many channels of a pass are looked up at once: 4 if it has 4, else 1."""
    return 4 if image.shape[-1] == 4 else 1


def _looked_up(shaders: ShaderRun, image: NDArray[np.float32], how: str, target: Camera) -> NDArray[np.float32]:
    """Return a pass (H, W, C) of the source as the target sees it (h, w, C), as `images.lookup.lookup` does it by the
    map. how is "nearest", "linear" or "cubic". Raises NoRoomError.
    """
    height, width, channels = image.shape
    lanes = _lanes(image)
    texels = channels // lanes
    source_fold, target_fold = fold(width, height, texels), fold(target.width, target.height, texels)
    if source_fold is None or target_fold is None:
        raise NoRoomError(f"{width} x {height} pixels of {channels} channels are more than a texture holds")
    shaders.textures["picture"] = uploaded(image, (source_fold[0], source_fold[1] * height), lanes=lanes)
    name = "result" if lanes == 1 else f"result{lanes}"
    result = shaders.create(name, (target_fold[0], target_fold[1] * target.height))
    folds: dict[str, Constant] = {"source_fold": source_fold, "target_fold": target_fold}
    shaders.run(f"{how} {lanes}", _size(target), layers=texels, texel_count=texels, **folds)
    shaders.drop("picture", name)
    return downloaded(result).reshape(target.height, target.width, channels)


def _moves(source: PlanarCamera, target: PlanarCamera) -> dict[str, Constant]:
    """Return the coefficients by which the shaders compute how a point of the source moves on its way into the target.

    They are those of (x, y, 1, nearness or depth), with x and y in pixels from the middle of the picture. A place in
    the target is a quotient; the place in the source is subtracted before the division, so that small numbers are
    divided and float32 errors are small.
    """
    parallel = isinstance(source, OrthographicCamera)
    plane, other = source.plane, target.plane
    size, other_size = np.array(pixel_size(source)), np.array(pixel_size(target))
    local = np.zeros((4, 4))
    local[0, (0, 2)] = size[0], 0.5 * (plane.left + plane.right)
    local[1, (1, 2)] = -size[1], 0.5 * (plane.bottom + plane.top)
    local[2, 3 if parallel else 2], local[3, 2 if parallel else 3] = -1.0, 1.0
    across, up, back = target_from_source(source, target)[:3] @ local
    scale = np.array([0.0, 0.0, 1.0, 0.0]) if parallel else -back
    move_x = (across - 0.5 * (other.left + other.right) * scale) / other_size[0]
    move_y = (0.5 * (other.bottom + other.top) * scale - up) / other_size[1]
    move_x += 0.5 * (target.width - source.width) * scale
    move_y += 0.5 * (target.height - source.height) * scale
    move_x[0] -= scale[2]
    move_y[1] -= scale[2]
    rows = {"move_x": move_x, "move_y": move_y, "move_depth": -back, "move_scale": scale}
    return {name: tuple(row.tolist()) for name, row in rows.items()}
