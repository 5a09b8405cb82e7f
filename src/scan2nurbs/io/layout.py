"""How numbers stand in lines of text."""

from __future__ import annotations

from dataclasses import dataclass

COMMENT = (b"#", b"//", b"%", b"!")
"""What a line that is no row may begin with; the first may also stand behind a row."""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """How the numbers stand in the lines.

    Attributes
    ----------
    columns : (int, int, int)
        Which columns are x, y and z.
    width : int or None
        How many columns every row has; None where rows may have any number that reaches the three.
    separator : bytes or None
        What stands between columns; None for any white space.
    decimal_comma : bool
        Whether 1,5 means 1.5.
    """

    columns: tuple[int, int, int] = (0, 1, 2)
    width: int | None = None
    separator: bytes | None = None
    decimal_comma: bool = False
