"""The report as one HTML file that needs nothing else: made from the JSON and the pictures."""

from __future__ import annotations

import base64
import datetime
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import PurePath
from typing import Any

import jinja2
from markupsafe import Markup

from scan2nurbs.report.pictures import Picture
from scan2nurbs.report.record import plain, to_json

# These have a place of their own on the page; every other object of the JSON becomes a table under its name.
PLACED = ("schema", "warnings", "seconds", "versions", "parameters", "peak_memory_mb", "outputs")
_LONGEST_LIST = 12


def render_html(record: Mapping[str, Any], pictures: Sequence[Picture] = (), headline: Sequence[tuple[str, str]] = ()) -> str:
    """Make the page.

    Parameters
    ----------
    record : mapping
        What `--json` prints; any object that `report.record.plain` accepts.
    pictures : sequence of Picture
        In the order in which they are shown; they become part of the file.
    headline : sequence of (name, value)
        The few figures that answer the question, ready to be read.

    Returns
    -------
    str
        The HTML text; all names and texts in it are escaped.
    """
    said = plain(record)
    content = dict.fromkeys(PLACED) | {"input": {}} | said
    shared = {name: value for name, value in content.items() if name not in PLACED}
    tables = {name: list(rows(value)) for name, value in shared.items() if isinstance(value, dict) and value}
    # A list of one reads better from top to bottom; of several, side by side without what is nested in them.
    tables |= {name: list(rows(value[0])) for name, value in shared.items() if _is_table(value) and len(value) == 1}
    lists = {name: [_flat(item) for item in value] for name, value in shared.items() if _is_table(value) and len(value) > 1}
    # "<" in a text of the JSON must not end the script element that holds it.
    raw = Markup(to_json(said).replace("<", "\\u003c"))
    return _template().render(
        command=([*str(content["schema"]).split("/"), "report"])[1],
        record=content,
        name=PurePath(content["input"].get("path", "scan2nurbs")).name,
        tables=tables,
        lists=lists,
        parameters={name: list(rows(value)) for name, value in (content["parameters"] or {}).items()},
        pictures=[(picture, base64.b64encode(picture.png).decode("ascii")) for picture in pictures],
        headline=headline,
        raw=raw,
        pretty=to_json(said),
        made=datetime.datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
    )


def rows(value: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """List the members of an object, those of objects inside it under joined names."""
    for name, item in value.items():
        label = f"{prefix}{name}".replace("_", " ")
        if isinstance(item, dict):
            yield from rows(item, f"{label}, ")
        else:
            yield label, item


def shown(value: Any) -> str:
    """Write a value as a reader expects it: four digits, thousands set apart, a dash for nothing."""
    if value is None or value in ("", [], {}):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return f"{value:.4g}" if isinstance(value, float) else f"{value:,}".replace(",", "\u202f")
    if isinstance(value, list):
        more = f", … ({len(value)})" if len(value) > _LONGEST_LIST else ""
        between = "\n" if isinstance(value[0], dict) else ", "
        return between.join(shown(item) for item in value[:_LONGEST_LIST]) + more
    if isinstance(value, dict):
        return ", ".join(f"{name.replace('_', ' ')} {shown(item)}" for name, item in value.items())
    return str(value)


def _is_table(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, dict) for item in value)


def _flat(item: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in item.items() if not isinstance(value, dict | list)}


@cache
def _template() -> jinja2.Template:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("scan2nurbs.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["shown"] = shown
    return environment.get_template("report.html")
