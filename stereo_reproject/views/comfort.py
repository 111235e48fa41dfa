"""Comfort of a pair on its screen: the parallax at which viewers can still look with ease, and the interocular and
convergence distance that keep a scene within it.

Parallax is in percent of the picture's width, as in `parallax`: positive behind the screen, negative in front of it.
docs/artists.md names the sources of all limits, and says why these were chosen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import BadInputError
from ..words import Words
from .camera import Camera, PerspectiveCamera, planar, target_from_source
from .parallax import parallax_at

MAX_VERGENCE_DEGREES = 1.0
"""Degrees by which a viewer's eyes may turn further in or out than for the screen itself and stay comfortable, by the
review of Lambooij, Fortuin, Heynderickx and IJsselsteijn (2009), J. Imaging Science and Technology 53(3), 030201."""

SECANT_STEPS = 40
"""Steps after which a search for a depth ends, at most. Off-axis and parallel rigs need one, toe-in some five."""

PERCENT_TOLERANCE = 1e-9
"""Parallax in percent of the width that counts as found: far below any pixel, far above the rounding of doubles."""


@dataclass(frozen=True)
class Viewing:
    """The conditions under which a picture is seen.

    screen_width is the width of the picture and eye_distance the distance between a viewer's eyes, both in metres.
    distance is that of the viewer from the screen, in widths of the screen. Raises BadInputError unless all are above
    0.
    """

    screen_width: float
    eye_distance: float
    distance: float

    def __post_init__(self) -> None:
        if min(self.screen_width, self.eye_distance, self.distance) <= 0.0:
            raise BadInputError("screen width, eye distance and viewing distance must be above 0")

    @property
    def eyes_percent(self) -> float:
        """The parallax at which eyes look straight ahead, in percent of the width; beyond it they turn apart."""
        return 100.0 * self.eye_distance / self.screen_width

    @property
    def distance_percent(self) -> float:
        """The distance from the screen, in percent of the screen's width."""
        return 100.0 * self.distance


@dataclass(frozen=True)
class Limits:
    """A range of parallax in percent of the width: near, 0 or less, is in front of the screen and far is behind it."""

    near: float
    far: float


BROADCAST = Limits(-1.0, 2.0)
"""Parallax between which the main subjects of a programme are kept, on screens of 46 to 70 inches: BSkyB Technical
Guidelines for Plano Stereoscopic (3D) Programme Content."""


def vergence_degrees(percent: float, viewing: Viewing) -> float:
    """Return by how much a viewer's eyes turn outwards, in degrees, from the screen to a point with this parallax in
    percent; inwards is negative.

    It is the vergence angle of the screen less that of the point, each 2 atan(e / 2d): d is the distance from the
    screen and e the distance between the eyes, for the point less its parallax.
    """
    eyes, twice = viewing.eyes_percent, 2.0 * viewing.distance_percent
    return 2.0 * math.degrees(math.atan2(eyes, twice) - math.atan2(eyes - percent, twice))


def conflict_dioptres(percent: float, viewing: Viewing) -> float:
    """Return the conflict between vergence and accommodation at a point with this parallax in percent, in dioptres:
    positive where eyes converge behind the screen, on which they focus.

    The eyes focus at 1 / d and converge at (e - p) / (e d), in dioptres for metres: similar triangles on the screen
    with parallax p, at the distance d, and at the point.
    """
    return percent / (viewing.eyes_percent * viewing.distance * viewing.screen_width)


def turned_apart_degrees(interocular: float, convergence: float) -> float:
    """Return by how many degrees the eyes of a viewer with a headset turn apart to look at what is endlessly far, in a
    pair of spherical stereo. Both distances are in scene units; convergence is +inf for parallel eyes.

    A headset shows each direction where it is. What is at the convergence distance is in the same direction for both
    eyes, and so is seen endlessly far; what is farther has them turn apart, by 2 atan(e / 2c) at most.
    """
    return 2.0 * math.degrees(math.atan2(interocular, 2.0 * convergence))


def comfort_limits(viewing: Viewing) -> Limits:
    """Return the parallax between which viewers look at a point with ease: eyes turn by no more than
    MAX_VERGENCE_DEGREES from the screen, and never apart.
    """
    eyes, twice = viewing.eyes_percent, 2.0 * viewing.distance_percent
    screen, step = math.atan2(eyes, twice), 0.5 * math.radians(MAX_VERGENCE_DEGREES)
    near = eyes - twice * math.tan(screen + step)
    far = eyes - twice * math.tan(max(screen - step, 0.0))
    return Limits(near, far)


def fit_limits(viewing: Viewing, budget: Limits = BROADCAST) -> Limits:
    """Return the parallax into which a scene is fitted: that part of the budget which is within the comfort limits of
    these viewers.
    """
    comfort = comfort_limits(viewing)
    return Limits(max(budget.near, comfort.near), min(budget.far, comfort.far))


