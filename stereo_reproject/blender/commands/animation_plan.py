"""The plan of an animation: which frames are to be rendered by the settings and the scene as they are.

The user is told of it before anything is rendered.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from itertools import count
from pathlib import Path

import bpy

from ...errors import BadInputError
from ...pipeline.stages import Stage
from ...sequence.fingerprints import Fingerprints, FrameState, digest
from ...sequence.frames import FramePlan, plan_frames
from ...sequence.journal import Journal
from ...sequence.progress import Listener
from ...settings.animation import AnimationSettings, spelled
from ...settings.frame import SceneOverrides, StereoSettings
from ...words import Words
from ..output.animation_output import Output
from ..scene.fingerprint import scene_fingerprints
from ..scene.rendered import scene_frames
from ..scene.working import changed

ANNOUNCED_FRAMES = 20_000
"""Number of frames from which the user is told that they are planned, since that takes seconds."""


def announce_planning(scene: bpy.types.Scene, options: AnimationSettings, listener: Listener) -> None:
    """Tell the listener that planning begins; for a very long animation also that it takes a moment."""
    listener.on_stage(Stage.PLAN, "")
    frames = scene_frames(scene) if options.frames is None else options.frames
    if len(frames) >= ANNOUNCED_FRAMES and not options.goes_on:
        listener.note(f"plans {len(frames)} frames, which takes a moment")


def settings_digest(settings: StereoSettings, output: Output, *, reuse: int | None = None) -> str:
    """Return a digest of the settings on which a frame's files depend, the number of the frame and `compare` left
    out. reuse is that of the animation's settings.
    """
    fields = asdict(replace(settings, compare=False, scene=replace(settings.scene, frame=None)))
    if not settings.scene.mono:
        # Pairs of earlier versions are pairs of this one.
        del fields["scene"]["mono"]
    made = {} if reuse is None else {"reuse": reuse}
    return digest({"settings": fields, "output": output.values, **made})


def scene_prints(scene: bpy.types.Scene, overrides: SceneOverrides) -> dict[str, str]:
    """Return the scene's fingerprints: a digest for each kind of datablock, and the version of Blender, since another
    one renders another picture. Values that the overrides replace (size, samples, seed) do not count: the overrides are
    in the digest of the settings.
    """
    with ExitStack() as changes:
        if overrides.size is not None:
            size = {"resolution_x": 1920, "resolution_y": 1080, "resolution_percentage": 100}
            changes.enter_context(changed(scene.render, **size))
        if overrides.samples is not None:
            changes.enter_context(changed(scene.cycles, samples=1))
            changes.enter_context(changed(scene.eevee, taa_render_samples=1))
            for layer in scene.view_layers:
                changes.enter_context(changed(layer, samples=0))
        if overrides.seed is not None:
            changes.enter_context(changed(scene.cycles, seed=0))
        prints = scene_fingerprints(scene)
    return {"Blender": ".".join(map(str, bpy.app.version[:2])), **prints}


def planned_frames(
    journal: Journal,
    output: Output,
    wanted: Fingerprints,
    options: AnimationSettings,
    listener: Listener,
    *,
    files: Mapping[int, Sequence[Path]],
    movies_are_there: bool,
) -> FramePlan:
    """Look at the files of all frames, and return which are to be rendered and which are kept.

    files are all that belong to each frame. movies_are_there: True if no movie is left to be made. Raises BadInputError
    if Overwrite is off and there is nothing to do.
    """
    untouched = {*options.skip, *options.finished}
    files = {frame: paths for frame, paths in files.items() if frame not in untouched}
    looked = count(1)
    plan = plan_frames(
        journal,
        files,
        wanted,
        options.existing,
        on_look=lambda _: listener.on_stage(Stage.PLAN, f"{next(looked)} of {len(files)} frames looked at"),
    )
    if options.existing == "keep" and not plan.todo and not options.goes_on and movies_are_there:
        there = output.all_files[0]
        raise BadInputError(
            Words("{there} and all others are there already: switch on Overwrite in Output", there=there)
        )
    return plan


def announce_plan(plan: FramePlan, options: AnimationSettings, listener: Listener) -> None:
    """Tell the listener which frames are there, which are rendered, and which are rendered again for what reason."""
    by_state: dict[FrameState, list[int]] = {}
    for frame, state in plan.todo.items():
        by_state.setdefault(state, []).append(frame)
    if plan.kept and not options.goes_on:
        listener.note(f"{len(plan.kept)} of {len(plan.kept) + len(plan.todo)} frames are there already")
        if FrameState.MISSING in by_state:
            listener.note(f"to be rendered: {spelled(by_state[FrameState.MISSING])}")
    for state in (FrameState.DAMAGED, FrameState.UNKNOWN, FrameState.OTHER_SETTINGS):
        if options.existing != "overwrite" and state in by_state:
            listener.note(f"rendered again, for being {state.value}: {spelled(by_state[state])}")
    others = [frame for frame, state in plan.kept.items() if state is not FrameState.WHOLE]
    if others:
        listener.warn(
            f"kept, for Overwrite is off, though not of the scene and settings as they are: {spelled(others)}"
        )
