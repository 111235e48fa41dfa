"""A picture denoised by Blender's own OpenImageDenoise, as Cycles does it after a render."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..errors import StereoReprojectError
from ..exr import read_channels, write_channels
from .scene import changed, rendered_layer

ALBEDO, NORMAL = "Denoising Albedo", "Denoising Normal"


def denoise(
    scene: bpy.types.Scene, colour: NDArray, guides: Mapping[str, NDArray] | None, folder: Path
) -> NDArray[np.float32]:
    """colour (H, W, 3), scene-linear, without its noise.

    scene is a Cycles scene that `working_scene` set up. guides hold ALBEDO and NORMAL, (H, W, 3) each, where they are
    known. Raises StereoReprojectError.
    """
    layer = rendered_layer(scene)
    height, width = colour.shape[:2]
    nothing = np.zeros((height, width, 3), np.float32)
    passes = {"Combined": colour, ALBEDO: nothing, NORMAL: nothing, **(guides or {})}
    # Cycles denoises its buffers, whose first row is the lowest, and looks for passes that it has no use for.
    channels = {
        f"{layer.name}.{name}.{letter}": np.ascontiguousarray(image[::-1, :, k], np.float32)
        for name, image in passes.items()
        for k, letter in enumerate("XYZ" if name == NORMAL else "RGB")
    }
    channels |= {f"{layer.name}.Vector.{letter}": nothing[..., 0] for letter in "XYZW"}
    inputs = "RGB_ALBEDO_NORMAL" if guides else "RGB"
    with (
        tempfile.TemporaryDirectory(dir=folder) as own,
        changed(
            scene.cycles,
            use_denoising=True,
            denoiser="OPENIMAGEDENOISE",
            denoising_input_passes=inputs,
            denoising_prefilter="ACCURATE",
        ),
    ):
        before, after = Path(own) / "noisy.exr", Path(own) / "clean.exr"
        write_channels(before, channels, {f"cycles.{layer.name}.samples": "1"})
        override = bpy.context.temp_override(scene=scene, view_layer=layer)
        try:
            with override:  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
                bpy.ops.cycles.denoise_animation(input_filepath=str(before), output_filepath=str(after))
        except RuntimeError as error:
            raise StereoReprojectError(f"Blender's denoiser failed: {' '.join(str(error).split())}") from error
        clean = read_channels(after)
    return np.stack([clean[f"{layer.name}.Combined.{letter}"] for letter in "RGB"], axis=-1)[::-1]
