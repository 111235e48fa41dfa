"""A scene with a time limit: its source is rendered with it, and its holes with the samples that the source came to.

Cycles gives the whole limit to each view and each view layer (and to each tile of a picture beyond its tile size), so
plain multiview has it for each eye. For the few pixels of a packed picture it would never end: they would be traced
with all samples, which is neither what the source has nor what was asked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ...images.passes import Passes, cryptomatte_of
from ...images.sample_count import sample_count
from ..scene.cryptomatte import switch_on_cryptomatte
from ..scene.rendered import CYCLES
from ..scene.rig import frame_region
from ..scene.working import changed, rendered_layer
from .render import Rendered, cycles_seconds

COUNTS = "Debug Sample Count"
ADDED_COUNTS = "stereo_reproject_sample_count"
"""Property of a working scene's view layer that marks its sample count as not asked for by the user."""

HEADER_ROUNDING_SECONDS = 0.02
"""Error of the seconds in a file's header, which have two decimals."""

MIN_ADAPTIVE_THRESHOLD = 0.001
"""Threshold of adaptive sampling, at least, where Cycles chooses it by the number of samples."""

UNCOUNTED = "the time limit ended the source after a number of samples that cannot be told"
TILED = "the time limit ends each tile of a large picture after samples of its own"


def has_time_limit(scene: bpy.types.Scene) -> bool:
    """Return whether the scene is rendered by Cycles with a time limit."""
    return scene.render.engine == CYCLES and scene.cycles.time_limit > 0.0


def count_samples(scene: bpy.types.Scene) -> None:
    """Switch on the passes from which `samples_rendered` tells the number of samples, for all later renders of a
    working scene.
    """
    switch_on_cryptomatte(scene)
    layer = rendered_layer(scene)
    if scene.cycles.use_adaptive_sampling and not layer.cycles.pass_debug_sample_count:
        layer.cycles.pass_debug_sample_count = layer[ADDED_COUNTS] = True


def without_counts(scene: bpy.types.Scene, passes: Passes) -> Passes:
    """Return the passes of a render without the sample count, unless the user has asked for it."""
    added = ADDED_COUNTS in rendered_layer(scene)
    return {name: image for name, image in passes.items() if not (added and name == COUNTS)}


def samples_rendered(scene: bpy.types.Scene, rendered: Rendered, view: str) -> int | None:
    """Return the samples per pixel that a render with a time limit came to; None where they cannot be told. If the
    limit was not reached, they are those that were asked for.
    """
    name = rendered_layer(scene).name
    asked = _of_subset(scene.cycles, int(rendered.attributes.get(f"cycles.{name}.samples", scene.cycles.samples)))
    if cycles_seconds(rendered.attributes, name, "render") < scene.cycles.time_limit - HEADER_ROUNDING_SECONDS:
        return asked
    if is_tiled(scene):
        return None
    passes = rendered.views[view]
    levels = [image[..., 1::2] for key, image in sorted(passes.items()) if cryptomatte_of(key)]
    return sample_count(np.concatenate(levels, axis=-1), passes.get(COUNTS), asked) if levels else None


def is_tiled(scene: bpy.types.Scene) -> bool:
    """Return whether Cycles renders the scene's picture in several tiles, which it does beyond its tile size."""
    region = frame_region(scene.render)
    return scene.cycles.use_auto_tile and max(region.width, region.height) > scene.cycles.tile_size


def why_uncounted(scene: bpy.types.Scene) -> str:
    """Return why the samples of a render that its time limit has ended cannot be told, in words."""
    return TILED if is_tiled(scene) else UNCOUNTED


def _of_subset(cycles: bpy.types.PropertyGroup, samples: int) -> int:
    """Return how many of `samples` are rendered: all, or as many as the user's sample subset has of them."""
    if not cycles.use_sample_subset:
        return samples
    return max(min(cycles.sample_offset + cycles.sample_subset_length, samples) - cycles.sample_offset, 0)


@contextmanager
def without_time_limit(scene: bpy.types.Scene, samples: int | None) -> Iterator[None]:
    """Have a scene rendered without its time limit but with so many samples, for the time of a `with` block; its
    settings are restored afterwards. None leaves the number as it is.

    They are the first of the samples that the scene asks for: a pixel gets, to the bit, what it would have if the limit
    had ended the render then.
    """
    cycles = scene.cycles
    values: dict[str, float | int | bool] = {"time_limit": 0.0}
    if samples is not None:
        first = cycles.sample_offset if cycles.use_sample_subset else 0
        values |= {"use_sample_subset": True, "sample_offset": first, "sample_subset_length": samples}
        values["adaptive_threshold"] = _threshold(cycles, samples_asked_for(scene, rendered_layer(scene)), samples)
    with changed(cycles, **values):
        yield


def samples_asked_for(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> int:
    """Return the samples that a view layer asks Cycles for: its own number where it counts, else the scene's."""
    cycles, own = scene.cycles, layer.samples
    if own <= 0 or cycles.use_layer_samples == "IGNORE":
        return cycles.samples
    return min(own, cycles.samples) if cycles.use_layer_samples == "BOUNDED" else own


def _threshold(cycles: bpy.types.PropertyGroup, asked: int, samples: int) -> float:
    """Return a threshold of adaptive sampling with which a subset of so many samples stops a pixel where the whole
    number `asked` would. Cycles lowers the threshold for a subset, by the root of its share of the samples; this makes
    up for it.
    """
    threshold = cycles.adaptive_threshold or max(MIN_ADAPTIVE_THRESHOLD, 1.0 / asked)
    before = max(_of_subset(cycles, asked), 1)
    return min(threshold * math.sqrt(before / min(samples, before)), 1.0)
