"""The tuned numbers of the hole rules; what an accuracy setting chooses is in `settings.accuracy`."""

from __future__ import annotations

from dataclasses import dataclass

from ..settings.accuracy import DISPLAY_STEP


@dataclass(frozen=True)
class HoleTuning:
    """Tuned numbers of the rules that flag holes, chosen by judgement or measurement; each says by which."""

    max_flagged_weight: float = 0.02
    """Share of a looked-up colour that may come from a pixel that must not be looked up: less hardly shows."""
    max_left_out_weight: float = 0.4
    """Share of a looked-up colour up to which pixels that must not be looked up are left out of it, and the others are
    taken alone, which moves what is seen by as much of a pixel. By measurement on six scenes at 64 samples: pixels
    beyond it, up to 0.5, are 0.1 to 0.25 % of a picture, and untraced their mean squared bias is 3 to 46 times the
    noise; below it, it is mostly 0.1 to 2 times."""
    fur_pixels: int = 3
    """Pixels each way within which nothing but hair makes it fur: as many as the sides of an edge are taken from."""

    # Silhouettes.
    side_window_pixels: int = 3
    """Pixels around an edge pixel, each way, from which the colours of its two sides are taken."""
    least_side_pixels: int = 4
    """Pixels that a side must have in the window for its colour to be known: fewer have no variance to speak of."""
    min_band_weight: float = 0.25
    """Share of a target pixel's lookup that must come from beside an edge of the source for that edge to be the one
    that the target has there. By measurement: less is often the other edge of a strip, as of the sky between two
    bars. With it classroom at 480 x 270 traces 0.5 % more of its pixels than if the least share counted, and a fifth of
    the error that was left at edges is gone."""
    contrast_ratio: float = 4.0
    """Difference between the sides of a source's edge, as a multiple of the error that is tolerated, from which the
    target's edge is traced too: it lies elsewhere within the pixel, which is wrong by about an eighth of the difference
    in the mean. By measurement: untraced such edges are half of all that is wrong in a denoised classroom at 480 x 270
    and 64 samples, and 2.2 % of its pixels; of a noisy one they are an eighth and 0.8 %."""
    indirect_tolerance_share: float = 0.25
    """Share of an accuracy's colour_tolerance that is allowed where a pixel's own colour cannot tell its error: between
    the mean colours of two sides, for the error to be expected beyond a blurred edge, and for the detail that a lookup
    blurs. So much was allowed there
    when that was the only rule, for all settings but `high` (0.35 against 0.25 standard deviations now)."""
    unseen_steps: float = 0.25
    """Difference, in display steps (`settings.accuracy.DISPLAY_STEP`), that nobody sees, noise or not. By hand."""

    # Detail.
    least_detail_tolerance: float = 0.2
    """Detail, in standard deviations of a single pixel's noise, that may be lost by any accuracy setting. By hand: a
    picture that has lost as much everywhere has an honest ratio of 1.01, half of what `exact` allows."""
    unseen_detail_share: float = 0.5
    """Detail, over the noise that nobody sees by the accuracy in use, that may be lost in a lookup, noise or not. By
    measurement on a still life, bathroom and classroom: docs/accuracy.md."""
    denoised_detail_ratio: float = 16.0
    """Second difference of a denoised picture's colours, over the noise that nobody sees by the accuracy in use, from
    which its detail is traced. By measurement on living-room, classroom and bathroom: docs/production.md."""
    denoised_detail_reach_pixels: tuple[int, int] = (2, 2)
    """Pixels, down and across, over which these differences are averaged. By measurement on bathroom at 960 x 540,
    whose errors lie within three pixels of edges: over 3 x 3 pixels as many traced ones leave a third
    more of the squared error (docs/production.md)."""

    # Thin things.
    thin_step_pixels: float = 0.1
    """Pixels in the target by which the mean of a pixel's samples puts it nearer than the first sample does, from which
    something thin stands before it: the smallest step of any accuracy setting."""
    surface_reach_pixels: int = 1
    """Pixels each way: what holds a square of this reach is a surface and not thin."""
    least_covered_share: float = 0.1
    """Share of a pixel that something thin is taken to cover at least, and so how near it may be: less hardly shows."""
    isolated_reach_pixels: int = 3
    """Pixels each way among which those of a wire are few."""
    isolated_share: float = 1.0 / 3.0
    """Largest share of those pixels that counts as few: two wires that cross have two sevenths."""
    max_search_pixels: int = 8
    """Pixels, at most, by which a thin thing is looked for beside the place that its depth tells."""

    # Defocus.
    least_blur_pixels: float = 1.0
    """Radius of a circle of confusion from which an edge is more than a silhouette: a pixel filter reaches as far."""
    blur_reach_pixels: tuple[int, ...] = (2, 4, 8, 16, 32, 64, 128)
    """Pixels around an edge that are looked at: the first that is no less than its circle of confusion, or the last."""
    misplaced_share: float = 0.5
    """Share of the step in disparity by which what is seen through a blurred edge is off: it is warped with either
    side, and so by half of it in the mean."""

    # Transmission.
    error_margin: float = 2.0
    """Factor by which the error to be expected must exceed the allowed one: how far behind a surface things are is a
    guess, and probes tell of the rest."""

    @property
    def unseen_difference(self) -> float:
        """Difference after tone mapping that nobody sees, noise or not."""
        return self.unseen_steps * DISPLAY_STEP

    min_distant_width_share: float = 0.05
    """Share of the picture's width from which away a thing that lands in a gap of the surfaces counts as hidden by what
    is unknown there: more than the parallax of any pair that one looks at with ease (3 %). Without it twice as much
    would be traced of leaves before a sky, which are right. By hand."""

    # Things that move.
    mover_reach_share: float = 0.12
    """Distance from the box around a thing that moves within which surfaces are traced anew, as a share of the box's
    diagonal: there its shadow is darkest, and probes tell of what lies farther away. By hand."""


TUNING = HoleTuning()
