"""Objects that move: their motion as text, where it takes them at a time, and a box that holds them at all times.

A motion is a sequence of steps, each with a number or a term in t between dollar signs, done from left to right in the
frame of the object's definition, before its transform:

    -rz $10 * t$                        turn about z by 10 degrees a second
    -sa 0.5 -tx $2 * sin(45 * t)$       half as large, to and fro on x

Steps are tx, ty, tz [m], rx, ry, rz [degrees, counter-clockwise], sx, sy, sz and sa (scale on an axis, or on all). A
term has numbers, t [s], pi, + - * /, brackets, and sin and cos (of degrees), abs, min, max. Source: Funkhouser et al.
1996, section 2.2, after Oakland's ugbump.

The box is proved by interval arithmetic (data/interval.py): what a term comes to at a time lies in what it comes to
over an interval that holds the time. A period is cut into parts, since what depends on each other is bounded loosely.
"""

import ast
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from .errors import InputError
from .interval import Interval, cosine, sine

__all__ = ["Animation"]

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
STEP = re.compile(rf"\s*-([trs][xyz]|sa)\s+(?:\$([^$]*)\$|({NUMBER}))(?=\s|$)")
# Longer texts are no motion that a person wrote.
LONGEST = 2000
# Parts of a period, and vertices that are moved at a time.
PARTS, CHUNK = 256, 2048

Value = TypeVar("Value", float, Interval)


def _plain_sin(degrees: float) -> float:
    return float(np.sin(np.radians(degrees)))


def _plain_cos(degrees: float) -> float:
    return float(np.cos(np.radians(degrees)))


def _radians(degrees: Interval) -> Interval:
    # Pi is within a step of float64 of itself, which rounding outwards covers.
    return degrees * Interval.of(np.pi) / Interval.of(180.0)


PLAIN: dict[str, Callable] = {"sin": _plain_sin, "cos": _plain_cos, "abs": abs, "min": min, "max": max}
OVER_INTERVALS: dict[str, Callable] = {
    "sin": lambda degrees: sine(_radians(degrees)),
    "cos": lambda degrees: cosine(_radians(degrees)),
    "abs": abs,
    "min": Interval.minimum,
    "max": Interval.maximum,
}
OPERATORS: dict[type, Callable] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
}
ARGUMENTS = {"sin": 1, "cos": 1, "abs": 1, "min": 2, "max": 2}


@dataclass(frozen=True)
class Animation:
    """How an object moves.

    Attributes:
        text: its steps, as above.
        period_s: when it begins anew: t runs from 0 up to it [s]. For ever if infinite.

    Raises:
        InputError: the text is no motion, or the period is not above 0.
    """

    text: str
    period_s: float = float("inf")

    def __post_init__(self) -> None:
        """Refuse what cannot be read."""
        if not self.period_s > 0:
            raise InputError(f"animation: expected a period above 0 s, found {self.period_s}")
        _ = self._steps

    @cached_property
    def _steps(self) -> list[tuple[str, ast.expr]]:
        steps, at = [], 0
        if len(self.text) > LONGEST:
            raise InputError(f"animation: expected at most {LONGEST} characters, found {len(self.text)}")
        while self.text[at:].strip():
            found = STEP.match(self.text, at)
            if found is None:
                raise InputError(f"animation: expected steps such as '-rz $10 * t$', found {self.text[at:].strip()!r}")
            steps.append((found[1], _term(found[2] if found[3] is None else found[3])))
            at = found.end()
        if not steps:
            raise InputError("animation: expected steps such as '-rz $10 * t$', found none")
        return steps

    def matrix(self, t: float) -> np.ndarray:
        """What takes the definition's vertices to where they are after t seconds, still in its frame, (4, 4), float64.

        Raises:
            InputError: a term divides by zero then.
        """
        now = float(t) % self.period_s
        out = np.eye(4)
        for kind, term in self._steps:
            try:
                amount = _value(term, now, float, PLAIN)
            except ZeroDivisionError:
                raise InputError(f"animation {self.text!r}: expected no division by 0, found one at {t} s") from None
            out = _step_matrix(kind, amount) @ out
        return out

    def swept_box(self, vertices: np.ndarray, transform: np.ndarray, where: str) -> np.ndarray:
        """A box that holds an object at all times, and as it stands unmoved [m], shape (2, 3), float64.

        Args:
            vertices: [m], shape (n, 3), in the definition's frame.
            transform: of the object, shape (4, 4).
            where: what to call it in an error.

        Raises:
            InputError: it does not stay within bounds, or a term may divide by zero.
        """
        ends = np.linspace(0.0, self.period_s, PARTS + 1) if np.isfinite(self.period_s) else np.array([0.0, np.inf])
        # Parts of the period down, vertices across.
        times = Interval(ends[:-1, None], ends[1:, None])
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for begin in range(0, len(vertices), CHUNK):
            unmoved = [Interval(column, column) for column in np.float64(vertices[begin : begin + CHUNK]).T]
            for points in (unmoved, self._moved(unmoved, times)):
                for axis in range(3):
                    row = [Interval.of(value) for value in transform[axis]]
                    there = points[0] * row[0] + points[1] * row[1] + points[2] * row[2] + row[3]
                    low[axis] = np.minimum(low[axis], np.min(there.low))
                    high[axis] = np.maximum(high[axis], np.max(there.high))
        if not (np.isfinite(low).all() and np.isfinite(high).all()):
            raise InputError(f"{where}: expected a motion that stays within bounds, found {self.text!r}")
        return np.array([low, high])

    def _moved(self, points: list[Interval], t: Interval) -> list[Interval]:
        """Where points may be at times of an interval; one interval an axis."""
        x = list(points)
        for kind, term in self._steps:
            amount = _value(term, t, Interval.of, OVER_INTERVALS)
            axes = range(3) if kind == "sa" else ["xyz".index(kind[1])]
            if kind[0] == "r":
                x = _turned(x, axes[0], _radians(amount))
                continue
            for axis in axes:
                x[axis] = x[axis] + amount if kind[0] == "t" else x[axis] * amount
        return x


