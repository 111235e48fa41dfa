"""The reference for many views, in the same run: both ends and a view between them, rendered plainly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...estimate.flicker import Neighbours, flicker_ratio
from ...images.passes import COLOUR_PASS, DEPTH_PASS, Passes, known_depth
from ...images.seen_light import scaled_colour
from ...pipeline.stereo_frame import colour
from ...pipeline.views_maker import FinishedView
from ...report.views_report import ViewsCompareReport
from ...settings.frame import StereoSettings
from ...trace.fill import SourceCost
from ...views.camera import Camera
from ...views.view import View
from ...warp.composite import replace_non_finite
from ..engines.render import Rendered, render_views
from ..engines.renderer import cost_of, shifted_seed
from ..output.view_files import ViewFiles
from ..scene.view_cameras import file_name_of
from ..scene.working import working_scene
from .compare import REFERENCE_SEED_OFFSET, REPEATED_SEED_OFFSET, MultiviewReference, flips
from .view_rigs import ViewRig


@dataclass
class PlainViews:
    """Finished views as a comparison needs them: their cameras, and the one that is compared.

    rig has the cameras as the scene has them, and cameras has them by the views' names, as they were rendered; layer is
    the view layer, and folder that of the views' files. light_scale is the number by which light is multiplied to be
    judged as it is seen. Of all views that one is compared which stands farthest from those it was made from; of equal
    ones, that which is nearest to the middle. Where none was made, it is one that was rendered, with noise of its own.
    """

    rig: ViewRig
    cameras: Mapping[str, Camera]
    layer: str
    folder: Path
    light_scale: float = 1.0
    chosen: FinishedView | None = None
    _rank: tuple[float, float] = field(default=(0.0, 0.0))

    def add(self, view: FinishedView) -> None:
        """Note a finished view."""
        names = self.rig.made
        numbers = [names.index(name) for name in view.sources]
        away = min((abs(view.number - number) for number in numbers), default=0)
        rank = away, -abs(view.number - 0.5 * (len(names) - 1))
        if self.chosen is None or rank > self._rank:
            self.chosen, self._rank = replace(view, passes={COLOUR_PASS: view.passes[COLOUR_PASS]}), rank


def compare_views(
    scene: bpy.types.Scene, settings: StereoSettings, made: PlainViews, seconds: float, work: Path
) -> ViewsCompareReport:
    """Render both ends and the chosen view plainly, in a scene copy of their own that finds nothing synced, and
    compare. seconds are those of our views in total."""
    names, chosen = made.rig.made, made.chosen
    assert chosen is not None
    between = chosen.name
    compared = tuple(dict.fromkeys((names[0], between, names[-1])))
    with working_scene(scene, settings.scene, layer=made.layer) as copy:
        with made.rig.standing(copy) as standing_at:

            def plainly(name: str, seed_offset: int) -> tuple[NDArray[np.float32], SourceCost]:
                with standing_at(name) as eye:
                    return _plain(copy, eye, seed_offset, work)

            plain = {name: plainly(name, REFERENCE_SEED_OFFSET) for name in compared}
            again, _ = plainly(between, REPEATED_SEED_OFFSET)
            flicker = None
            if chosen.origins is None:
                beside = _neighbour(between, names)
                with standing_at(beside) as eye:
                    # With the same seed, both have one noise where they show the same in the same pixel.
                    neighbour = _rendered(copy, eye, REPEATED_SEED_OFFSET, work).views[eye]
                flicker = _flicker(made, beside, plain[between][0], neighbour)
        engine = copy.render.engine
    costs = [cost for _, cost in plain.values()]
    all_seconds = costs[0].sync_seconds + len(names) * float(np.mean([cost.per_frame for cost in costs]))
    reference = MultiviewReference(engine, all_seconds, plain[between][0], again, made.light_scale)
    ours, share = chosen.passes[COLOUR_PASS], chosen.variance_share
    errors = reference.judge(ours, share)
    flip, noise_flip = flips(scene, settings, ours, reference, work)
    return ViewsCompareReport(
        views=compared,
        plain_seconds=all_seconds,
        speedup=all_seconds / seconds,
        **{name: value for name, value in errors.items() if name != "rmse"},
        flicker_ratio=flicker,
        flip=flip,
        noise_flip=noise_flip,
        flip_ratio=flip / noise_flip if flip is not None and noise_flip else None,
    )


def _plain(scene: bpy.types.Scene, eye: str, seed_offset: int, work: Path) -> tuple[NDArray[np.float32], SourceCost]:
    """Return the colour (H, W, 4) of an eye as Blender renders it, and what that has cost."""
    rendered = _rendered(scene, eye, seed_offset, work)
    return colour(replace_non_finite(rendered.views[eye])[0]), cost_of(rendered)


def _rendered(scene: bpy.types.Scene, eye: str, seed_offset: int, work: Path) -> Rendered:
    """Render one eye of a scene as Blender does."""
    return render_views(scene, (eye,), work, seed=shifted_seed(scene.cycles.seed, seed_offset))


def _neighbour(name: str, names: Sequence[str]) -> str:
    """Return the name of a neighbour of one of these views, which are in order."""
    number = names.index(name)
    return names[number + 1 if number + 1 < len(names) else number - 1]


def _flicker(made: PlainViews, name: str, plain: NDArray[np.float32], neighbour: Passes) -> float | None:
    """Return the flicker between the chosen view and a finished one of this name, its neighbour, over that between
    plain renders of both: the colour (H, W, 4) of the one, and the passes of the other."""
    chosen = made.chosen
    assert chosen is not None
    finished = ViewFiles(made.folder, [file_name_of(name)])[0]
    passes = replace_non_finite(neighbour)[0]

    def pair(one: NDArray[np.float32], other: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        return scaled_colour(one, made.light_scale), scaled_colour(other, made.light_scale)

    return flicker_ratio(
        Neighbours(
            View(chosen.name, made.cameras[chosen.name]),
            View(name, made.cameras[name]),
            known_depth(passes[DEPTH_PASS])[..., 0],
            pair(chosen.passes[COLOUR_PASS], finished),
            pair(plain, colour(passes)),
        )
    )
