"""With which power of something a time grows, and how sure that is.

y = b x^p is fitted by least squares in the logarithms: errors are taken to be shares of the time. A time that has a
part which does not grow is not a power of anything, and its plain exponent is between the true one and 0; so
y = a + b x^p is fitted too where there are points enough to tell, and is taken where it describes them better by
Akaike's criterion, with its correction for few points (Hurvich and Tsai, Biometrika 76, 1989).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import t as student

CONFIDENCE = 0.95

LEAST_RANGE = 1.2
"""Greatest x over smallest: from less, no exponent is told."""

LEAST_POINTS, LEAST_PLACES = 6, 4
"""Points, and different x among them, from which a constant may be told apart from an exponent."""

STARTS = (0.5, 1.0, 2.0)
"""Exponents from which the search for one with a constant begins."""

EXPONENTS = (-4.0, 4.0)
"""Between these it is looked for."""

EXACT = 1e-12
"""Squared error of logarithms that is taken for none: what is rounded says nothing of either model."""


@dataclass(frozen=True)
class Fit:
    """y = constant + factor * x^exponent over `points` points.

    low to high is the exponent's 95 % interval, None where there are too few points for one. spread is by what factor
    a point is typically off (root mean square in the logarithms): 1.05 is 5 %.
    """

    exponent: float
    low: float | None
    high: float | None
    factor: float
    constant: float
    spread: float
    points: int

    def at(self, x: float) -> float:
        return self.constant + self.factor * x**self.exponent


def fitted(x: Sequence[float], y: Sequence[float]) -> Fit | None:
    """The better of both models; None where the points tell of no exponent."""
    known = [(a, b) for a, b in zip(x, y, strict=True) if a > 0.0 and b > 0.0]
    if len(known) < 2:
        return None
    xs, ys = np.array(known, np.float64).T
    if xs.max() < LEAST_RANGE * xs.min():
        return None
    plain = power_law(xs, ys)
    if len(known) < LEAST_POINTS or len(np.unique(xs)) < LEAST_PLACES:
        return plain
    offset = power_law_with_constant(xs, ys)
    return offset if _criterion(offset, xs, ys, 4) < _criterion(plain, xs, ys, 3) else plain


def power_law(x: NDArray[np.float64], y: NDArray[np.float64]) -> Fit:
    """y = b x^p for x, y (N,) above 0, with two different x at least."""
    log_x, log_y = np.log(x), np.log(y)
    along = log_x - log_x.mean()
    exponent = float(along @ log_y / (along @ along))
    level = float(log_y.mean() - exponent * log_x.mean())
    left = log_y - level - exponent * log_x
    error = _standard_error(left, 2, np.array([[1.0 / (along @ along)]]))
    return _fit(exponent, error, len(x) - 2, np.exp(level), 0.0, left)


def power_law_with_constant(x: NDArray[np.float64], y: NDArray[np.float64]) -> Fit:
    """y = a + b x^p for x, y (N,) above 0, with a and b above 0 as well."""
    unit = np.exp(np.log(x).mean())

    def model(terms: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.logaddexp(terms[0], terms[1] + terms[2] * np.log(x / unit))

    def start(exponent: float) -> NDArray[np.float64]:
        return np.array([np.log(0.5 * y.min()), np.log(0.5 * np.median(y)), exponent])

    bounds = ([-np.inf, -np.inf, EXPONENTS[0]], [np.inf, np.inf, EXPONENTS[1]])
    found = [least_squares(lambda terms: model(terms) - np.log(y), start(p), bounds=bounds) for p in STARTS]
    best = min(found, key=lambda one: one.cost)
    constant, factor, exponent = best.x
    error = _standard_error(best.fun, 3, np.linalg.pinv(best.jac.T @ best.jac)[2:, 2:])
    factor = np.exp(factor - exponent * np.log(unit))
    return _fit(float(exponent), error, len(x) - 3, factor, float(np.exp(constant)), best.fun)


def _standard_error(left: NDArray[np.float64], terms: int, inverse: NDArray[np.float64]) -> float | None:
    """Of the term whose part of the inverse of J^T J this is (1, 1); None where no point is left to tell."""
    free = len(left) - terms
    return float(np.sqrt(left @ left / free * inverse[0, 0])) if free > 0 else None


def _fit(
    exponent: float, error: float | None, free: int, factor: float, constant: float, left: NDArray[np.float64]
) -> Fit:
    reach = None if error is None else float(student.ppf(0.5 + 0.5 * CONFIDENCE, free)) * error
    low, high = (None, None) if reach is None else (exponent - reach, exponent + reach)
    spread = float(np.exp(np.sqrt(np.mean(left**2))))
    return Fit(exponent, low, high, float(factor), constant, spread, len(left))


def _criterion(fit: Fit, x: NDArray[np.float64], y: NDArray[np.float64], terms: int) -> float:
    """Akaike's, corrected; terms counts the variance too."""
    left = np.log(y) - np.log([fit.at(place) for place in x])
    count = len(x)
    squares = max(float(left @ left), EXACT)
    return count * np.log(squares / count) + 2.0 * terms + 2.0 * terms * (terms + 1) / max(count - terms - 1, 0.5)