def _turned(points: list[Interval], axis: int, angle: Interval) -> list[Interval]:
    """Points turned about an axis, no further from it than before."""
    u, v = points[(axis + 1) % 3], points[(axis + 2) % 3]
    c, s = cosine(angle), sine(angle)
    # Above the rounding of the root.
    radius = np.hypot(u.size, v.size) * (1 + 2.0**-40)
    out = list(points)
    out[(axis + 1) % 3] = (c * u - s * v).within(radius)
    out[(axis + 2) % 3] = (s * u + c * v).within(radius)
    return out


def _step_matrix(kind: str, amount: float) -> np.ndarray:
    """One step as a matrix."""
    out = np.eye(4)
    axes = range(3) if kind == "sa" else ["xyz".index(kind[1])]
    if kind[0] == "t":
        out[axes[0], 3] = amount
    elif kind[0] == "s":
        for axis in axes:
            out[axis, axis] = amount
    else:
        u, v = (axes[0] + 1) % 3, (axes[0] + 2) % 3
        c, s = _plain_cos(amount), _plain_sin(amount)
        out[u, u], out[u, v], out[v, u], out[v, v] = c, -s, s, c
    return out


def _term(text: str) -> ast.expr:
    """A term that has nothing but what is allowed in it.

    Raises:
        InputError: it has.
    """
    try:
        term = ast.parse(text.strip(), mode="eval").body
        _check(term)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError(f"animation: expected a term in t, such as 10 * t, found {text!r}") from None
    return term


def _check(term: ast.expr) -> None:
    """Refuse all but arithmetic on t with a ValueError."""
    if isinstance(term, ast.BinOp) and type(term.op) in OPERATORS:
        parts = [term.left, term.right]
    elif isinstance(term, ast.UnaryOp) and isinstance(term.op, ast.USub | ast.UAdd):
        parts = [term.operand]
    elif isinstance(term, ast.Call) and isinstance(term.func, ast.Name) and not term.keywords:
        parts = term.args
        if ARGUMENTS.get(term.func.id) != len(parts):
            raise ValueError
    elif isinstance(term, ast.Name) and term.id in ("t", "pi"):
        parts = []
    elif isinstance(term, ast.Constant) and type(term.value) in (int, float) and abs(term.value) < 1e15:
        parts = []
    else:
        raise ValueError
    for part in parts:
        _check(part)


def _value(term: ast.expr, t: Value, number: Callable[[float], Value], functions: dict[str, Callable]) -> Value:
    """What a checked term comes to: over numbers, or over intervals of them."""
    value = partial(_value, t=t, number=number, functions=functions)
    if isinstance(term, ast.BinOp):
        return OPERATORS[type(term.op)](value(term.left), value(term.right))
    if isinstance(term, ast.UnaryOp):
        return -value(term.operand) if isinstance(term.op, ast.USub) else value(term.operand)
    if isinstance(term, ast.Call):
        return functions[term.func.id](*map(value, term.args))
    if isinstance(term, ast.Name):
        return t if term.id == "t" else number(np.pi)
    return number(term.value)
