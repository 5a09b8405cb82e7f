"""One wording for every parameter that lies outside its range."""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import Any

from scan2nurbs.errors import ParameterError


def require_float(value: Any, name: str, owner: str, low: float, high: float = math.inf, *, closed: str = "") -> None:
    """Raise `ParameterError` unless a value is a number between `low` and `high`.

    Parameters
    ----------
    value : object
        What was given.
    name, owner : str
        The parameter and the function it belongs to, for the message.
    low, high : float
        Ends of the range.
    closed : str
        "low", "high" or "both" for ends that belong to the range.
    """
    number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    above = number > low or (number == low and closed in ("low", "both"))
    below = number < high or (number == high and closed in ("high", "both"))
    if not (above and below):
        left, right = "[" if closed in ("low", "both") else "(", "]" if closed in ("high", "both") else ")"
        raise ParameterError(f"The '{name}' parameter of {owner} must be a float in {left}{low:g}, {high:g}{right}. Got {value!r} instead.")


def require_int(value: Any, name: str, owner: str, low: int, high: float = math.inf) -> None:
    """Raise `ParameterError` unless a value is an int of at least `low` and at most `high`."""
    if not isinstance(value, Integral) or isinstance(value, bool) or not low <= int(value) <= high:
        right = "inf)" if high == math.inf else f"{high:g}]"
        raise ParameterError(f"The '{name}' parameter of {owner} must be an int in [{low}, {right}. Got {value!r} instead.")


def require_instance(value: Any, name: str, owner: str, kind: type) -> None:
    """Raise `ParameterError` unless a value is an instance of a class."""
    if not isinstance(value, kind):
        raise ParameterError(f"The '{name}' parameter of {owner} must be a {kind.__name__}. Got {value!r} instead.")


def require_choice(value: Any, name: str, owner: str, choices: tuple[str, ...]) -> None:
    """Raise `ParameterError` unless a value is one of the choices."""
    if value not in choices:
        raise ParameterError(f"The '{name}' parameter of {owner} must be one of {', '.join(choices)}. Got {value!r} instead.")
