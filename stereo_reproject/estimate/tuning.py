"""Tuned numbers of this room, in one place.

`make spending` renders a few scenes, varies some of these fields one at a time and prints what each value costs in
traced pixels and buys in quality (docs/accuracy.md has a table of it). The others were set by hand: their docstrings
say by what reasoning.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EstimateTuning:
    """Numbers by which probes are placed, heard and believed, and tiles are chosen.

    Distances in tiles count tiles each way; sigmas are standard errors; excess is relative to the frame's noise.
    """

    # Where probes are, and how much each may say
    even_probe_chance: float = 0.5
    """Share of a probe's chance that is spread evenly over its tile, so that no pixel stands for more than the rest
    allows. Varied by `make spending`, where it buys next to nothing; in a small picture half of which shows glass, with
    all of it spread evenly, single probes had `high` trace 65 % for their sake, and 23 % with this."""
    max_probe_noise_ratio: float = 25.0
    """Times the mean noise of the probes around it, or of all others, that a probe's noise may be. One firefly in one
    trace is more than the noise of a whole frame; taken as it is, nothing would seem wrong beside it. By hand: ordinary
    noise of neighbours differs by less."""
    noise_weight: float = 0.5
    """Weight of noise beside contrast in a tile's expected error: where nothing is to be seen, tiles differ by little
    else. By hand."""

    # How tiles are judged
    frame_reach_tiles: int = 2
    """Tiles each way whose probes tell how wrong a tile is likely to be, for the frame's ratio. Varied by
    `make spending`."""
    tile_reach_tiles: int = 1
    """Tiles each way whose probes tell that for the limit on single tiles: an error in a small place must not be
    averaged away. By hand: the nearest there are."""
    tile_outlier_sigmas: float = 20.0
    """Times the noise around it that a probe's excess must be before its tile is traced for that alone. Measured on
    eight scenes at 480 x 270 with 64 samples: 10 traces 0.2 to 1.8 points more, most of them for fireflies, and lowers
    the honest ratio by 0.004 in the mean; without the rule, tiles in glass are left that are seen."""
    enclosing_tiles: int = 6
    """Traced ones, of the 8 tiles around a warped one, from which it is traced too; at the border, as large a share of
    fewer. Chosen on broken-window and glass-vase, judged on other scenes: see docs/accuracy.md."""
    min_noise_share: float = 0.01
    """Share of the frame's mean noise that a tile has at least when its error is held against it. By hand: less is not
    seen."""
    promise_margin_sigmas: float = 0.5
    """Standard errors by which the estimate must be within the promise before refinement stops. Varied by
    `make spending`."""

    # Slow errors, which are corrected and not traced
    bias_reaches_tiles: tuple[int, ...] = (4, 2, 1)
    """Tiles each way whose probes tell what a tile is off by: slow changes by many, what is left of faster ones by the
    nearest, as far as those are sure of it. By hand."""
    bias_doubt: float = 5.0
    """Times its own variance that is taken off the square of a mean residual: less is left where it may be chance. By
    hand, on pictures without any error: there next to nothing is corrected."""
    bias_contrast_share: float = 0.5
    """Share of the contrast around a probe that it may be off by without that being slow: an edge that is half a pixel
    aside. Along an edge, all probes that meet it are off to one side. By hand."""
    max_bias_factor: float = 2.0
    """Times brighter or darker that a correction may make a colour: bright ones are a hair from white after tone
    mapping."""

    # Denoised pictures
    source_noise_reach_tiles: int = 2
    """Tiles each way over which all pixels tell the noise of the probes."""

    # Noise that views have in common
    shared_noise_pixels: tuple[int, int] = (64, 512)
    """Rows and columns of each view, spread over it, by which noise that views have in common is told. By hand: 64 rows
    of 420 pixels are as sure of a mean as a picture of 160 x 160, and 256 views of any size take 160 MB at most."""

    # When a pilot goes ahead
    pilot_spacing_ratio: int = 4
    """Times further apart that the probes of a pilot are."""
    pilot_min_hole_share: float = 0.12
    """Share of holes from which a pilot is worth its render call: with fewer, a frame that turns out to need everything
    has lost little."""


TUNING = EstimateTuning()
"""The numbers that are in use."""
