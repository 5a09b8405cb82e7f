"""scan2nurbs studio: see every stage in the browser, correct it by hand, take the model away."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from scan2nurbs.errors import MissingExtraError, ParameterError

NEEDED = ("starlette", "uvicorn", "websockets")


def studio(
    scan: Annotated[
        Path | None, typer.Argument(metavar="[SCAN]", help="The scan, or the folder of a project; without it, drop a scan on the page.")
    ] = None,
    project: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the project; beside the scan, named as it with .s2n, unless given.")
    ] = None,
    port: Annotated[int, typer.Option(metavar="N", help="Port to listen on; a free one unless given.", min=0, max=65535)] = 0,
    host: Annotated[str, typer.Option(metavar="ADDRESS", help="Address to listen on; others let other machines in.")] = "127.0.0.1",
    no_open: Annotated[bool, typer.Option("--no-open", help="Do not open the browser.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """See and correct every stage in the browser.

    The studio prints its address on a line of its own and opens the browser. What is done there is kept in the project's folder at once;
    `scan2nurbs convert --project DIR` does the same again and gives the same STEP file. Stop it with Ctrl-C.
    """
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise MissingExtraError("The studio", "studio")
    from scan2nurbs.studio.launch import is_local, serve  # noqa: PLC0415
    from scan2nurbs.studio.project import FILE, create_project, open_project  # noqa: PLC0415

    opened = None
    if project is not None and scan is not None and scan.is_dir() and not (project.exists() and project.samefile(scan)):
        raise ParameterError(f"Two projects are given: {scan} and {project}. Leave out one of them.")
    if project is not None and scan is None and not (project / FILE).exists():
        raise ParameterError(f"There is no project in {project} yet: give the scan that it is to be made of, too.")
    if scan is not None and scan.is_dir():
        opened = open_project(scan, check=True)
    elif scan is not None:
        opened = create_project(scan, project)
    elif project is not None:
        opened = open_project(project, check=True)
    if not is_local(host):
        typer.echo(
            f"scan2nurbs: warning: the studio listens on {host}: every machine that reaches it and knows the address with its token can "
            "change this project, and what is sent is not encrypted.",
            err=True,
        )
    serve(opened, host=host, port=port, home=Path.cwd(), opens=not no_open, say=typer.echo)
