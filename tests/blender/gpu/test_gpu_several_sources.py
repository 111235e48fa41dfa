"""Several sources, each warped by the GPU: the target is the one that NumPy makes of them."""

from __future__ import annotations

import bpy  # noqa: F401 - there is no gpu before it
import numpy as np
import pytest

from stereo_reproject.blender.gpu import warp as gpu_warp
from stereo_reproject.holes.reprojection import reproject
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.warp.warper import NUMPY, Warper
from tests.blender.gpu.gpu_cases import APART, HAS_GPU, SAME_COLOURS, SAME_MASK, SAME_PLACE
from tests.warp.sources import CAMERAS, ROOM, sources_of

GPU = Warper(gpu_warp.warp_view, "GPU")

FEWEST = 2
"""Pixels of these small pictures on which rounding may decide otherwise, if APART of them are fewer."""


def allowed(share, mask):
    return max(share, FEWEST / mask.size)


@pytest.mark.parametrize("kind", CAMERAS)
def test_it_is_what_numpy_makes_of_them(kind, dispatched):
    target, sources = sources_of(kind)
    for number, source in enumerate(sources):
        source.passes["Combined"][...] = ROOM.render(source.camera)["Combined"] + number
    ours, numpys = (reproject(sources, target, SETTINGS["balanced"], warper=warper) for warper in (GPU, NUMPY))
    assert ours.warped_by == ("gpu" if HAS_GPU else "numpy")
    assert bool(dispatched) == HAS_GPU
    there = ours.warp.covered & numpys.warp.covered
    same_source = ours.warp.source == numpys.warp.source
    assert np.mean(there & ~same_source) <= allowed(APART, there)
    assert np.mean(ours.warp.covered != numpys.warp.covered) <= allowed(APART, there)
    assert np.mean((ours.reasons != 0) != (numpys.reasons != 0)) <= allowed(SAME_MASK, there)
    for axis in ("x", "y"):
        apart = np.abs(getattr(ours.warp, axis) - getattr(numpys.warp, axis))
        assert np.mean(there & same_source & ~(apart <= SAME_PLACE)) <= allowed(APART, there)
    kept = (ours.reasons == 0) & (numpys.reasons == 0) & same_source
    assert kept.mean() > 0.5
    assert np.abs(ours.passes["Combined"] - numpys.passes["Combined"])[kept].max() <= SAME_COLOURS
