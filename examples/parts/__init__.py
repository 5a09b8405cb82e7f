"""The project's own CAD parts, written as code: ``from examples.parts import PARTS, WHOLE`` from the root of the checkout."""

from .figures import FIGURES
from .part import FROM_ABOVE, Part
from .single import SINGLE
from .whole import WHOLE, WholePart

PARTS: dict[str, Part] = {part.name: part for part in (*FIGURES, *SINGLE)}

__all__ = ["FROM_ABOVE", "PARTS", "WHOLE", "Part", "WholePart"]
