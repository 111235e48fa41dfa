"""How far the GPU of a Blender with a window is from numpy. drive.py imports it, inside that Blender."""

import numpy as np

from stereo_reproject.blender.gpu import warp as gpu_warp
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.warp.warper import warp_view
from tests.bench.warp.scenes import eyes, room
from tests.bench.warp.settings import MODES
from tests.warp.pairs import reproject_pair

SIZE = (480, 270)


def agreement():
    """By the mode of the eyes: who carried, the share of the mask that differs, and the largest difference of a colour.

    "device" names the GPU. The eyes see a synthetic room.
    """
    found = {"device": gpu_warp.usable()}
    passes, invalid = room(*SIZE), np.zeros(SIZE[::-1], bool)
    for mode in MODES:
        options = {"accuracy": SETTINGS["balanced"], "invalid": invalid}
        ours, numpys = (
            reproject_pair(passes, *eyes(*SIZE, mode), how=carrier, **options)
            for carrier in (gpu_warp.warp_view, warp_view)
        )
        told = (ours.reasons == 0) & (numpys.reasons == 0)
        apart = np.abs(ours.passes["Combined"] - numpys.passes["Combined"])[told]
        found[mode] = {
            "by": ours.warped_by,
            "told": float(told.mean()),
            "mask": float(np.mean((ours.reasons != 0) != (numpys.reasons != 0))),
            "colour": float(apart.max()),
        }
    return found
