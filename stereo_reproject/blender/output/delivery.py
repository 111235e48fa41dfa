"""Finished eyes delivered: handed back to Blender by a render call with an engine that renders nothing.

After that call the Render Result holds both views as after a multiview render, and Blender's own compositor, view
transform, stereo formats and file naming do the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from types import MappingProxyType
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import StereoReprojectError
from ...images.exr import VIEWS
from ...images.passes import COLOUR_PASS, Passes
from ...words import Words
from ..engines.render import call_render, output_path, written_to
from ..scene.compositor import file_outputs_muted, is_composited, shows_a_render, wired_passes
from ..scene.effects import is_animated
from ..scene.rendered import camera_at, main_layer
from ..scene.stand_ins import new_names, renamed_metadata, stand_ins
from ..scene.working import changed, evaluated, return_to_own_frame, stand_at
from .delivery_engine import ENGINE, DeliveryUnderWay, Eyes, EyesAt, registered
from .image_settings import copy_settings, linear_exr, side_by_side_png
from .output_paths import output_name
from .pictures import check_png
from .stamp import stamped

NOTHING: Mapping[str, str] = MappingProxyType({})


def deliver_side_by_side(
    scene: bpy.types.Scene,
    pictures: Mapping[str, NDArray[np.float32]],
    path: Path,
    *,
    frame: int | None = None,
    metadata: Mapping[str, str] = NOTHING,
) -> None:
    """Write the pictures of both views, (H, W, 4) scene-linear, side by side into one PNG, through the scene's view
    transform. frame is the one at which the scene's settings count; None is the present one. metadata are texts for the
    file's header.

    The compositor is not run, and colour settings of the output are not used. An empty scene with the settings of
    `scene` does it, so that nothing is evaluated and the scene's own engine keeps its data. Raises
    StereoReprojectError.
    """
    frame = scene.frame_current if frame is None else frame
    with empty_scene_like(scene, frame) as empty:
        layer = main_layer(empty)
        eyes = {view: {layer: {COLOUR_PASS: picture}} for view, picture in pictures.items()}
        with _as_delivered(empty, eyes, compositing=False), side_by_side_png(empty, path):
            _hand_over(empty, lambda _: eyes, Words("write {name}", name=path.name), metadata, write_still=True)
    check_png(path)


def deliver_picture(scene: bpy.types.Scene, picture: NDArray[np.float32], path: Path) -> None:
    """Write one picture (H, W, 4), scene-linear, into a PNG, at the scene's present frame; all else is as for
    `deliver_side_by_side`. Raises StereoReprojectError.
    """
    with empty_scene_like(scene, scene.frame_current) as empty:
        eyes = {"": {main_layer(empty): {COLOUR_PASS: picture}}}
        with (
            _as_delivered(empty, eyes, compositing=False),
            side_by_side_png(empty, path),
        ):
            _hand_over(empty, lambda _: eyes, Words("write {name}", name=path.name), NOTHING, write_still=True)
    check_png(path)


@contextmanager
def pixels_of(scene: bpy.types.Scene, panorama: str | None) -> Iterator[None]:
    """Have the scene's pixels square, as those of a panorama for headsets are, for the time of a `with` block; None
    leaves them as they are. Movies would tell players of another shape, which then squeeze the panorama.
    """
    square = {} if panorama is None else {"pixel_aspect_x": 1.0, "pixel_aspect_y": 1.0}
    with changed(scene.render, **square):
        yield


@contextmanager
def empty_scene_like(scene: bpy.types.Scene, frame: int) -> Iterator[bpy.types.Scene]:
    """Have a scene without objects, with the render and colour settings that `scene` has at a frame, for the time of a
    `with` block. It is removed afterwards, and what is animated is back at the scene's own frame.
    """
    name = bpy.data.scenes.new(scene.name).name
    try:
        empty = bpy.data.scenes[name]
        # Blender renders nothing without one, and names it in the picture's metadata.
        empty.camera = camera_at(scene, frame)
        if is_animated(scene):
            with _copy_at(scene, frame) as copy:
                # Its own values stay those of the present frame.
                copy_settings(evaluated(copy, copy), empty)
        else:
            copy_settings(scene, empty)
        empty.frame_current = frame
        yield empty
    finally:
        bpy.data.scenes.remove(bpy.data.scenes[name])
        # The camera was moved there too.
        return_to_own_frame(scene, frame)


@contextmanager
def _copy_at(scene: bpy.types.Scene, frame: int) -> Iterator[bpy.types.Scene]:
    """Have a copy of the scene that stands at a frame, for the time of a `with` block; it is removed afterwards."""
    name = scene.copy().name
    try:
        bpy.data.scenes[name].frame_set(frame)
        yield bpy.data.scenes[name]
    finally:
        bpy.data.scenes.remove(bpy.data.scenes[name])


def deliver_composited(
    scene: bpy.types.Scene,
    eyes: Eyes,
    path: Path,
    *,
    frame: int | None = None,
    metadata: Mapping[str, str] = NOTHING,
) -> None:
    """Write both eyes as they are after the scene's compositor, side by side into one PNG, through the scene's view
    transform.

    frame is the one at which nodes and settings are evaluated; None is the present one. The compositor's File Output
    nodes write their files. Its nodes show the scene itself, so it is the scene itself, no copy, that is rendered with
    our engine: its Render Result is the pair, and all else is restored afterwards. metadata are the texts of an EXR's
    header that say what cryptomattes hold. Raises StereoReprojectError.
    """
    with _at_frame(scene, frame), _as_delivered(scene, eyes), side_by_side_png(scene, path):
        _hand_over(scene, lambda _: eyes, Words("write {name}", name=path.name), metadata, write_still=True)
    check_png(path)


def deliver_composited_view(
    scene: bpy.types.Scene,
    layers: Mapping[str, Passes],
    path: Path,
    *,
    frame: int | None = None,
    metadata: Mapping[str, str] = NOTHING,
) -> None:
    """Write one view as it is after the scene's compositor into an EXR, scene-linear. layers are its passes by view
    layer; File Output nodes write nothing, since each view would replace the files of the one before. All else is as
    for `deliver_composited`. Raises StereoReprojectError.
    """
    eyes = {"": layers}
    with (
        _at_frame(scene, frame),
        _as_delivered(scene, eyes),
        file_outputs_muted(scene),
        linear_exr(scene, path),
    ):
        _hand_over(scene, lambda _: eyes, Words("write {name}", name=path.name), metadata, write_still=True)


def deliver_to_result(
    scene: bpy.types.Scene,
    eyes: Eyes,
    *,
    frame: int | None = None,
    to_look_at: bool = False,
    metadata: Mapping[str, str] = NOTHING,
    layers_then: Sequence[str] | None = None,
) -> list[str]:
    """Make both eyes the scene's Render Result, as after Blender's multiview render of `frame` (None: the present one).
    The scene's compositor is run; with to_look_at its File Output nodes write nothing. All else in the scene is
    restored afterwards.

    layers_then are the names of the scene's view layers when the eyes were rendered, if they may have changed since.
    Renamed layers are recognized. Names of layers that are gone are returned: they are delivered too, but then no
    compositor is run, which could not show them. Raises StereoReprojectError.
    """
    now = [layer.name for layer in scene.view_layers]
    names = new_names(list(next(iter(eyes.values()))), now if layers_then is None else layers_then, now)
    eyes = {view: {names[name]: passes for name, passes in layers.items()} for view, layers in eyes.items()}
    gone = [name for name in names.values() if name not in now]
    muted = file_outputs_muted(scene) if to_look_at else nullcontext()
    with (
        _at_frame(scene, frame),
        stand_ins(scene, list(names.values())),
        _as_delivered(scene, eyes, compositing=not gone),
        muted,
    ):
        _hand_over(scene, lambda _: eyes, Words("hand the pair over to Blender"), renamed_metadata(metadata, names))
    return gone


def deliver_frames(
    scene: bpy.types.Scene, eyes_at: EyesAt, folder: Path, *, frames: range, metadata: Mapping[str, str] = NOTHING
) -> None:
    """Have Blender write the eyes of `frames` into a folder as it writes an animation: in the scene's own format,
    layout and naming, movies too. One view, which is called "", is written as without stereoscopy.

    eyes_at returns the eyes of a frame; the scene's compositor is run on each. The scene's settings are restored
    afterwards. Raises StereoReprojectError.
    """
    span = {"frame_start": frames.start, "frame_end": frames.stop - 1, "frame_step": frames.step}
    files = written_to(scene.render, f"{output_path(folder)}/{output_name(scene)}")
    with (
        _at_frame(scene, frames[0]),
        _as_delivered(scene, eyes_at(frames[0])),
        changed(scene, **span),
        changed(scene.render, **files),
    ):
        _hand_over(scene, eyes_at, Words("write frame {frame}", frame=frames[0]), metadata, animation=True)


def deliver_movie(
    scene: bpy.types.Scene, picture_at: Callable[[int], NDArray[np.float32]], folder: Path, *, frames: range
) -> None:
    """Have Blender write pictures (H, W, 4), one for each of `frames`, as a movie by the scene's own settings. Each
    picture holds both eyes already, in whatever layout. The compositor is not run. Raises StereoReprojectError.
    """
    layer = main_layer(scene)

    def eyes_at(frame: int) -> Eyes:
        return {"": {layer: {COLOUR_PASS: picture_at(frame)}}}

    files = written_to(scene.render, f"{output_path(folder)}/movie")
    span = {"frame_start": frames[0], "frame_end": frames[-1], "frame_step": frames.step}
    with (
        _at_frame(scene, frames[0]),
        _as_delivered(scene, eyes_at(frames[0]), compositing=False),
        changed(scene, **span),
        changed(scene.render, use_stamp=False, **files),
    ):
        _hand_over(scene, eyes_at, Words("write the movie"), NOTHING, animation=True)


@contextmanager
def _at_frame(scene: bpy.types.Scene, frame: int | None) -> Iterator[None]:
    """Have the scene stand at a frame, for the time of a `with` block, and then again where it stood. None leaves it
    where it is.
    """
    stood_at = scene.frame_current, scene.frame_subframe
    try:
        if frame not in (None, stood_at[0]):
            scene.frame_set(frame)
        yield
    finally:
        if (scene.frame_current, scene.frame_subframe) != stood_at:
            stand_at(scene, *stood_at)


@contextmanager
def _as_delivered(scene: bpy.types.Scene, eyes: Eyes, *, compositing: bool = True) -> Iterator[None]:
    """Have the scene set so that nothing but these eyes goes into its result, for the time of a `with` block; the
    settings are restored afterwards. A single view is called "". With compositing, the scene's compositor is run,
    if it has one that can be.
    """
    delivered = next(iter(eyes.values()))
    compositing = compositing and is_composited(scene)
    with ExitStack() as changes:
        plain = {"use_compositing": compositing, "use_multiview": "" not in eyes}
        changes.enter_context(changed(scene.render, **plain, **_as_it_is()))
        for layer in scene.view_layers:
            # The eyes have Grease Pencil already, as far as they can.
            changes.enter_context(changed(layer, use=layer.name in delivered, use_grease_pencil=False))
        for view in scene.render.views:
            changes.enter_context(changed(view, use=view.name in VIEWS))
        yield


def _hand_over(scene: bpy.types.Scene, eyes_at: EyesAt, what: Words, metadata: Mapping[str, str], **how: bool) -> None:
    """Have Blender render the scene with the engine that has the eyes already. what says in an error's message what
    failed, as in "write the movie"; how is as for `call_render`. Raises StereoReprojectError.
    """
    eyes = eyes_at(scene.frame_current)
    height, width = next(iter(next(iter(eyes.values())).values()))[COLOUR_PASS].shape[:2]
    composited = scene.render.use_compositing
    wired = wired_passes(scene) if composited else {}
    place = {"resolution_x": width, "resolution_y": height, "resolution_percentage": 100}
    try:
        with stamped(scene.render, metadata) as texts:
            delivery = DeliveryUnderWay(eyes_at, wired, texts)
            with registered(delivery), changed(scene.render, engine=ENGINE, **place):
                call_render(scene, **how)
    except RuntimeError as error:
        raise StereoReprojectError(
            Words("cannot {what}: {reason}", what=what, reason=" ".join(str(error).split()))
        ) from error
    if delivery.failed is not None:
        raise delivery.failed
    # For a compositor that shows no render Blender makes none.
    asked = not composited or shows_a_render(scene)
    if asked and delivery.taken != {(view, layer) for view in eyes for layer in eyes[view]}:
        raise StereoReprojectError(Words("cannot {what}: Blender did not take both eyes", what=what))


def _as_it_is() -> dict[str, Any]:
    """Return render settings, as values by name, with which a result holds the delivered passes and nothing else."""
    return {
        "use_border": False,
        "use_sequencer": False,
        "use_freestyle": False,
        "use_single_layer": False,
        "views_format": "STEREO_3D",
    }
