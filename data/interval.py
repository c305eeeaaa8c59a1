"""Intervals of float64 numbers, in arrays: every operation holds all that it may give for numbers of its operands.

Ends are rounded outwards, by one step of float64, by two after sine and cosine, which libraries give to within one.
Source: Moore 1966, "Interval Analysis".
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

# Beyond this, arguments of sine and cosine have lost too much; any value may come.
FAR = 1e6
# Extrema of sine and cosine count as within an interval if they are this near to it [radians].
NEAR = 1e-6


@dataclass(frozen=True)
class Interval:
    """Numbers from `low` to `high`, arrays of one shape, float64; ends may be infinite."""

    low: np.ndarray
    high: np.ndarray

    @classmethod
    def of(cls, number: float) -> "Interval":
        """A number alone."""
        return cls(np.float64(number), np.float64(number))

    def __add__(self, other: "Interval") -> "Interval":
        return _outwards(self.low + other.low, self.high + other.high)

    def __neg__(self) -> "Interval":
        return Interval(-self.high, -self.low)

    def __sub__(self, other: "Interval") -> "Interval":
        return self + -other

    def __mul__(self, other: "Interval") -> "Interval":
        # What overflows is infinite on its own side, which holds it.
        with np.errstate(invalid="ignore", over="ignore"):
            ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        # Nothing times what grows for ever is nothing.
        ends = [np.where(np.isnan(end), 0.0, end) for end in ends]
        return _outwards(np.minimum.reduce(ends), np.maximum.reduce(ends))

    def __truediv__(self, other: "Interval") -> "Interval":
        """Everything, where the divisor may be zero."""
        zero = (other.low <= 0) & (other.high >= 0)
        low, high = np.where(zero, 1.0, other.low), np.where(zero, 1.0, other.high)
        with np.errstate(over="ignore"):
            inverse = _outwards(1.0 / high, 1.0 / low)
        whole = Interval(np.where(zero, -np.inf, inverse.low), np.where(zero, np.inf, inverse.high))
        return self * whole

    def maximum(self, other: "Interval") -> "Interval":
        """The larger of the two."""
        return Interval(np.maximum(self.low, other.low), np.maximum(self.high, other.high))

    def minimum(self, other: "Interval") -> "Interval":
        """The smaller of the two."""
        return Interval(np.minimum(self.low, other.low), np.minimum(self.high, other.high))

    def __abs__(self) -> "Interval":
        return self.maximum(-self).maximum(Interval.of(0.0))

    def within(self, limit: np.ndarray) -> "Interval":
        """What of it is no further from zero than a limit."""
        return Interval(np.maximum(self.low, -limit), np.minimum(self.high, limit))

    @property
    def size(self) -> np.ndarray:
        """The largest distance from zero."""
        return np.maximum(np.abs(self.low), np.abs(self.high))


def sine(angle: Interval) -> Interval:
    """Sine of radians."""
    return _wave(angle, np.sin, 0.5 * np.pi)


def cosine(angle: Interval) -> Interval:
    """Cosine of radians."""
    return _wave(angle, np.cos, 0.0)


def _wave(angle: Interval, wave: Callable[[np.ndarray], np.ndarray], crest: float) -> Interval:
    """A wave of period 2 pi that is 1 at its crest, and -1 half a period on."""
    far = ~((np.abs(angle.low) < FAR) & (np.abs(angle.high) < FAR))
    low, high = np.where(far, 0.0, angle.low), np.where(far, 0.0, angle.high)
    ends = wave(low), wave(high)
    out = _outwards(*_outwards_ends(np.minimum(*ends), np.maximum(*ends)))
    top, bottom = (far | _holds(low, high, at) for at in (crest, crest + np.pi))
    return Interval(np.where(bottom, -1.0, np.maximum(out.low, -1.0)), np.where(top, 1.0, np.minimum(out.high, 1.0)))


def _holds(low: np.ndarray, high: np.ndarray, at: float) -> np.ndarray:
    """Whether some at + 2 pi k lies between two ends, or nearly so."""
    return np.floor((high - at + NEAR) / (2 * np.pi)) >= np.ceil((low - at - NEAR) / (2 * np.pi))


def _outwards_ends(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.nextafter(low, -np.inf), np.nextafter(high, np.inf)


def _outwards(low: np.ndarray, high: np.ndarray) -> Interval:
    """Ends a step further out; ends that are no number may be anything."""
    low, high = _outwards_ends(low, high)
    return Interval(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))
