"""Parts with one functional surface of known kind, for measuring: each rises from a ground plate, so that its border has to be found."""

from __future__ import annotations

from typing import Any

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeWire
from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections
from OCP.collections import HArray1_gp_Pnt
from OCP.GeomAPI import GeomAPI_Interpolate
from OCP.gp import gp_Pnt
from OCP.TopoDS import TopoDS_Compound

from scan2nurbs.brep.cad import tessellate

from . import modelling as m
from .part import Part


def _pedestal(height: m.Height, outline: np.ndarray, *, smooth: bool, draft: float = 8.0, holes: tuple[np.ndarray, ...] = ()) -> Any:
    """Cut a drafted block by a height field and stand it on a plate whose top is z = 0; outlines are those at the highest point."""
    low, high = outline.min(axis=0) - 25, outline.max(axis=0) + 25
    x, y = (low[0], high[0]), (low[1], high[1])
    inside = np.concatenate([outline * share for share in np.linspace(0, 1, 12)])
    roof = float(height(inside[:, 0], inside[:, 1]).max()) + 5
    block = m.common(m.walls(outline, -2.0, roof, smooth=smooth, draft=draft), m.below(m.height_surface(height, x, y), 200.0))
    block = m.cut(block, [m.walls(hole, -1.0, roof, smooth=True, draft=-draft) for hole in holes])
    return m.fuse(block, m.box((low[0] + 5, high[0] - 5), (low[1] + 5, high[1] - 5), (-6.0, 0.0)))


def _dome(x: Any, y: Any) -> Any:
    return 34 - x**2 / 110 - y**2 / 70 + 0.8 * np.sin(x / 9)


def _bowl(x: Any, y: Any) -> Any:
    return 12 + x**2 / 90 + y**2 / 60 + 0.6 * np.cos(x / 10 + y / 14)


def _saddle(x: Any, y: Any) -> Any:
    return 24 + x**2 / 75 - y**2 / 75


def _ring_top(x: Any, y: Any) -> Any:
    r, t = np.hypot(x, y), np.arctan2(y, x)
    # Near the middle the wave around the axis fades, where its angle is not defined.
    return 24 - (r - 27) ** 2 / 40 + 2.5 * np.cos(2 * t) * (r / 30) ** 2 / (1 + (r / 30) ** 2)


def _waves(x: Any, y: Any) -> Any:
    return 20 + 3.5 * np.sin(x / 14) * np.cos(y / 17) - x * y / 400


def convex() -> Any:
    return _pedestal(_dome, m.ellipse(42, 30, power=2.6), smooth=True)


def concave() -> Any:
    return _pedestal(_bowl, m.ellipse(40, 32, power=2.6), smooth=True)


def ring() -> Any:
    return _pedestal(_ring_top, m.ellipse(42, 38), smooth=True, holes=(m.ellipse(15, 15, 24),))


def saddle() -> Any:
    return _pedestal(_saddle, m.ellipse(34, 34, power=2.3), smooth=True)


def star() -> Any:
    return _pedestal(_waves, m.star(48, 24), smooth=False, draft=5.0)


def l_shape() -> Any:
    outline = np.array([(-40, -35), (40, -35), (40, -8), (-10, -8), (-10, 40), (-40, 40)], float)
    return _pedestal(_waves, outline, smooth=False, draft=5.0)


def u_shape() -> Any:
    outline = np.array([(-42, -35), (42, -35), (42, 35), (18, 35), (18, -10), (-18, -10), (-18, 35), (-42, 35)], float)
    return _pedestal(_waves, outline, smooth=False, draft=5.0)


def half_tube() -> Any:
    """Loft arcs of more than a half turn along a bent axis; the ground cuts them at about 180 degrees."""
    job = BRepOffsetAPI_ThruSections(True, False, 1e-6)
    for s in np.linspace(-1, 1, 9):
        centre, radius = np.array([45 * s, 6 * (1 - s**2), 0.0]), 15 + 2.5 * np.sin(2.2 * s)
        across = np.array([12 * s, 45, 0.0]) / np.hypot(12 * s, 45)
        angle = np.radians(np.linspace(-18, 198, 25))
        arc = centre + radius * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * [0, 0, 1])
        points = HArray1_gp_Pnt(1, len(arc))
        for i, p in enumerate(arc):
            points.SetValue(i + 1, gp_Pnt(*map(float, p)))
        curve = GeomAPI_Interpolate(points, False, 1e-7)
        curve.Perform()
        chord = BRepBuilderAPI_MakeEdge(gp_Pnt(*map(float, arc[-1])), gp_Pnt(*map(float, arc[0]))).Edge()
        job.AddWire(BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(curve.Curve()).Edge(), chord).Wire())
    job.Build()
    return m.fuse(job.Shape(), m.box((-62, 62), (-42, 46), (-9.0, 0.0)))


