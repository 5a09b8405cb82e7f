"""Length units as files name them, and as `Scan.unit` does."""

from __future__ import annotations

import re

_NAMES = {
    "mm": ("mm", "millimeter", "millimeters", "millimetre", "millimetres"),
    "cm": ("cm", "centimeter", "centimeters", "centimetre", "centimetres"),
    "m": ("m", "meter", "meters", "metre", "metres"),
    "um": ("um", "µm", "μm", "micron", "microns", "micrometer", "micrometers", "micrometre", "micrometres"),
    "in": ("in", "inch", "inches"),
    "ft": ("ft", "foot", "feet"),
}
_UNIT_OF = {name: unit for unit, names in _NAMES.items() for name in names}
_STATEMENT = re.compile(r"\bunits?\b[\s=:\"'(]*(?:(?:in|is|are)\s+)?([a-zµμ]+)", re.IGNORECASE)


def unit_of(name: str) -> str | None:
    """Return the unit that a word names, e.g. "mm" for "Millimetres"; None for any other word."""
    return _UNIT_OF.get(name.strip().lower())


def unit_in(text: str) -> str | None:
    """Return the unit that a comment states, as in "length unit = meters"; None where it states none."""
    for found in _STATEMENT.finditer(text):
        unit = unit_of(found[1])
        if unit is not None:
            return unit
    return None
