"""Pictures denoised by Cycles' own denoiser, apart from any render: to the bit what it makes of a render of its own.

Cycles denoises files for whoever renders an animation first and denoises it afterwards. It takes a view layer's
settings, its device and its denoiser, OpenImageDenoise or OptiX, as it does after a render.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import BadInputError, StereoReprojectError
from ...images.exr import read_channels, write_channels
from ...images.passes import ALBEDO_PASS, COLOUR_PASS, NOISY_PASS, NORMAL_PASS, Passes
from ...jobs.memory import give_back_freed
from ...words import Words
from ..scene.working import changed, rendered_layer

NOISY, ALBEDO, NORMAL, DEPTH = "Noisy Image", "Denoising Albedo", "Denoising Normal", "Denoising Depth"

GUIDES = (NOISY, ALBEDO, NORMAL, DEPTH, "Denoising Specular Albedo", "Denoising Roughness")
"""All that Blender adds to a render for the sake of denoising it."""

CHANNELS = ((NOISY_PASS, COLOUR_PASS, "RGB"), (ALBEDO_PASS, ALBEDO, "RGB"), (NORMAL_PASS, NORMAL, "XYZ"))
"""The passes that are denoised or guide it: by our name, by Blender's, and their channels."""


def denoise_pictures(scene: bpy.types.Scene, pictures: Sequence[Passes], folder: Path) -> list[NDArray[np.float32]]:
    """Return the colours (H, W, 3), scene-linear, of pictures of one size without their noise, as `denoising.Denoise`
    says.

    scene is a working scene that Cycles renders, and says which denoiser is used; folder is private. Raises
    StereoReprojectError.
    """
    layer = rendered_layer(scene)
    with tempfile.TemporaryDirectory(dir=folder) as own, changed(scene.cycles, use_denoising=True):
        before, after = Path(own) / "noisy.exr", Path(own) / "clean.exr"
        channels, texts = _as_layers(pictures)
        write_channels(before, channels, texts)
        # The denoiser takes several times as much memory as these, and has them from the file.
        del channels
        give_back_freed()
        override = bpy.context.temp_override(scene=scene, view_layer=layer)
        try:
            with override:  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
                bpy.ops.cycles.denoise_animation(input_filepath=str(before), output_filepath=str(after))
        except RuntimeError as error:
            raise _failed(" ".join(str(error).split())) from error
        if not after.exists():
            raise BadInputError("the denoiser gave nothing back: is the disk full?")
        clean = read_channels(after)
    return [_of_layer(clean, name) for name in map(_layer_name, range(len(pictures)))]


def _failed(reason: str) -> StereoReprojectError:
    """Return the error to be raised for a denoiser that failed with these words; where they are about a file, it asks
    whether the disk is full.
    """
    if "file" in reason.lower():
        return BadInputError(
            Words("the denoiser cannot pass its pictures on ({reason}): is the disk full?", reason=reason)
        )
    return StereoReprojectError(Words("the denoiser failed: {reason}", reason=reason))


def _layer_name(number: int) -> str:
    """Return the name of the view layer that the picture of this number has in the denoiser's file."""
    return f"Picture{number}"


def _as_layers(pictures: Sequence[Passes]) -> tuple[dict[str, NDArray], dict[str, str]]:
    """Return the channels of a file in which each picture is a view layer, and the texts of its header that Cycles
    needs.

    Rows are turned over, since Cycles' first row is the lowest. A Vector pass of zeros is added, which Cycles asks for
    and does not use here.
    """
    channels: dict[str, NDArray] = {}
    texts: dict[str, str] = {}
    for number, picture in enumerate(pictures):
        name = _layer_name(number)
        for ours, theirs, letters in CHANNELS:
            for k, letter in enumerate(letters):
                channels[f"{name}.{theirs}.{letter}"] = np.ascontiguousarray(picture[ours][::-1, :, k], np.float32)
        nothing = np.zeros(picture[NOISY_PASS].shape[:2], np.float32)
        channels.update({f"{name}.Vector.{letter}": nothing for letter in "XYZW"})
        texts[f"cycles.{name}.samples"] = "1"
    return channels, texts


def _of_layer(channels: dict[str, NDArray[np.float32]], name: str) -> NDArray[np.float32]:
    """Return the colours (H, W, 3) of one of the view layers in the denoiser's file, row 0 at the top."""
    return np.stack([channels[f"{name}.{COLOUR_PASS}.{letter}"] for letter in "RGB"], axis=-1)[::-1]


def guided_by(passes: Passes) -> Passes:
    """Return the passes of a render with those that `images/denoising` needs added, under our names: the noisy colour,
    albedo and normal. Blender's name for that colour is added to its own passes for the denoiser.

    Raises BadInputError where one of them is missing, which is how a full disk shows.
    """
    if not {ALBEDO, NORMAL, DEPTH} <= set(passes):
        raise BadInputError("the render result has nothing to guide the denoiser: is the disk full?")
    ours = {NOISY_PASS: passes[COLOUR_PASS], ALBEDO_PASS: passes[ALBEDO], NORMAL_PASS: passes[NORMAL]}
    return {**passes, **ours, NOISY: passes[COLOUR_PASS]}
