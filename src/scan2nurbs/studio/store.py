"""Results of stages in files, so that a studio that starts again need not compute them again.

One file a stage, the last result only: an .npz whose member ``said`` is JSON with what `codec.encode` says, the key that the result
follows from, and which software made it; the other members are its arrays. Nothing in it is run when it is read. It is written beside
and put in place as a whole; the archive's check sums tell where bytes are lost. A file that is damaged, or that another version wrote,
is as good as none.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, Literal

import numpy as np

import scan2nurbs
from scan2nurbs.errors import OutputError
from scan2nurbs.io.atomic import atomic_path
from scan2nurbs.report.record import versions
from scan2nurbs.studio.codec import Arrays, decode, encode
from scan2nurbs.studio.inside import is_linked

FOLDER = "results"
Name = Literal["edges", "faces", "corrections", "relations", "topology", "seen-edges", "seen-model"]
NAMES: tuple[Name, ...] = ("edges", "faces", "corrections", "relations", "topology", "seen-edges", "seen-model")
"""What is kept. Not the scan, which is read anew and gives its hash, nor the model's solids, which the CAD kernel's own files round:
they are built again when they are exported. What is seen of edges and model is kept instead of what only the picture needs."""


@cache
def software() -> str:
    """Return which software computes, as a short text: another version may compute something else."""
    digest = hashlib.sha256(json.dumps(versions(), sort_keys=True).encode())
    root = Path(scan2nurbs.__file__).parent
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return f"{metadata.version('scan2nurbs')} {digest.hexdigest()[:16]}"


class Store:
    """The last results of a project.

    Parameters
    ----------
    folder : Path
        Where they lie; made when the first result is kept.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._keys: dict[str, str] = {}
        # Whoever was killed while writing left half a file under a name that nobody reads.
        if not folder.is_symlink():
            for path in folder.glob(".*.npz"):
                path.unlink(missing_ok=True)

    def get(self, name: Name, key: str, results: Mapping[str, Any]) -> tuple[tuple[Any, float] | None, str | None]:
        """Return a result and the seconds that it took, None where there is none; and why a file is of no use, as a sentence.

        Parameters
        ----------
        name : str
        key : str
            What it has to follow from.
        results : dict of str to object
            The results that it may contain, see `codec`.
        """
        path = self._path(name)
        if is_linked(path) or not path.is_file():
            return None, None
        try:
            with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
                said = json.loads(bytes(archive["said"]))
                if said["software"] != software():
                    return None, "What was kept of this step is from another version of the software; it was computed again."
                if said["key"] != key:
                    return None, None
                arrays: Arrays = [archive[f"{k}"] for k in range(len(archive.files) - 1)]
            found = decode(said["result"], results, arrays), float(said["seconds"])
        except Exception:  # bytes of any kind may stand in the file: whatever reading them leads to, the result is computed
            return None, f"What was kept of this step, {FOLDER}/{path.name}, is damaged; it was computed again."
        self._keys[name] = key
        return found, None

    def put(self, name: Name, key: str, result: Any, seconds: float, results: Mapping[str, Any]) -> str | None:
        """Keep a result in place of the one before; return why it cannot be kept, as a sentence."""
        if self._keys.get(name) == key:
            return None
        arrays: Arrays = []
        said = {"software": software(), "key": key, "seconds": seconds, "result": encode(result, results, arrays)}
        members: dict[str, Any] = {f"{k}": array for k, array in enumerate(arrays)}
        members["said"] = np.frombuffer(json.dumps(said).encode(), np.uint8)
        path = self._path(name)
        if is_linked(path):
            return f"What was computed cannot be kept for the next start: {FOLDER}/{path.name} is a link that leads elsewhere."
        try:
            self.folder.mkdir(exist_ok=True)
            with atomic_path(path) as temporary:
                np.savez(temporary, **members)
        except (OSError, OutputError) as error:
            why = error.message if isinstance(error, OutputError) else f"{error.strerror}."
            return f"What was computed cannot be kept for the next start: {why}"
        self._keys[name] = key
        return None

    def _path(self, name: Name) -> Path:
        return self.folder / f"{name}.npz"
