"""Where compiled kernels are kept between processes, and when what is kept there is out of date."""

from __future__ import annotations

import hashlib
import logging
import os
import tempfile
from functools import cache
from pathlib import Path

logger = logging.getLogger(__name__)

STAMP = "kernels.sha256"


@cache
def can_be_kept() -> bool:
    """Tell whether Numba finds a place for its cache; where it does not, caching would raise at import."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return True
    home = Path(os.path.expanduser("~"))
    # In a new home Numba makes the folder itself.
    for folder in (Path(__file__).parent, home / ".cache" if (home / ".cache").exists() else home):
        try:
            with tempfile.TemporaryFile(dir=folder):
                return True
        except OSError:
            continue
    logger.info("no writable place for compiled kernels: they are compiled anew in every process")
    return False


@cache
def forget_outdated(folder: Path) -> None:
    """Delete the indices of kernels that were compiled from other sources, so that they are compiled anew.

    Numba compares a kernel with the text of its own file, and goes on using it when a kernel of another file changes that was compiled
    into it: after an update, old and new kernels would work together. So all are forgotten when one file of kernels changes.

    Parameters
    ----------
    folder : Path
        Where Numba keeps the kernels of one folder of sources.
    """
    sources = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        sources.update(path.read_bytes())
    stamp, now = folder / STAMP, sources.hexdigest()
    try:
        if stamp.exists() and stamp.read_text() == now:
            return
        for index in folder.glob("*.nbi"):
            index.unlink(missing_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=folder, delete=False) as new:
            new.write(now)
        os.replace(new.name, stamp)
    except OSError as error:
        logger.info("kernels compiled before may be out of date: %s", error)
