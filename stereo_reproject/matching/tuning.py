"""Tuned numbers of this room, in one place.

They were chosen against EEVEE's own second eye, on living-room and glass-vase at 480 x 270, by the root mean square
error in the holes after tone mapping (docs/production.md, "How holes are matched", has the table). Where a field says
"by hand", its value was set by the reasoning that is given and was not compared with others.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MatchingTuning:
    """Tuned numbers by which traced pixels are matched to a picture. Nearness is 1 / depth."""

    # The ring, and the law that is learned on it
    ring_px: int = 1
    """Width of the ring around the holes that is traced to be compared. Rings of 1, 2 and 3 pixels gave errors of
    0.0394, 0.0396 and 0.0397: wider ones only cost more, because the membrane averages."""
    max_same_surface_step: float = 0.03
    """Difference of two nearnesses, as a share of the greater one, up to which they belong to the same surface. By
    hand."""
    feature_ridge: float = 1e-5
    """Ridge of the least squares fit, per pixel of the ring and as a share of each feature's mean square: it holds the
    weight of the traced light at 1 and all others at 0 where the ring tells nothing. By hand: so small that it only
    keeps the fit solvable."""
    prior_pixels: float = 0.5
    """Pixels of the ring that count as much as the assumption, to begin with, that both engines see the same light. By
    hand: a few pixels of a ring overrule it, and without a ring the traced light stays."""

    # The membrane over the rest
    nearness_step: float = 0.05
    """Difference in nearness, as a share, across which the membrane hardly reaches; also the step that makes an edge of
    depth. By hand."""
    albedo_step: float = 0.3
    """Difference in albedo, per channel from 0 to 1, across which the membrane hardly reaches. By hand."""
    normal_step: float = 0.5
    """Length of the difference of two unit normals across which the membrane hardly reaches. By hand: about 29
    degrees."""
    min_bond: float = 1e-3
    """Bond of two neighbours across an edge, as a share of that within a surface. By hand: so a surface without any
    pixel of the ring follows its surroundings."""
    membrane_tolerance: float = 1e-3
    """Residual of the membrane, as a share of the first one, at which its solution is good enough. By hand: what is
    left is below an 8-bit step."""
    max_membrane_rounds: int = 400
    """Rounds of conjugate gradients after which the solution is taken as it is. By hand: a limit, should the tolerance
    not be reached."""

    # Silhouettes that the source has seen
    min_silhouette_share: float = 0.3
    """Weight of the picture, against the matched light, in a silhouette where the law explains all of the difference.
    Tried together with the next field on a room and on a vase of glass, where both took the error of silhouettes from
    0.030 and 0.066 to 0.023 and 0.037."""
    unexplained_step: float = 0.05
    """Part of a matched colour, after tone mapping, that only the membrane gives, at which the rest of the weight is
    halfway to the picture. Tried together with the field above."""
    other_depth_factor: float = 0.5
    """Factor on that weight where the picture shows another depth than the tracer: it may have the other side of an
    edge, or lack a thing one pixel wide. Against full weight it took the errors of five scenes from 0.021, 0.021,
    0.016, 0.014 and 0.019 to 0.021, 0.021, 0.016, 0.013 and 0.015."""
    min_refracting_share: float = 0.5
    """Weight of the picture, at least, in a silhouette of something that refracts. By hand: one engine shows behind it
    what the other may not."""
    refracting_reach_px: int = 3
    """Pixels each way whose colours limit those of a pixel that refracts. By hand. To limit all matched pixels so made
    every scene worse, and was dropped."""


TUNING = MatchingTuning()
"""The numbers that are in use."""
