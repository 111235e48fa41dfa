"""The reference for a pair, in the same run: Blender's multiview, and its target eye once more with another seed. For
one view it is a plain render."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...images.exr import VIEWS
from ...images.metrics import (
    bias_sigmas,
    honest_ratio,
    noise_ratio,
    rmse,
    worst_tiles,
    wrong_tiles,
)
from ...images.seen_light import MIDDLE_GREY, display_scale, scaled_colour
from ...pipeline.stereo_frame import colour
from ...pipeline.stereo_pair import StereoPair
from ...report.as_json import ABSENT, Absent
from ...report.frame_report import CompareReport, EyeErrors
from ...settings.frame import StereoSettings
from ...views.solid_angle import PixelWeight, pixel_weights
from ...views.view import View
from ...warp.composite import replace_non_finite
from ..engines.render import render_views
from ..engines.renderer import shifted_seed
from ..output.delivery import deliver_side_by_side
from ..output.delivery_engine import Eyes
from ..output.pictures import read_png
from ..scene.rendered import CYCLES
from ..scene.rig import stereo_cameras
from ..scene.working import evaluated, rendered_layer, working_scene
from .compare_cutouts import SeenPictures, compare_cutouts, has_flip

REFERENCE_SEED_OFFSET = 3_000_017
"""Added to the scene's seed for multiview: noise that ours has must not be measured as agreement."""

REPEATED_SEED_OFFSET = 2_000_003
"""Added to the scene's seed for the second render of multiview's target eye, whose difference is noise alone."""


