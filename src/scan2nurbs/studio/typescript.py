"""The page's types, made of the messages: ``python -m scan2nurbs.studio.typescript FILE`` writes them."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from types import NoneType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from scan2nurbs.studio import messages

_HEAD = "// Made of src/scan2nurbs/studio/messages.py by `python -m scan2nurbs.studio.typescript`: do not edit.\n"
_BASIC = {str: "string", int: "number", float: "number", bool: "boolean", NoneType: "null", Any: "unknown"}


def typescript() -> str:
    """Return the source of the page's types."""
    kinds = [kind for kind in vars(messages).values() if isinstance(kind, type) and dataclasses.is_dataclass(kind)]
    parts = [_HEAD, f"export const STEPS = {_list(messages.STEPS)} as const;", "export type Step = (typeof STEPS)[number];\n"]
    parts += [_interface(kind) for kind in kinds]
    for name, members in (("FromServer", messages.FROM_SERVER), ("FromPage", messages.FROM_PAGE)):
        union = " | ".join(f'({{ type: "{kind.__name__}" }} & {kind.__name__})' for kind in members)
        parts.append(f"export type {name} = {union};\n")
    return "\n".join(parts)


def _interface(kind: type) -> str:
    hints = get_type_hints(kind)
    doc = (kind.__doc__ or "").split("\n", maxsplit=1)[0]
    fields = [f"  {field.name}: {_type(hints[field.name])};" for field in dataclasses.fields(kind)]
    if not fields:
        return f"/** {doc} */\nexport type {kind.__name__} = Record<never, never>;\n"
    return "\n".join([f"/** {doc} */", f"export interface {kind.__name__} {{", *fields, "}\n"])


def _type(hint: Any) -> str:
    if get_origin(hint) is Literal:
        return "Step" if get_args(hint) == messages.STEPS else " | ".join(f'"{choice}"' for choice in get_args(hint))
    if get_origin(hint) is list:
        inner = _type(get_args(hint)[0])
        return f"({inner})[]" if " " in inner else f"{inner}[]"
    if get_origin(hint) is dict:
        return f"Record<string, {_type(get_args(hint)[1])}>"
    if dataclasses.is_dataclass(hint):
        return getattr(hint, "__name__", "")
    return _BASIC[hint] if hint in _BASIC else " | ".join(_type(part) for part in get_args(hint))


def _list(names: tuple[str, ...]) -> str:
    return "[" + ", ".join(f'"{name}"' for name in names) + "]"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(typescript(), encoding="utf-8")
