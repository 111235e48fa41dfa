"""The compute shaders of the warp: their sources, their resources, and how they are compiled.

All pictures are textures, row 0 first. There are no doubles: what needs them is computed beforehand. Resources have
the same name and kind in all shaders: see SAMPLERS, IMAGES and CONSTANTS.
"""

from __future__ import annotations

from dataclasses import dataclass

import gpu

from .lookup_source import BLENDED, FLAGS, LOOKED_UP, LOOKUP, NEARNESS_THERE, NEIGHBOURS, TARGET_DEPTH
from .warp_source import (
    COMMON,
    CORNERS,
    CUTS,
    DRAW,
    INTERVALS,
    MOVE,
    NEARNESS,
    PLACES,
    QUAD,
    RAY,
    SETTLED,
    SIDES,
    SPLIT,
    TORN,
    VERTICES,
)

SAMPLERS = {
    "depth_map": "FLOAT_2D",  # (H, W) of the source
    "split_map": "FLOAT_2D",  # a texel for each cell: above 0 where it is subdivided
    "cut_map": "UINT_2D",  # (H, W): 1 torn from the next pixel in the row, 2 in the column, 4 without a depth
    "line_map": "FLOAT_2D",  # (H, 2): slope and start of the rows' shift by nearness, see scanline.RowLaw
    "corner_map": "FLOAT_2D",  # (H, W + 2): nearness and shift of the corners in the rows
    "vertex_map": "FLOAT_2D",  # (H + 2, W + 2): pixels moved right and down, nearness there, and whether there is any
    "owner_map": "INT_2D",  # of the target, as all that follow: who won
    "drawn_map": "INT_2D",  # minus the number of the quad that did
    "x_map": "FLOAT_2D",
    "y_map": "FLOAT_2D",
    "near_map": "FLOAT_2D",
    "before_map": "FLOAT_2D",
    "after_map": "FLOAT_2D",
    "picture_map": "FLOAT_2D",  # a pass of the source, a texel for a pixel or for each of its channels
}
IMAGES = {
    "cut_image": ("R8UI", "UINT_2D", {"WRITE"}),
    "corner_image": ("RG32F", "FLOAT_2D", {"WRITE"}),
    "vertex_image": ("RGBA32F", "FLOAT_2D", {"WRITE"}),
    "owner_image": ("R32I", "INT_2D_ATOMIC", {"READ", "WRITE"}),
    "drawn_image": ("R32I", "INT_2D_ATOMIC", {"READ", "WRITE"}),
    "broad_image": ("R32UI", "UINT_2D_ATOMIC", {"READ", "WRITE"}),  # above 0: some quad was too broad to be drawn
    "x_image": ("R32F", "FLOAT_2D", {"WRITE"}),
    "y_image": ("R32F", "FLOAT_2D", {"WRITE"}),
    "near_image": ("R32F", "FLOAT_2D", {"WRITE"}),
    "before_image": ("R32F", "FLOAT_2D", {"WRITE"}),
    "after_image": ("R32F", "FLOAT_2D", {"WRITE"}),
    "flag_image": ("R8UI", "UINT_2D", {"WRITE"}),
    "result_image": ("R32F", "FLOAT_2D", {"WRITE"}),
    "result4_image": ("RGBA32F", "FLOAT_2D", {"WRITE"}),
}
CONSTANTS = {
    "source_size": "IVEC2",
    "target_size": "IVEC2",
    "cell_count": "IVEC2",
    "is_parallel": "INT",  # whether the rays are: orthographic cameras
    "disparity_scale": "FLOAT",
    "tangent_scale": "FLOAT",  # pixels per radian of the arc tangent of a row's line; 0 where that is the shift itself
    "wraps": "INT",  # 1 where the source's right side goes on at its left, else 0
    "period": "FLOAT",  # pixels of the target after which it shows the same direction again; 0 for never
    "widest": "FLOAT",  # pixels, from which a quad is not drawn
    "key_way": "IVEC2",  # a key is 2 (x + y * interval), greater where nearer, and odd where it is shown
    "move_x": "VEC4",  # see warp._moves
    "move_y": "VEC4",
    "move_depth": "VEC4",
    "move_scale": "VEC4",
    "quad_span": "INT",
    "to_settle": "INT",
    "texel_count": "INT",  # in a pixel
    "source_fold": "IVEC2",  # texels in a line, and lines in a row
    "target_fold": "IVEC2",
}