@dataclass(frozen=True)
class MultiviewReference:
    """A render by Blender's multiview, or of one view: the engine, the seconds for both eyes, the target eye (H, W, 4),
    and that eye once more with another seed. Pictures are scene-linear. light_scale is the number by which light is
    multiplied to be judged as it is seen. eyes are both eyes by view and view layer, if they were asked for.
    pixel_weight is that of the target's pixels (`views/solid_angle`), by which each counts in all measures. view is the
    target's; first is the same of the other eye, if it was asked for.
    """

    engine: str
    seconds: float
    reference: NDArray[np.float32]
    again: NDArray[np.float32]
    light_scale: float
    eyes: Eyes = field(default_factory=dict)
    pixel_weight: PixelWeight = 1.0
    view: View | None = None
    first: MultiviewReference | None = None

    @property
    def noise_rmse(self) -> float:
        """Root mean square difference between the target eye's two renders, which differ by noise alone."""
        return rmse(self._seen(self.again), self._seen(self.reference), self.pixel_weight)

    def judge(self, ours: NDArray[np.float32], variance_share: NDArray[np.float32]) -> dict[str, float]:
        """Return the errors of a target eye (H, W, 4) against multiview's, by the measures of `images/metrics`: "rmse",
        "noise_ratio", "bias", "honest_ratio", "worst_tiles" and "wrong_tiles". variance_share (H, W) is that of the
        frame.
        """
        ours, reference, again = self.three(ours)
        weight = self.pixel_weight
        honest = honest_ratio(ours, reference, again, variance_share, weight)
        return {
            "rmse": rmse(ours, reference, weight),
            "noise_ratio": noise_ratio(ours, reference, again, weight),
            "bias": bias_sigmas(honest),
            "honest_ratio": honest,
            "worst_tiles": worst_tiles(ours, reference, again, weight),
            "wrong_tiles": wrong_tiles(ours, reference, again, weight),
        }

    def three(self, ours: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Return a target eye (H, W, 4), multiview's and that with another seed, with their light as it is seen."""
        return self._seen(ours), self._seen(self.reference), self._seen(self.again)

    def _seen(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return a picture (H, W, 4) with its light as it is seen."""
        return scaled_colour(picture, self.light_scale)


def render_reference(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    folder: Path,
    *,
    layers: Sequence[str] | None = None,
    light_scale: float | None = None,
    keeps_eyes: bool = False,
    both: bool = False,
) -> MultiviewReference:
    """Render the pair by multiview, and its target eye once more with another seed. It is done in a scene copy of its
    own, which finds nothing that our render has synced, so that its seconds are those of a plain render. Of one view,
    they are those of a second render, which finds its scene synced, as in an animation with persistent data.

    layers are the view layers to render, by default the first alone; pictures are those of the first. light_scale is
    that of the pair to be judged, None for that of the reference itself. keeps_eyes: True if `eyes` is wanted; both:
    True if `first` is.
    """
    target, mono = settings.target, settings.scene.mono
    views = (target,) if mono else VIEWS
    with working_scene(scene, settings.scene) as copy:
        engine, seed = copy.render.engine, copy.cycles.seed
        main = rendered_layer(copy).name
        used = layers or [main]
        _use_layers(copy, used)
        kept, other = (used if keeps_eyes else ()), shifted_seed(seed, REFERENCE_SEED_OFFSET)
        repeated, judged = shifted_seed(seed, REPEATED_SEED_OFFSET), (target, settings.source) if both else (target,)
        synced = render_views(copy, views, folder, seed=repeated) if mono else None
        both_eyes = render_views(copy, views, folder, seed=other, layers=kept)
        cameras = stereo_cameras(evaluated(copy.camera, copy), copy.render)
        _use_layers(copy, [main])
        again = synced or render_views(copy, judged, folder, seed=repeated)
    eyes = {
        view: {name: replace_non_finite(passes)[0] for name, passes in of.items()}
        for view, of in both_eyes.layers.items()
    }

    def of_eye(view: str, **more: Any) -> MultiviewReference:
        reference, repeated = (colour(replace_non_finite(each.views[view])[0]) for each in (both_eyes, again))
        scale = display_scale(reference) if light_scale is None else light_scale
        weight = pixel_weights(cameras[view])
        where = View(view, cameras[view])
        return MultiviewReference(
            engine, both_eyes.seconds, reference, repeated, scale, pixel_weight=weight, view=where, **more
        )

    first = of_eye(settings.source) if both else None
    return of_eye(target, eyes=eyes if keeps_eyes else {}, first=first)


def _use_layers(scene: bpy.types.Scene, names: Sequence[str]) -> None:
    """Switch on the view layers of these names, with depth, and switch off all others."""
    for layer in scene.view_layers:
        layer.use = layer.name in names
        # Without it a pass is missing where a render is read.
        layer.use_pass_z = layer.use_pass_z or layer.use


def compare_with_multiview(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    pair: StereoPair,
    folder: Path,
    *,
    keeps_eyes: bool = False,
    both: bool = False,
) -> tuple[CompareReport, MultiviewReference]:
    """Render the same frame by multiview, and compare the pair with it. Return the `compare` part of the report, and
    multiview's render.

    Seconds are of all view layers; the picture that is judged is the main layer's, before any compositor. folder is
    private; keeps_eyes and both are as for `render_reference`. The first eye is judged where it was made, too. Of one
    view, all is against a plain render.
    """
    frame = pair.main_frame
    scale, layers, reused = frame.light_scale, list(pair.frames), frame.reused
    both = len(frame.eyes) > 1 and (both or reused is not None)
    multiview = render_reference(
        scene, settings, folder, layers=layers, light_scale=scale, keeps_eyes=keeps_eyes, both=both
    )
    seen, errors = _judged(
        scene, settings, colour(frame.eyes[settings.target]), frame.variance_share, multiview, folder
    )
    pictures = multiview.three(colour(frame.eyes[settings.target]))
    cutouts = compare_cutouts(frame.camera, pictures, frame.variance_share, seen, has_noise=errors.no_noise is ABSENT)
    first: EyeErrors | Absent = ABSENT
    if reused is not None and multiview.first is not None:
        ours = colour(frame.eyes[settings.source])
        _, first = _judged(scene, settings, ours, reused.variance_share, multiview.first, folder)
    report = CompareReport(
        multiview_seconds=multiview.seconds,
        speedup=multiview.seconds / pair.seconds["total"],
        noise_rmse=multiview.noise_rmse,
        **vars(errors),
        cutouts=cutouts or ABSENT,
        first_eye=first,
    )
    return report, multiview


def _judged(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    ours: NDArray[np.float32],
    variance_share: NDArray[np.float32],
    multiview: MultiviewReference,
    folder: Path,
) -> tuple[SeenPictures | None, EyeErrors]:
    """Return an eye of ours (H, W, 4) and multiview's as people see them, None where that cannot be had, and its
    errors. variance_share (H, W) is that of the eye."""
    seen = seen_pictures(scene, settings, ours, multiview, folder)
    flip, noise_flip = (None, None) if seen is None else seen.flips()
    errors = multiview.judge(ours, variance_share)
    no_noise = _why_no_noise(errors, multiview.engine)
    by_noise = {name: value if no_noise is ABSENT else None for name, value in errors.items() if name != "rmse"}
    ratio = flip / noise_flip if flip is not None and noise_flip and no_noise is ABSENT else None
    return seen, EyeErrors(
        rmse=errors["rmse"], **by_noise, no_noise=no_noise, flip=flip, noise_flip=noise_flip, flip_ratio=ratio
    )


def _why_no_noise(errors: Mapping[str, float], engine: str) -> str | Absent:
    """Return why the error cannot be held against multiview's noise, or `ABSENT` where it can."""
    if errors["rmse"] == 0.0 or (engine == CYCLES and math.isfinite(errors["noise_ratio"])):
        return ABSENT
    if engine != CYCLES:
        return "EEVEE renders the same noise each time, and has none to compare with"
    return "two plain renders are the same, without noise to compare with"


def over_grey(picture: NDArray[np.float32], grey: float) -> NDArray[np.float32]:
    """Return a scene-linear picture (H, W, 4), premultiplied by alpha, before an opaque background of this grey.

    FLIP knows no alpha, and before black nobody would see a black thing whose alpha is wrong.
    """
    result = picture.copy()
    result[..., :3] += grey * (1.0 - picture[..., 3:])
    result[..., 3] = 1.0
    return result


def flips(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    ours: NDArray[np.float32],
    multiview: MultiviewReference,
    folder: Path,
) -> tuple[float | None, float | None]:
    """Return the mean FLIP error of `ours` (H, W, 4) and of multiview's repeated render, each against the reference and
    with each pixel's weight; (None, None) where FLIP cannot be had. The pictures are compared as `seen_pictures` has
    them.
    """
    seen = seen_pictures(scene, settings, ours, multiview, folder)
    return (None, None) if seen is None else seen.flips()


def seen_pictures(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    ours: NDArray[np.float32],
    multiview: MultiviewReference,
    folder: Path,
) -> SeenPictures | None:
    """Return `ours` (H, W, 4) and multiview's renders as the scene's view transform shows them, over a middle grey
    where the film is transparent; None where FLIP, which they are for, cannot be had. folder is private.
    """
    if not has_flip():
        return None

    def seen(left: NDArray[np.float32], right: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """Two pictures as people see them, through the scene's view transform."""
        pair = folder / "seen.png"
        grey = MIDDLE_GREY / multiview.light_scale
        shown = {"left": over_grey(left, grey), "right": over_grey(right, grey)}
        deliver_side_by_side(scene, shown, pair, frame=settings.scene.frame)
        return [np.ascontiguousarray(half) for half in np.split(read_png(pair), 2, axis=1)]

    reference, again = seen(multiview.reference, multiview.again)
    return SeenPictures(seen(multiview.reference, ours)[1], reference, again, multiview.pixel_weight)
