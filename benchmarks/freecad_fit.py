"""The B-spline fit of FreeCAD's Reverse Engineering workbench, run by a Python of its own: nothing but FreeCAD is imported here.

    PYTHON benchmarks/freecad_fit.py POINTS.json OUT.json POLES

PYTHON is one that finds FreeCAD (Debian: python3 with the package libfreecad-python3). Writes the seconds that the fit took and the point
of the surface nearest to each of the points.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

# Where Debian keeps FreeCAD's modules.
sys.path += [f"/usr/lib/{home}/{part}" for home in ("freecad-python3", "freecad") for part in ("lib", "Mod")]


def main() -> None:
    import FreeCAD
    import ReverseEngineering

    source, out, poles = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    points = [tuple(row) for row in json.loads(source.read_text())]
    start = time.perf_counter()
    # Its smoothing stays on: without it the equations lack rank over holes, and it finds nothing.
    surface = ReverseEngineering.approxSurface(Points=points, NbUPoles=poles, NbVPoles=poles, Iterations=4, Correction=True)
    seconds = time.perf_counter() - start
    feet = [tuple(surface.value(*surface.parameter(FreeCAD.Vector(*point)))) for point in points]
    out.write_text(json.dumps({"seconds": seconds, "feet": feet, "version": ".".join(FreeCAD.Version()[:3])}))


if __name__ == "__main__":
    main()
