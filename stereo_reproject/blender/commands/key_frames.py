"""The key frames of an animation whose other frames are made from them: which they are, and what has changed since."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import bpy

from ...holes.moved import Movers
from ...pipeline.frame import render_stereo_frame
from ...pipeline.key_frames import KeyFrame, SinceKey, render_from_key
from ...pipeline.shared_findings import SharedFindings
from ...pipeline.source import Source, render_source
from ...pipeline.stereo_frame import StereoFrame
from ...pipeline.stopwatch import Stopwatch
from ...pipeline.task import FrameTask
from ...pipeline.whole_view import render_whole_view
from ...settings.accuracy import accuracy_of
from ...settings.animation import KEY_FRAME
from ...settings.frame import StereoSettings
from ...trace.costs import TraceCosts
from ..engines.eevee import renderer_of
from ..engines.renderer import BlenderRenderer
from ..engines.time_limit import has_time_limit
from ..scene.changes import SceneState, state_of
from ..scene.movers import Shape, pixels_of_shapes, shapes_of
from ..scene.rendered import CYCLES, camera_at
from ..scene.working import WorkingScenes, rendered_layer, stand_at
from .known_costs import known_costs


@dataclass
class _Kept:
    """A key frame, and the state of the scene in it. shapes are those of things that were found to have moved since, as
    they were in the key frame, by all of their names; None where they have none."""

    key: KeyFrame
    state: SceneState
    shapes: dict[tuple[str, ...], list[Shape] | None] = field(default_factory=dict)


@dataclass(frozen=True)
class Making:
    """Means by which a frame of one view layer is rendered: the user's scene, the settings of this frame, a private
    folder, the stopwatch, and what other frames have found."""

    scene: bpy.types.Scene
    settings: StereoSettings
    work: Path
    watch: Stopwatch
    findings: SharedFindings


def whole_frame(renderer: BlenderRenderer, making: Making) -> tuple[StereoFrame, None]:
    """Return the pair of the renderer's scene, of which one eye is rendered whole; None stands for a reason."""
    known = _costs_of(renderer, renderer.scene)
    return render_stereo_frame(
        renderer, making.settings, findings=making.findings, watch=making.watch, known_costs=known
    ), None


class KeyFrames:
    """The key frames of an animation: each `distance`-th frame, counted from the scene's first, and the first one after
    a cut.

    A frame depends on its key frame and on no other, so it comes out the same wherever a run begins: a key frame that
    this run has not rendered is rendered for it. One key frame is held for each view layer.
    """

    def __init__(self, scene: bpy.types.Scene, distance: int) -> None:
        self._scene, self._distance = scene, distance
        self._kept: dict[str, _Kept] = {}

    def number_of(self, frame: int) -> int:
        """Return the number of the key frame of a frame: its own where it is one."""
        key = frame - (frame - self._scene.frame_start) % self._distance
        camera = camera_at(self._scene, frame)
        while key < frame and any(camera_at(self._scene, number) != camera for number in range(key, frame)):
            key += 1
        return key

    def prepare(self, making: Making, scenes: WorkingScenes, layer: str) -> None:
        """Render the eye of a frame's key frame, where that was not rendered by this run, and the frame is not one
        itself. Afterwards the scene may stand at another frame."""
        settings = making.settings
        frame = self._scene.frame_current if settings.scene.frame is None else settings.scene.frame
        number, kept = self.number_of(frame), self._kept.get(layer)
        if number == frame or (kept is not None and kept.key.number == number):
            return
        working = scenes.at(replace(settings.scene, frame=number), layer)
        if _why_never(working) is not None:
            return
        state = state_of(working)
        with renderer_of(working, making.work, user_scene=making.scene, packed_by=settings.packed_camera) as renderer:
            task = FrameTask.of_pair(renderer, settings, making.findings, _costs_of(renderer, working), making.watch)
            source = render_source(task, accuracy_of(settings), for_later=True)
            self._kept[layer] = _Kept(KeyFrame(number, source, dict(renderer.metadata)), state)

    def frame(self, renderer: BlenderRenderer, making: Making) -> tuple[StereoFrame, str | None]:
        """Return the pair, or the one view, of the renderer's scene in its frame, and why it was rendered whole, in
        words; None where it was made from its key frame."""
        working = renderer.scene
        layer, number = rendered_layer(working).name, working.frame_current
        why, kept = _why_never(working), self._kept.get(layer)
        state = None if why else state_of(working)
        tools = {"findings": making.findings, "watch": making.watch, "known_costs": _costs_of(renderer, working)}
        render_whole = render_whole_view if making.settings.scene.mono else render_stereo_frame
        if state is None:
            return render_whole(renderer, making.settings, **tools), why
        if self.number_of(number) == number:
            sources: list[Source] = []
            frame = render_whole(renderer, making.settings, **tools, on_source=sources.append)
            self._kept[layer] = _Kept(KeyFrame(number, sources[0], dict(renderer.metadata)), state)
            return frame, KEY_FRAME
        if kept is None or kept.key.number != self.number_of(number):
            return render_whole(renderer, making.settings, **tools), "its key frame could not be rendered"
        changed = renderer.fill_blockers()["packed"] or _since(kept, state, renderer)
        if isinstance(changed, str):
            return render_whole(renderer, making.settings, **tools), changed
        made = render_from_key(renderer, making.settings, kept.key, changed, **tools)
        if made is None:
            why = f"too little of it is seen in frame {kept.key.number}"
            return render_whole(renderer, making.settings, **tools), why
        return made, None


def _since(kept: _Kept, state: SceneState, renderer: BlenderRenderer) -> SinceKey | str:
    """Return what has changed in a renderer's scene, which is in this state, since the key frame; or, in words, why no
    frame can be made from that one."""
    working, key = renderer.scene, kept.key
    number = working.frame_current
    others = state.changed_since(kept.state)
    if others:
        return f"changed since frame {key.number}: {_listed(others)}"
    names = tuple(state.moved_since(kept.state))
    if not names:
        return SinceKey(number)
    now = shapes_of(working, names)
    if names not in kept.shapes:
        stand_at(working, key.number, 0.0)
        kept.shapes[names] = shapes_of(working, names)
        stand_at(working, number, 0.0)
    then = kept.shapes[names]
    if now is None or then is None:
        return f"changed since frame {key.number}, and has no surface of triangles: {_listed(list(names))}"
    boxes = [shape.box for shape in (*then, *now)]
    movers = {view: Movers(pixels_of_shapes(now, camera), boxes) for view, camera in renderer.cameras.items()}
    return SinceKey(number, movers, pixels_of_shapes(then, key.source.seen.camera))


def _costs_of(renderer: BlenderRenderer, working: bpy.types.Scene) -> Callable[[], TraceCosts]:
    """Return the function that returns the costs of tracing a working scene, as far as they are known."""
    return lambda: known_costs(working, renderer.packed_by)


def _listed(names: list[str]) -> str:
    """Return names as a short text."""
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _why_never(working: bpy.types.Scene) -> str | None:
    """Return why no frame of a working scene as it is can be made from another one, in words; None where some can."""
    render = working.render
    if render.engine != CYCLES:
        return "the scene renders with EEVEE"
    if working.camera is None or working.camera.data.type != "PERSP":
        return "the camera has no perspective"
    if working.camera.data.stereo.use_spherical_stereo:
        return "the camera has spherical stereo"
    if render.use_motion_blur and rendered_layer(working).use_motion_blur:
        return "motion blur"
    if has_time_limit(working):
        return "the render has a time limit"
    return None
