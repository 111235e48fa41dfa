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
    """Error raised where the GPU cannot hold a texture or warp a picture: its memory is full, something is too large,
    or this thread may not use it.
    """


@cache
def shader(name: str) -> gpu.types.GPUShader:
    """Return one of `shaders.PROGRAMS`, compiled, by its name. It is compiled at the first call and kept."""
    return compile_program(PROGRAMS[name])


# A shader that outlives Blender's GPU takes the process down with it. Blender as a module leaves by this way, too, and
# whoever came last goes first.
atexit.register(shader.cache_clear)


def fold(width: int, height: int, texels: int) -> tuple[int, int] | None:
    """Return how a picture of `texels` texels per pixel is laid out in a texture: the texels in a line, and how many
    lines make up a row of pixels. None where no texture is large enough.
    """
    limit, row = gpu.capabilities.max_texture_size_get(), width * texels
    for lines in range(-(-row // limit), limit // height + 1):
        if row % lines == 0:
            return row // lines, lines
    return None


def uploaded(values: NDArray[np.float32], size: tuple[int, int], *, lanes: int = 1) -> gpu.types.GPUTexture:
    """Return a new texture of size (width, height) that holds the values; lanes, 1 or 4, is the number of floats in a
    texel.
    """
    flat = np.ascontiguousarray(values, np.float32).ravel()
    return _texture(size, "R32F" if lanes == 1 else "RGBA32F", gpu.types.Buffer("FLOAT", flat.size, flat))


def downloaded(texture: gpu.types.GPUTexture) -> NDArray:
    """Return the values of a texture, (height, width) or (height, width, 4), as float32 or uint32 as it holds them.
    They are a copy, which may be written to. Textures of signed integers cannot be read.
    """
    return np.array(texture.read())


@dataclass
class ShaderRun:
    """A run of the shaders of one warp: their constants, and the textures that they hand each other. A texture kept
    here as "x" is read by shaders as "x_map" and written as "x_image".
    """

    constants: dict[str, Constant]
    textures: dict[str, gpu.types.GPUTexture] = field(default_factory=dict)

    def create(self, name: str, size: tuple[int, int], *, fill: int | None = None) -> gpu.types.GPUTexture:
        """Make a new texture of size (width, height) that shaders can write to, keep it under this name and return it.
        fill is the value of all its texels at first; None leaves them undefined. Raises NoRoomError.
        """
        kind, access, _ = IMAGES[f"{name}_image"]
        texture = _texture(size, kind)
        if fill is not None:
            texture.clear(format=access.partition("_")[0], value=(fill,))
        self.textures[name] = texture
        return texture

    def drop(self, *names: str) -> None:
        """Forget textures by their names, so that their memory is freed; names that are not there are passed over."""
        for name in names:
            self.textures.pop(name, None)

    def run(self, name: str, size: tuple[int, int], *, layers: int = 1, **constants: Constant) -> None:
        """Run the shader of this name once for each of (width, height) places, in each of so many layers. constants
        replace those of the run of the same name. Textures that the shader reads or writes must have been created.
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
    """Hand constants to a compiled shader that is bound, as integers or floats as `CONSTANTS` says."""
    for name, value in constants.items():
        if CONSTANTS[name].startswith("I"):
            compiled.uniform_int(name, value)
        else:
            compiled.uniform_float(name, value)


def _texture(size: tuple[int, int], kind: str, data: gpu.types.Buffer | None = None) -> gpu.types.GPUTexture:
    """Return a new texture of size (width, height), of a format of the gpu module. Raises NoRoomError if it cannot be
    had.
    """
    try:
        if data is None:
            return gpu.types.GPUTexture(size, format=kind)
        return gpu.types.GPUTexture(size, format=kind, data=data)
    except RuntimeError as error:
        raise NoRoomError(str(error)) from error