def _blade_point(u: Any, v: Any) -> np.ndarray:
    """Twisted by 45 degrees from root to tip, cambered, rolled over at the leading edge (v = 1)."""
    chord, twist = 54 - 14 * u, np.radians(-20 + 45 * u)
    along = 0.5 * chord * v
    up = chord * (0.08 * (1 - v**2) - 0.07 * np.maximum((v - 0.6) / 0.4, 0) ** 3)
    return np.stack([90 * u - 45, along * np.cos(twist) - up * np.sin(twist), 26 + along * np.sin(twist) + up * np.cos(twist)], axis=-1)


def blade() -> Any:
    u, v = np.meshgrid(np.linspace(0, 1, 24), np.linspace(-1, 1, 36), indexing="ij")
    body = m.below(m.surface(_blade_point(u, v)), 80.0)
    body = m.common(body, m.box((-60, 60), (-60, 60), (-2.0, 90.0)))
    return m.fuse(body, m.box((-62, 62), (-45, 45), (-6.0, 0.0)))


def open_strip() -> Any:
    """Make a raised band whose ends lie on the border of the scan: no walls there, and none is scanned."""
    outline = np.array([(-60, -20), (60, -20), (60, 20), (-60, 20)], float)
    top = m.below(m.height_surface(_dome, (-90, 90), (-60, 60)), 200.0)
    band = m.common(m.walls(outline, -2.0, 40.0, smooth=False, draft=10.0), top)
    solid = m.common(m.fuse(band, m.box((-60, 60), (-40, 40), (-6.0, 0.0))), m.box((-36, 36), (-80, 80), (-20.0, 90.0)))
    part = tessellate(solid)
    return _only(solid, [i for i in range(len(part.faces)) if _kept(part, i)])


def _kept(part: Any, face: int) -> bool:
    """Tell whether a face is neither an end of the band nor the side or bottom of its plate."""
    points = part.corners[part.face == face].reshape(-1, 3)
    flat = np.ptp(points, axis=0) < 1e-6
    return not (flat[0] or flat[1] or points[:, 2].max() < -1)


def _only(shape: Any, faces: list[int]) -> Any:
    from scan2nurbs.brep.cad import _faces_of

    every, builder, kept = _faces_of(shape), BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(kept)
    for i in faces:
        builder.Add(kept, every[i])
    return kept


def _on(height: m.Height, x: float, y: float) -> tuple[float, float, float]:
    return (x, y, float(height(np.float64(x), np.float64(y))))


SINGLE = (
    Part("convex", "A strongly bent dome with a smooth outline.", convex, _on(_dome, 2, 1)),
    Part("concave", "A bowl with a smooth outline.", concave, _on(_bowl, 2, 1)),
    Part("ring", "An annular top between an inner hole and an outer wall.", ring, _on(_ring_top, 26, 3)),
    Part("half_tube", "A bent tube whose surface turns by 180 degrees and meets the ground.", half_tube, (0.0, 6.0, 15.0)),
    Part("saddle", "A saddle with slopes up to 45 degrees.", saddle, _on(_saddle, 1, 2)),
    Part("blade", "A twisted, cambered strip that rolls over at one side.", blade, tuple(map(float, _blade_point(0.5, 0.1)))),
    Part("star", "A wavy top with a five-pointed outline: sharp corners, not convex.", star, _on(_waves, 1, 2)),
    Part("l_shape", "A wavy top with an L-shaped outline.", l_shape, _on(_waves, -20, -20)),
    Part("u_shape", "A wavy top with a U-shaped outline: its centroid lies outside.", u_shape, _on(_waves, 0, -22)),
    Part(
        "open_strip",
        "A raised band that ends at the border of the scan on two sides, where no wall bounds it.",
        open_strip,
        _on(_dome, 2, 1),
    ),
)