@dataclass(frozen=True)
class Fit:
    """Settings of a stereo camera: interocular distance and depth of the screen, in scene units. The screen of parallel
    eyes is at infinity.
    """

    interocular: float
    screen_depth: float

    def depth_at(self, percent: float, unit_width: float) -> float:
        """Return the depth that has this parallax in percent, by the formula of `fit_off_axis`; inf where even infinity
        has less.
        """
        nearness = 1.0 / self.screen_depth - 0.01 * percent * unit_width / self.interocular
        return 1.0 / nearness if nearness > 0.0 else math.inf


def fit_off_axis(near: float, far: float, limits: Limits, unit_width: float, infinity_percent: float) -> Fit:
    """Return the off-axis rig that shows the depth `near` at limits.near and the depth `far` at limits.far.

    Depths are in scene units, 0 < near <= far <= inf. unit_width is the width of the view plane at unit depth.
    infinity_percent is the parallax that infinity must not exceed: where it would, as in a flat scene, near stays at
    its limit and far comes closer to the screen. Raises BadInputError if near is not above 0, or if far is infinite and
    limits.far is 0: the screen would be at infinity.

    In percent, the parallax of the depth z is p = 100 b / w (1 / c - 1 / z), with the interocular distance b, the
    screen at c and the width w: linear in 1 / z, so two depths determine b and c.
    """
    _check_depths(near, far)
    nearness = 1.0 / near - 1.0 / far
    infinity = limits.far + (limits.far - limits.near) / (far * nearness) if nearness > 0.0 else math.inf
    infinity = min(infinity, infinity_percent)
    if infinity <= 0.0:
        raise BadInputError("no depth is left behind the screen, and the sky is in view: raise Behind")
    interocular = 0.01 * unit_width * (infinity - limits.near) * near
    return Fit(interocular, 100.0 * interocular / (unit_width * infinity))


def fit_parallel(near: float, limits: Limits, unit_width: float) -> Fit:
    """Return the parallel rig that shows the depth `near` at limits.near; as `fit_off_axis` has it.

    Parallel eyes show infinity at the screen and all else in front of it: p = -100 b / (w z). Raises BadInputError if
    near is not above 0, or if limits.near is 0: the pair would be flat.
    """
    _check_depths(near, near)
    if limits.near == 0.0:
        raise BadInputError("a parallel camera shows everything in front of the screen: raise In Front")
    return Fit(-0.01 * unit_width * limits.near * near, math.inf)


def _check_depths(near: float, far: float) -> None:
    """Raise BadInputError unless 0 < near <= far and near is finite."""
    if not (0.0 < near <= far and math.isfinite(near)):
        raise BadInputError(
            Words(
                "the scene's depth, from {near} to {far}, cannot be fitted: nothing is in front",
                near=f"{near:g}",
                far=f"{far:g}",
            )
        )


def unit_width(camera: Camera, frame_width: int) -> float:
    """Return the width, at unit depth, of the whole frame of frame_width pixels; the camera may show a part of it."""
    plane = planar(camera).plane
    return (plane.right - plane.left) / camera.width * frame_width


def depth_at_parallax(left: Camera, right: Camera, percent: float, frame_width: int) -> float | None:
    """Return the depth, in scene units, that has this parallax in percent in the middle of the left picture; inf where
    only infinity has it, None where no depth has.

    The search is a secant's over 1 / depth, in which the parallax of off-axis and parallel rigs is linear. frame_width
    is as for `parallax_at`.
    """
    baseline = abs(float(target_from_source(left, right)[0, 3]))
    if baseline == 0.0 or not isinstance(left, PerspectiveCamera):
        return None
    # Tens of baselines away, where a difference of parallax loses no digits.
    one, other = 0.0, 0.02 / baseline
    error = _percent_at(left, right, one, frame_width) - percent
    for _ in range(SECANT_STEPS):
        if abs(error) <= PERCENT_TOLERANCE:
            return 1.0 / one if one > 0.0 else math.inf
        other_error = _percent_at(left, right, other, frame_width) - percent
        if other_error == error or math.isnan(other_error):
            return None
        step = other_error * (other - one) / (other_error - error)
        one, other, error = other, other - step, other_error
        # A line of sight that meets no depth in front of the camera meets one behind it.
        if other < 0.0 and abs(error) > PERCENT_TOLERANCE:
            return None
    return None


def _percent_at(left: Camera, right: Camera, nearness: float, frame_width: int) -> float:
    """Return the parallax in percent at a nearness, which is 1 / depth; NaN behind the camera."""
    return parallax_at(left, right, 1.0 / nearness if nearness != 0.0 else math.inf, frame_width).percent
