"""Arrays sent to the GPU and back, and shaders run on them: the part of the gpu module that the warp needs."""

from __future__ import annotations

import atexit
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache

import gpu
import numpy as np
from numpy.typing import NDArray

from .shaders import CONSTANTS, IMAGES, PROGRAMS, compile_program

Constant = int | float | tuple[int, ...] | tuple[float, ...]


class NoRoomError(RuntimeError):
    """A texture that cannot be had: the GPU's memory is full, or this thread may not use it."""


@cache
def shader(name: str) -> gpu.types.GPUShader:
    """Return one of `shaders.PROGRAMS` by its name, compiled when it is first needed."""
    return compile_program(PROGRAMS[name])


# A shader that outlives Blender's GPU takes the process down with it. Blender as a module leaves by this way, too, and
# whoever came last goes first.
atexit.register(shader.cache_clear)


def fold(width: int, height: int, texels: int) -> tuple[int, int] | None:
    """Return texels in a line, and lines in a row, of a texture that holds a picture of so many texels a pixel.

    None where no texture is large enough.
    """
    limit, row = gpu.capabilities.max_texture_size_get(), width * texels
    for lines in range(-(-row // limit), limit // height + 1):
        if row % lines == 0:
            return row // lines, lines
    return None


def uploaded(values: NDArray[np.float32], size: tuple[int, int], *, lanes: int = 1) -> gpu.types.GPUTexture:
    """Return a texture of size (width, height), of 1 or 4 floats (lanes) a texel, that holds the values."""
    flat = np.ascontiguousarray(values, np.float32).ravel()
    return _texture(size, "R32F" if lanes == 1 else "RGBA32F", gpu.types.Buffer("FLOAT", flat.size, flat))


def downloaded(texture: gpu.types.GPUTexture) -> NDArray:
    """Return the values (height, width) or (height, width, 4) of a texture, float32 or uint32 as it holds them.

    Blender reads no signed integers. Nothing is copied.
    """
    return np.asarray(texture.read())


@dataclass
class ShaderRun:
    """The constants of one warp's shaders, and the textures that they hand each other.

    A texture "x" is read by shaders as "x_map" and written as "x_image".
    """

    constants: dict[str, Constant]
    textures: dict[str, gpu.types.GPUTexture] = field(default_factory=dict)

    def create(self, name: str, size: tuple[int, int], *, fill: int | None = None) -> gpu.types.GPUTexture:
        """Return a new texture of size (width, height), to be written by shaders."""
        kind, access, _ = IMAGES[f"{name}_image"]
        texture = _texture(size, kind)
        if fill is not None:
            texture.clear(format=access.partition("_")[0], value=(fill,))
        self.textures[name] = texture
        return texture

    def drop(self, *names: str) -> None:
        """Free the memory of textures that are not needed any more."""
        for name in names:
            self.textures.pop(name, None)

    def run(self, name: str, size: tuple[int, int], *, layers: int = 1, **constants: Constant) -> None:
        """Run the shader of this name once for each of (width, height) places, in each of so many layers.

        constants take the place of the run's own.
        """
        program, compiled = PROGRAMS[name], shader(name)
        compiled.bind()
        for sampler in program.samplers:
            compiled.uniform_sampler(sampler, self.textures[sampler.removesuffix("_map")])
        for image in program.images:
            compiled.image(image, self.textures[image.removesuffix("_image")])
        _set_constants(compiled, {key: ({**self.constants, **constants})[key] for key in program.constants})
        groups_x, groups_y = (-(-length // group) for length, group in zip(size, program.group, strict=True))
        gpu.compute.dispatch(compiled, groups_x, groups_y, layers)


def _set_constants(compiled: gpu.types.GPUShader, constants: Mapping[str, Constant]) -> None:
    for name, value in constants.items():
        if CONSTANTS[name].startswith("I"):
            compiled.uniform_int(name, value)
        else:
            compiled.uniform_float(name, value)


def _texture(size: tuple[int, int], kind: str, data: gpu.types.Buffer | None = None) -> gpu.types.GPUTexture:
    try:
        if data is None:
            return gpu.types.GPUTexture(size, format=kind)
        return gpu.types.GPUTexture(size, format=kind, data=data)
    except RuntimeError as error:
        raise NoRoomError(str(error)) from error
