"""What a parameter dataclass says of itself: the types of its fields, and what its docstring tells of each."""

from __future__ import annotations

import inspect
import re
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin


def bare_type(hint: Any) -> Any:
    """Return the type without None: ``float | None`` gives float."""
    if get_origin(hint) in (Union, UnionType):
        kinds = [kind for kind in get_args(hint) if kind is not NoneType]
        return kinds[0] if len(kinds) == 1 else object
    return hint


def describe(params: type) -> dict[str, str]:
    """Read what a numpydoc docstring says of each attribute or parameter, one line each."""
    texts: dict[str, list[str]] = {}
    current: list[str] = []
    section = ""
    lines = (inspect.getdoc(params) or "").splitlines()
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if following and not following.strip("-"):
            section = line.strip()
        elif section not in ("Attributes", "Parameters") or (line and not line.strip("-")):
            continue
        elif entry := re.match(r"(\w+(?:, \w+)*)\s*:", line):
            current = []
            texts |= dict.fromkeys(entry[1].split(", "), current)
        elif line.strip():
            current.append(line.strip())
    return {name: " ".join(said).replace("`", "") for name, said in texts.items()}