@dataclass(frozen=True)
class Program:
    """A compute shader before it is compiled: its source, the names of the samplers, images and constants that it uses,
    and the size of its groups. taps and lanes are of those that look a picture up: pixels along each axis, and channels
    at once.
    """

    source: str
    samplers: tuple[str, ...]
    images: tuple[str, ...]
    constants: tuple[str, ...]
    group: tuple[int, int] = (16, 16)
    taps: int = 0
    lanes: int = 1


MOVES = ("move_x", "move_y", "move_depth", "move_scale")
PLACED = ("x_image", "y_image", "near_image")
_LOOKUP_CONSTANTS = ("source_size", "wraps", "target_size", "texel_count", "source_fold", "target_fold")


def _lookup(taps: int, lanes: int) -> Program:
    """Return the program that looks a picture up at the places of the map, with 1, 2 or 4 pixels (taps) along each
    axis, and 1 or 4 channels (lanes) at once.
    """
    source, result = SIDES + LOOKUP + BLENDED + LOOKED_UP, "result_image" if lanes == 1 else f"result{lanes}_image"
    samplers = ("picture_map", "x_map", "y_map")
    return Program(source, samplers, (result,), _LOOKUP_CONSTANTS, taps=taps, lanes=lanes)


PROGRAMS = {
    "cuts": Program(
        NEARNESS + SIDES + CUTS,
        ("depth_map",),
        ("cut_image",),
        ("source_size", "wraps", "is_parallel", "disparity_scale"),
    ),
    "corners": Program(
        NEARNESS + SIDES + SPLIT + CORNERS,
        ("depth_map", "split_map", "line_map"),
        ("corner_image",),
        ("source_size", "wraps", "is_parallel", "tangent_scale"),
    ),
    "intervals": Program(
        SIDES + SPLIT + TORN + INTERVALS,
        ("corner_map", "split_map", "cut_map"),
        ("owner_image",),
        ("source_size", "target_size", "wraps", "key_way"),
    ),
    "places": Program(
        SIDES + PLACES, ("owner_map", "corner_map"), PLACED, ("source_size", "target_size", "wraps", "key_way")
    ),
    "vertices": Program(
        NEARNESS + RAY + MOVE + VERTICES,
        ("depth_map",),
        ("vertex_image",),
        ("source_size", "is_parallel", *MOVES),
    ),
    "draw": Program(
        SIDES + SPLIT + TORN + QUAD + DRAW,
        ("vertex_map", "split_map", "cut_map"),
        ("owner_image", "drawn_image", "broad_image"),
        ("source_size", "target_size", "wraps", "cell_count", "quad_span", "to_settle", "period", "widest"),
    ),
    "settled": Program(
        QUAD + SETTLED, ("drawn_map", "vertex_map"), PLACED, ("source_size", "target_size", "wraps", "period")
    ),
    "neighbours": Program(NEIGHBOURS, ("near_map",), ("before_image", "after_image"), ("target_size",), group=(64, 1)),
    "flags": Program(
        RAY + MOVE + FLAGS,
        ("x_map", "y_map", "before_map", "after_map"),
        ("flag_image",),
        ("source_size", "target_size", "is_parallel", *MOVES),
    ),
    "depth": Program(
        NEARNESS + NEARNESS_THERE + SIDES + BLENDED + RAY + TARGET_DEPTH,
        ("depth_map", "x_map", "y_map"),
        ("result_image",),
        ("source_size", "target_size", "wraps", "is_parallel", "move_depth", "move_scale"),
        taps=2,
    ),
    **{
        f"{how} {lanes}": _lookup(taps, lanes)
        for how, taps in (("nearest", 1), ("linear", 2), ("cubic", 4))
        for lanes in (1, 4)
    },
}


def compile_program(program: Program) -> gpu.types.GPUShader:
    """Return the compiled shader of a program, ready to be run. Raises whatever the gpu module raises for one that does
    not compile.
    """
    info = gpu.types.GPUShaderCreateInfo()
    for slot, name in enumerate(program.samplers):
        info.sampler(slot, SAMPLERS[name], name)
    for slot, name in enumerate(program.images):
        format_, kind, qualifiers = IMAGES[name]
        info.image(slot, format_, kind, name, qualifiers=qualifiers)
    for name in program.constants:
        info.push_constant(CONSTANTS[name], name)
    if program.taps:
        info.define("TAPS", str(program.taps))
        info.define("LANES", str(program.lanes))
        info.define("VALUE", "float" if program.lanes == 1 else f"vec{program.lanes}")
    info.local_group_size(*program.group)
    info.compute_source(COMMON + program.source)
    return gpu.shader.create_from_info(info)
