"""How far the GPU of a Blender with a window is from numpy. drive.py imports it, inside that Blender."""

import importlib

import numpy as np

SIZE = (480, 270)


def agreement(package):
    """By the mode of the eyes: who carried, the share of the mask that differs, and the largest difference of a colour.

    package is what the extension's engine is called in there; it names the GPU, and takes the room of bench-warp.
    """

    def module(name):
        return importlib.import_module(f"{package}.{name}")

    gpu_warp, made_up = module("blender.gpu.warp"), module("jobs.made_up")
    found = {"device": gpu_warp.usable()}
    passes, invalid = made_up.room(*SIZE), np.zeros(SIZE[::-1], bool)
    for mode in module("jobs.bench").MODES:
        options = {"accuracy": module("settings.accuracy").SETTINGS["balanced"], "invalid": invalid}
        ours, numpys = (
            module("holes.reprojection").reproject(passes, *made_up.eyes(*SIZE, mode), carry=carry, **options)
            for carry in (gpu_warp.carry, module("warp.carrying").carry)
        )
        told = (ours.reasons == 0) & (numpys.reasons == 0)
        apart = np.abs(ours.passes["Combined"] - numpys.passes["Combined"])[told]
        found[mode] = {
            "by": ours.carried_by,
            "told": float(told.mean()),
            "mask": float(np.mean((ours.reasons != 0) != (numpys.reasons != 0))),
            "colour": float(apart.max()),
        }
    return found
