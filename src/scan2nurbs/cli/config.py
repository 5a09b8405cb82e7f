"""The parameters of a run: the dataclass's defaults, over them the config file, over it the command line."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_origin, get_type_hints

from scan2nurbs.cli.options import Given, Stage
from scan2nurbs.described import bare_type
from scan2nurbs.errors import InputError, ParameterError

Config = Mapping[str, Mapping[str, Any]]


def read_config(path: Path | None, stages: tuple[Stage, ...]) -> Config:
    """Read a TOML file with one section a stage.

    Raises
    ------
    InputError
        If the file cannot be read or is no TOML.
    ParameterError
        If it holds a section or key that no stage of this command has; the message names file and key.
    """
    if path is None:
        return {}
    try:
        with path.open("rb") as stream:
            config = tomllib.load(stream)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"The config cannot be read: {reason}.", path=path) from error
    known = {stage.section: stage.names() for stage in stages}
    for section, values in config.items():
        if section not in known or not isinstance(values, dict):
            raise ParameterError(f"{path}: The config has an unknown section '{section}'. Known are: {', '.join(known)}.")
        for key in values:
            if key not in known[section]:
                raise ParameterError(
                    f"{path}: The config has an unknown key '{section}.{key}'. Known are: {', '.join(sorted(known[section]))}."
                )
    return config


def parameters(stage: Stage, given: Given, config: Config, path: Path | None = None, **nested: Any) -> Any:
    """Make a stage's parameters; the command line beats the config file.

    Parameters
    ----------
    stage : Stage
        Which parameters.
    given : Given
        What was said on the command line.
    config : mapping
        What `read_config` returned for `path`.
    path : Path, optional
        The config file, which errors name.
    **nested
        Parameters of stages inside this one.
    """
    from_file = {key: _from_toml(stage, key, value, path) for key, value in config.get(stage.section, {}).items()}
    try:
        return stage.params(**(from_file | given.of(stage) | nested))
    except (ParameterError, TypeError):
        _check(stage, from_file, path)
        raise


def _check(stage: Stage, values: Mapping[str, Any], path: Path | None) -> None:
    """Blame the file, not the command line, for a value that is out of range without what the command line says."""
    try:
        stage.params(**values)
    except (ParameterError, TypeError) as error:
        raise ParameterError(f"{path}: In the section '{stage.section}': {error}") from error


def _from_toml(stage: Stage, key: str, value: Any, path: Path | None) -> Any:
    kind = bare_type(get_type_hints(stage.params)[key])
    if key in stage.parse and isinstance(value, str):
        return stage.parse[key](value)
    if isinstance(value, list):
        return _as_tuple(value)
    if kind is float and type(value) in (int, float):
        return float(value)
    if kind in (int, float, bool, str) and type(value) is not kind:
        raise ParameterError(f"{path}: The key '{stage.section}.{key}' must be {_article(kind)}. Got {value!r} instead.")
    if get_origin(kind) is tuple and not isinstance(value, tuple):
        raise ParameterError(f"{path}: The key '{stage.section}.{key}' must be a list. Got {value!r} instead.")
    return value


def _as_tuple(value: Any) -> Any:
    return tuple(_as_tuple(item) for item in value) if isinstance(value, list) else value


def _article(kind: type) -> str:
    return {int: "an integer", float: "a number", bool: "true or false", str: "a text"}[kind]
