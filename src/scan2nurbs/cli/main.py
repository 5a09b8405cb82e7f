"""The console command `scan2nurbs`: find the command, run it, turn what goes wrong into one sentence and an exit code."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from inspect import getdoc
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from scan2nurbs import __version__
from scan2nurbs.cli.failures import Interrupted, exit_code, interruptible, sentence

COMMANDS = {
    "info": ("info", "Say what a scan holds: points, extent, unit, spacing, noise."),
    "edges": ("edges", "Mark the points of a scan that lie on an edge."),
    "surface": ("surface", "Rebuild one functional surface as a trimmed NURBS face."),
    "simulate": ("simulate", "Scan a CAD part with a simulated scanner."),
    "segment": ("segment", "Split a scan into faces."),
    "convert": ("convert", "Rebuild a whole part as one CAD model."),
    "studio": ("studio", "See and correct every stage in the browser."),
}
"""For each command the module of this package that runs it, and what the overview says of it."""

EXIT_CODES = (
    "Exit codes: 0 done · 2 wrong usage · 3 the input cannot be read or used · 4 no result could be made · 130 interrupted. "
    "An output file appears whole or not at all."
)


class LazyCommands(TyperGroup):
    """Commands whose modules, and the libraries behind them, are imported only when one of them runs."""

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Replace the overview's entry by the real command."""
        name, _, rest = super().resolve_command(ctx, args)
        return name, load(str(name)), rest


def load(name: str) -> Any:
    """Import a command and build its parser."""
    module = import_module(f"scan2nurbs.cli.{COMMANDS[name][0]}")
    command = getattr(module, name)
    paragraphs = [" ".join(paragraph.split()) for paragraph in (getdoc(command) or "").split("\n\n")]
    single = typer.Typer(add_completion=False, rich_markup_mode="rich", pretty_exceptions_enable=False)
    single.command(name=name, help="\n\n".join(paragraphs), context_settings=getattr(module, "CONTEXT", None))(command)
    return typer.main.get_command(single)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"scan2nurbs {__version__}")
        raise typer.Exit


def _overview(
    version: Annotated[bool, typer.Option("--version", help="Say the version and stop.", callback=_show_version, is_eager=True)] = False,
) -> None:
    """From a raw 3D scan to an editable CAD model: trimmed NURBS faces in a STEP file, with measured deviations."""


def build() -> typer.Typer:
    """Build the parser without importing any command."""
    app = typer.Typer(cls=LazyCommands, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None, epilog=EXIT_CODES)
    app.callback()(_overview)
    for name, (_, text) in COMMANDS.items():
        app.command(name=name, help=text)(lambda: None)
    return app


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    try:
        with interruptible():
            build()(args=arguments, prog_name="scan2nurbs")
    except (Exception, Interrupted, KeyboardInterrupt) as error:
        # The one place that catches everything: a user gets a sentence, --debug gets the traceback.
        if "--debug" in arguments and not isinstance(error, Interrupted):
            raise_with_traceback(error)
        sys.stderr.write(f"scan2nurbs: {sentence(error)}\n")
        sys.exit(exit_code(error))


def raise_with_traceback(error: BaseException) -> None:
    """Print the traceback and leave with the error's exit code."""
    import traceback  # noqa: PLC0415

    traceback.print_exception(error)
    sys.exit(exit_code(error))
