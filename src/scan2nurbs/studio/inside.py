"""Files of a project lie in its folder: no link leads the studio out of it, or from one of them to another."""

from __future__ import annotations

from pathlib import Path


def is_linked(path: Path) -> bool:
    """Tell whether a symbolic link stands where a file of a project, or the folder in which it lies, belongs."""
    return path.is_symlink() or path.parent.is_symlink()


def refusal(path: Path, project: Path) -> str:
    """Say that nothing is written through a link, as a sentence."""
    name = path.relative_to(project).as_posix()
    return f"Nothing is written there: {name} is a link, or lies behind one; put a file or folder in its place."
