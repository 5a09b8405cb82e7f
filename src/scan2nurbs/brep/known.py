"""Remember what earlier attempts computed: the next one changes few borders and faces of a part."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

Result = TypeVar("Result")


class Known:
    """Results by what they were computed from.

    Numbers, texts and bytes count as what they say, all else as the very object that it is; objects are held, so that none takes the
    place of another. Functions that are given the same must return the same, and nobody may change what they return.
    """

    def __init__(self) -> None:
        self._results: dict[tuple[object, ...], Any] = {}
        self._held: list[tuple[object, ...]] = []

    def __call__(self, given: tuple[object, ...], compute: Callable[[], Result]) -> Result:
        """Return the result for what is given; it is computed only the first time."""
        key = tuple(part if isinstance(part, int | float | str | bytes) else ("object", id(part)) for part in given)
        if key not in self._results:
            self._held.append(given)
            self._results[key] = compute()
        return self._results[key]
