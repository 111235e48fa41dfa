"""Tuned numbers of this room."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SettingsTuning:
    """Numbers by which an accuracy setting is adapted to a picture: to its size by `for_size`, to denoised ones by
    `for_denoised`."""

    unscaled_picture_px: int = 960 * 540
    """Pixels of a picture whose tiles have the side that the setting names. Chosen: what there is to be found in a
    larger picture is larger, too."""

    tile_scale_limits: tuple[float, float] = (2.0 / 3.0, 4.0 / 3.0)
    """Least and greatest side of a picture's tiles over the side that the setting names. Measured on
    renders of eight scenes at 480 x 270, where tiles of 8, 10, 12 and 14 pixels cost 25.9, 26.1, 29.6 and 28.1 % of an
    eye at `balanced`, and the last are told with twice the error; and of living-room at 960 x 540, where tiles of 8, 12
    and 16 pixels cost 12.4, 10.8 and 10.3 %."""

    denoised_spacing_ratio: float = 0.5
    """Side of a probe's tile in a denoised picture over that in a noisy one. Chosen: an error shows beside less noise,
    so that more probes are needed."""

    min_denoised_spacing_px: int = 6
    """Least side of a probe's tile in a denoised picture. Chosen: with 6 pixels the probes cost a twentieth of a render
    already."""

    denoised_limit_ratio: float = 1.5
    """Limit of a tile's honest ratio in a denoised picture over that in a noisy one. Chosen: there the noise of the
    estimate is about seven times as large, and the picture's own can hardly be seen."""


TUNING = SettingsTuning()
