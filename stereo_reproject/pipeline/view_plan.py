"""The plan of many views: which are rendered whole, and which are made from those, by what each is predicted to cost.

Between two views that were rendered lies a gap of views that are still wanted. They can be made from the two, or the
one in the middle is rendered too, and two gaps of half the width are left. The wider a gap, the more of its views must
be traced: by the views measured for the tuning the share grows by the same factor each time the width doubles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

from .tuning import TUNING


@dataclass(frozen=True)
class Gap:
    """Views that are wanted between two rendered ones: first and last are the numbers of those two."""

    first: int
    last: int

    @property
    def ends(self) -> tuple[int, int]:
        """Numbers of the two rendered views."""
        return self.first, self.last

    @property
    def count(self) -> int:
        """Number of views in the gap."""
        return self.last - self.first - 1

    @property
    def middle(self) -> int:
        """Number of the view in the middle."""
        return (self.first + self.last) // 2

    @property
    def inner(self) -> tuple[int, ...]:
        """Numbers of the views in the gap."""
        return tuple(range(self.first + 1, self.last))

    def halves(self) -> tuple[Gap, Gap]:
        """Return the two gaps that are left once the view in the middle is rendered."""
        return Gap(self.first, self.middle), Gap(self.middle, self.last)


@dataclass(frozen=True)
class ViewCosts:
    """Costs of a view, each over that of rendering one whole: traced is that of tracing all of its pixels packed, and
    made that of warping, finishing and denoising it, whatever is traced."""

    traced: float
    made: float

    def of_making(self, count: int, share: float) -> float:
        """Return the cost of making so many views of one gap, of whose middle one a share, 0 to 1, is to be traced."""
        return count * (self.made + self.traced * _mean_share(count) * share)

    def of_gap(self, count: int, share: float) -> float:
        """Return the least cost of so many views of a gap, of whose middle one a share, 0 to 1, is to be traced: they
        are made, or the middle one is rendered and the rest costs what it then costs."""
        return _least_cost(count, share, self)

    def is_split(self, count: int, share: float) -> bool:
        """Return whether the view in the middle of a gap is better rendered whole, as for `of_gap`."""
        return self.of_gap(count, share) < self.of_making(count, share)


@cache
def _mean_share(count: int) -> float:
    """Return the mean share that must be traced of so many views of a gap, over that of the one in the middle: it grows
    as a power of the distance to the nearer end."""
    power = -math.log2(TUNING.halved_gap_share)
    ends = (min(number, count + 1 - number) for number in range(1, count + 1))
    return sum((2.0 * end / (count + 1)) ** power for end in ends) / count


@cache
def _least_cost(count: int, share: float, costs: ViewCosts) -> float:
    """Return what `ViewCosts.of_gap` does."""
    if count <= 0:
        return 0.0
    made = costs.of_making(count, share)
    left, right = (count - 1) // 2, count - 1 - (count - 1) // 2
    halved = share * TUNING.halved_gap_share
    if 1.0 + (left + right) * costs.made >= made:
        return made
    return min(made, 1.0 + _least_cost(left, halved, costs) + _least_cost(right, halved, costs))
