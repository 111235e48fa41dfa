"""The tuned numbers of the warp. Shaders of the GPU get them from here too."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class WarpTuning:
    """Tuned numbers of the warp, chosen by judgement or measurement; each says by which."""

    # The grid.
    tear_pixels: float = 1.0
    """Step in disparity at which a surface is torn rather than stretched: a gap of a target pixel shows."""
    bend_share: float = 0.1
    """Share of tear_pixels by which the perspective of eyes that are toed in may bend a coarse cell: a tenth of a
    pixel is no more than float32 and the lookup do elsewhere."""
    orthographic_width_radians: float = math.radians(40.0)
    """Angle under which the width of an orthographic picture counts as seen: it has none of its own, and this is that
    of a usual lens (50 mm on 36 mm)."""

    # Drawing it.
    max_stretch: float = 2.5
    """Target pixels for one source pixel, by length in a row and by area elsewhere, from which a surface holds too
    little to fill them and is left a hole. By judgement."""
    edge_tolerance: float = 1e-3
    """Quads or row segments by which a pixel centre may lie outside of one and still be covered: neighbours share their
    corners, so this only decides who wins a tie, and no centre falls between two of them for a rounding error."""
    broad_pixels: int = 32
    """Target pixels from which a segment without anything to show makes holes of all that it covers, whether it is
    nearer or not: where depth goes to and fro by so much, the order costs more time than it tells."""
    same_nearness_share: float = 2.0**-16
    """Share of a nearness by which a coarse and a fine quad of one surface may differ where they meet: some roundings
    of a float32."""

    # Several sources.
    same_point_pixels: float = 1.0
    """Pixels in a source between the place that was looked up and the place of the nearest point, up to which the
    source shows that point: as tear_pixels, since a surface may stretch by so much from a pixel to the next."""
    least_gain_share: float = 0.02
    """Share by which a later source's expected error must be smaller than an earlier one's: far above rounding, so that
    NumPy and a GPU choose alike, and far below what shows."""

    # Flat mirrors.
    image_distance_share: float = 0.1
    """Share of its surface's depth by which the image in a mirror stands farther, at least: with less, what is warped
    with the surface is hardly off."""
    mirror_pixels_share: float = 0.5
    """Share of a material's pixels whose rays go on, from which it is a mirror: where they meet nothing, they do not
    get longer."""
    min_mirror_boxes_share: float = 0.1
    """Share of a noisy picture that boxes around what may be a mirror cover at least, for the passes to be rendered
    that tell of its image. By hand: those passes take up to 3 % of a render's time, a mirror that is warped saves no
    more than its own pixels, and a box is up to three times as large as what it holds."""
    least_mirror_share: float = 5e-4
    """Share of the picture that a material's flat mirrors have at least, worth the holes around what they show."""
    least_reflectance: float = 0.2
    """Share of light that a mirror reflects at least: with less, the length of its rays says too little."""
    nothing_behind_share: float = 0.002
    """Share of its surface's depth up to which a ray counts as one that has met nothing behind a mirror: the length of
    a ray is not more exact."""
    max_roughness: float = 0.1
    """Roughness of a mirror at most: with twice that, Cycles follows six tenths of its rays (measured)."""
    flatness_step_share: float = 0.005
    """Share of the picture's width, to either side, at which normals are compared to see that a mirror is flat."""
    max_curvature: float = 0.02
    """Distance of what is reflected (of the mirror itself, where that is the sky) over the mirror's radius, at most:
    an image that a curved mirror shows stands elsewhere by about that share."""
    normal_rounding: float = 2e-5
    """Length by which a normal that was rendered is off by rounding."""
    max_normal_difference: float = 0.01
    """Length of the difference between two normals of one flat mirror, at most."""
    least_mirror_weight: float = 0.98
    """Share of a looked-up colour that must come from the mirror: the rest is that of a pixel of its rim."""

    # Panoramas.
    lens_edge_pixels: float = 1.5
    """Pixels beside a fisheye's edge that mix with the black beyond it: the reach of Blender's usual pixel filter."""

    # The choice of the GPU.
    least_gpu_pixels: int = 4_000_000
    """Pixels of a picture from which a GPU is thought of unasked: for fewer, NumPy takes too little time for the
    measurement to pay (docs/performance.md)."""


TUNING = WarpTuning()
