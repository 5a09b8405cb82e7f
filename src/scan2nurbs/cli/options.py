"""Options made from the parameter dataclasses: one option a field, its help from the dataclass's docstring."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Annotated, Any, Literal, get_origin, get_type_hints

import typer

from scan2nurbs.cli.common import Common, common_parameters
from scan2nurbs.described import bare_type, describe
from scan2nurbs.errors import ParameterError


@dataclasses.dataclass(frozen=True, kw_only=True)
class Stage:
    """A parameter dataclass on the command line and in the config file.

    Attributes
    ----------
    section : str
        Name of the TOML section and of the key below "parameters" in the JSON.
    params : type
        The frozen dataclass; every field has a default.
    panel : str
        Heading in the help.
    options : mapping of str to str
        Names of options that differ from their field's, e.g. where two stages have a field of one name.
    shown : frozenset of str, optional
        Fields that have an option; all unless given. The config file can set the others too.
    nested : frozenset of str
        Fields that are stages of their own, with their own section.
    parse : mapping of str to callable
        For fields that are no number, word or flag: makes the value from the option's text.
    metavars : mapping of str to str
        What the help calls such a value.
    """

    section: str
    params: type
    panel: str
    options: Mapping[str, str] = dataclasses.field(default_factory=dict)
    shown: frozenset[str] | None = None
    nested: frozenset[str] = frozenset()
    parse: Mapping[str, Callable[[str], Any]] = dataclasses.field(default_factory=dict)
    metavars: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def names(self) -> list[str]:
        """Return the fields that the config file can set."""
        return [field.name for field in dataclasses.fields(self.params) if field.init and field.name not in self.nested]

    def fields(self) -> list[dataclasses.Field[Any]]:
        """Return the fields that have an option."""
        shown = self.names() if self.shown is None else self.shown
        return [field for field in dataclasses.fields(self.params) if field.name in shown and field.name not in self.nested]

    def key(self, field: str) -> str:
        """Return the name under which the field's option reaches the command."""
        return self.options.get(field, field).replace("-", "_")


@dataclasses.dataclass(frozen=True)
class Given:
    """What was said on the command line, besides a command's own arguments."""

    common: Common
    values: Mapping[str, Any]

    def of(self, stage: Stage) -> dict[str, Any]:
        """Return the fields of a stage that were given, as the dataclass takes them."""
        said = {field.name: self.values[stage.key(field.name)] for field in stage.fields()}
        return {
            name: stage.parse[name](value) if name in stage.parse and isinstance(value, str) else value
            for name, value in said.items()
            if value is not None
        }


def takes(*stages: Stage) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the common options and those of `stages`; what was said arrives as its keyword argument ``given``."""

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command, eval_str=True)
        kept = [parameter for parameter in own.parameters.values() if parameter.name != "given"]
        made = [option_for(stage, field) for stage in stages for field in stage.fields()]
        common = common_parameters()

        @wraps(command)
        def run(**arguments: Any) -> None:
            said = {option.name: arguments.pop(option.name) for option in made}
            switches = {option.name: arguments.pop(option.name) for option in common}
            command(**arguments, given=Given(Common(**switches), said))

        run.__annotations__ = {}
        run.__signature__ = own.replace(parameters=[*kept, *made, *common])  # type: ignore[attr-defined] - typer asks functions for it
        return run

    return decorate


def option_for(stage: Stage, field: dataclasses.Field[Any]) -> inspect.Parameter:
    """Make the option of one field; None means that it was not given."""
    kind = bare_type(get_type_hints(stage.params)[field.name])
    text = field.metadata.get("help") or describe(stage.params).get(field.name, "")
    if field.metadata.get("unit"):
        text = f"{text}, in units of {field.metadata['unit']}" if field.metadata["unit"] != "degrees" else f"{text}, in degrees"
    if re.match(r"[a-z][a-z-]+\b(?!_)", text):  # but not a formula's letter
        text = text[0].upper() + text[1:]
    text = text.rstrip(".")
    default = field.default if field.default is not dataclasses.MISSING else None
    if default is not None and kind is not bool:
        shown = ",".join(f"{part:g}" for part in default) if isinstance(default, tuple) else default
        text = f"{text} (default: {shown})"
    # The help is read as rich markup, in which "[" opens a tag.
    flag = "--" + stage.options.get(field.name, field.name).replace("_", "-")
    decls = [f"{flag}/--no-{flag[2:]}"] if kind is bool else [flag]
    known = kind in (int, float, bool, str) or get_origin(kind) is Literal
    metavar = None if known else stage.metavars.get(field.name, "TEXT")
    option = typer.Option(*decls, help=text.replace("[", r"\["), rich_help_panel=stage.panel, show_default=False, metavar=metavar)
    annotation = Annotated[(kind if known else str) | None, option]
    return inspect.Parameter(stage.key(field.name), inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)


def place(text: str) -> tuple[float, float, float]:
    """Read three numbers separated by commas, such as "1, 0, 2.5"."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise ParameterError(f"Three numbers separated by commas are expected, such as '1,0,2.5'. Got {text!r} instead.") from None
    return x, y, z
