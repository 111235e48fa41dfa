"""The key frames of an animation whose other frames are made from them: which they are, and what has changed since."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ...pipeline.frame import render_stereo_frame
from ...pipeline.key_frames import KeyFrame, render_from_key
from ...pipeline.shared_findings import SharedFindings
from ...pipeline.source import Source, render_source
from ...pipeline.stereo_frame import StereoFrame
from ...pipeline.stopwatch import Stopwatch
from ...pipeline.task import FrameTask
from ...settings.accuracy import accuracy_of
from ...settings.frame import StereoSettings
from ...trace.costs import TraceCosts
from ..engines.eevee import renderer_of
from ..engines.renderer import BlenderRenderer
from ..engines.time_limit import has_time_limit
from ..scene.changes import SceneState, state_of
from ..scene.rendered import CYCLES, camera_at
from ..scene.working import WorkingScenes, rendered_layer
from .known_costs import known_costs


@dataclass(frozen=True)
class _Kept:
    """A key frame, and the state of the scene in it."""

    key: KeyFrame
    state: SceneState


@dataclass(frozen=True)
class Making:
    """What the frames of one view layer are rendered by: the user's scene, the settings of this frame, a private
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
            source = render_source(task, accuracy_of(settings))
            self._kept[layer] = _Kept(KeyFrame(number, source, dict(renderer.metadata)), state)

    def frame(self, renderer: BlenderRenderer, making: Making) -> tuple[StereoFrame, str | None]:
        """Return the pair of the renderer's scene in its frame, and why it was rendered whole, in words; None where it
        was made from its key frame."""
        working = renderer.scene
        layer, number = rendered_layer(working).name, working.frame_current
        state = None if _why_never(working) else state_of(working)
        why, kept = self._why_whole(working, layer, state), self._kept.get(layer)
        tools = {"findings": making.findings, "watch": making.watch, "known_costs": _costs_of(renderer, working)}
        if why is None and kept is not None:
            return render_from_key(renderer, making.settings, kept.key, number, **tools), None
        if state is None or self.number_of(number) != number:
            return render_stereo_frame(renderer, making.settings, **tools), why
        sources: list[Source] = []
        frame = render_stereo_frame(renderer, making.settings, **tools, on_source=sources.append)
        self._kept[layer] = _Kept(KeyFrame(number, sources[0], dict(renderer.metadata)), state)
        return frame, why

    def _why_whole(self, working: bpy.types.Scene, layer: str, state: SceneState | None) -> str | None:
        """Return why the frame of a working scene in this state is rendered whole, in words; None where it is not."""
        never, kept = _why_never(working), self._kept.get(layer)
        if never is not None:
            return never
        number = self.number_of(working.frame_current)
        if number == working.frame_current:
            return "a key frame"
        if kept is None or kept.key.number != number or state is None:
            return "its key frame could not be rendered"
        changed = [*state.changed_since(kept.state), *state.moved_since(kept.state)]
        return f"changed since frame {number}: {_listed(changed)}" if changed else None


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
