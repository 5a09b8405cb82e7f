"""Messages as JSON, and back again with every field checked: what a page sends is never trusted."""

from __future__ import annotations

import json
from typing import Any, Literal, get_args, get_origin, get_type_hints

from scan2nurbs.errors import ParameterError
from scan2nurbs.report.record import plain
from scan2nurbs.studio.messages import FROM_PAGE, FromPage

_BASIC = {str: str, int: int, float: (int, float), bool: bool}


def to_text(message: Any) -> str:
    """Write a message as JSON, with its class's name as `type`."""
    return json.dumps({"type": type(message).__name__, **plain(message)}, ensure_ascii=False, allow_nan=False)


def from_text(text: str) -> FromPage:
    """Read what a page sent.

    Raises
    ------
    ParameterError
        If it is no JSON, no known message, or a field is missing, unknown or of the wrong type.
    """
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        raise ParameterError("The message is no JSON.") from None
    known = {kind.__name__: kind for kind in FROM_PAGE}
    kind = known.get(str(content.pop("type", None))) if isinstance(content, dict) else None
    if kind is None:
        raise ParameterError(f"The message must be an object with a 'type' of {', '.join(known)}.")
    hints = get_type_hints(kind)
    if set(content) != set(hints):
        raise ParameterError(f"The message {kind.__name__} must have exactly the fields: {', '.join(hints) or 'none'}.")
    for name, value in content.items():
        if not _fits(value, hints[name]):
            raise ParameterError(f"The field '{name}' of the message {kind.__name__} has the wrong type.")
    return kind(**content)


def _fits(value: Any, hint: Any) -> bool:
    if get_origin(hint) is Literal:
        return value in get_args(hint)
    if get_origin(hint) is dict:
        return isinstance(value, dict)
    expected = _BASIC[hint]
    return isinstance(value, expected) and (hint is bool or not isinstance(value, bool))
