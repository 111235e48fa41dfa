"""Tuned numbers of this room."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SettingsTuning:
    """Numbers by which an accuracy setting is adapted to a picture: to large pictures by `for_size`, to denoised ones
    by `for_denoised`."""

    small_picture_px: int = 960 * 540
    """Pixels up to which a picture's tiles have the side that the setting names. Chosen: 960 x 540;
    what there is to be found in a larger picture is larger, too."""

    max_tile_growth: float = 2.0
    """Greatest side of a large picture's tiles over that of a small one. Chosen: a probe then stands for four times as
    many pixels."""

    denoised_spacing_ratio: float = 0.75
    """Side of a probe's tile in a denoised picture over that in a noisy one. Chosen: an error shows beside less noise,
    so that more probes are needed."""

    denoised_limit_ratio: float = 1.5
    """Limit of a tile's honest ratio in a denoised picture over that in a noisy one. Chosen: there the noise of the
    estimate is about seven times as large, and the picture's own can hardly be seen."""


TUNING = SettingsTuning()
