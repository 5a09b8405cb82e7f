"""Whole parts with blends, lofts, sweeps and freeform faces, as they are moulded, cast, forged or bent."""

from __future__ import annotations

from typing import Any

import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_Sewing
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.gp import gp_Circ, gp_Vec

from . import modelling as m
from . import solids as s


def filleted_block() -> Any:
    return s.fillet(m.cut(m.box((0, 70), (0, 50), (0, 36)), [m.box((40, 71), (-1, 51), (20, 37))]), 5.0)


def freeform_top() -> Any:
    top = lambda x, y: 26 + 5 * np.sin(x / 16) * np.cos(y / 19) - x**2 / 500 - y**2 / 400  # noqa: E731
    solid = m.common(m.box((-45, 45), (-32, 32), (0, 60)), m.below(m.height_surface(top, (-60, 60), (-50, 50)), 90.0))
    return m.cut(solid, [s.cylinder((18, 4, -1), 9, 60)])


def boss() -> Any:
    """Stand a drafted boss on a plate, with a round foot and a stepped hole."""
    solid = m.fuse(m.box((-45, 45), (-35, 35), (0, 10)), s.cone((0, 0, 10), 22, 18, 30))
    solid = s.fillet(solid, 6.0, lambda p: s.at(2, 10)(p) and bool(np.hypot(p[:, 0], p[:, 1]).max() < 23))
    return m.cut(solid, [s.cylinder((0, 0, -1), 6, 60), s.cylinder((0, 0, 26), 11, 30)])


def square_to_round() -> Any:
    """Loft from a rounded square to a circle, between a flat end and a collar."""
    n = 48
    turn = np.arange(n) * 2 * np.pi / n
    sections = []
    for share in (0.0, 0.33, 0.67, 1.0):
        square, circle = m.ellipse(34, 34, n, power=6.0), np.column_stack([22 * np.cos(turn), 22 * np.sin(turn)])
        eased = share * share * (3 - 2 * share)
        sections.append(m.wire((1 - eased) * square + eased * circle, 10 + 50 * share, smooth=True))
    return m.fuse(s.loft(sections), m.box((-40, 40), (-40, 40), (0, 10)), s.cylinder((0, 0, 60), 28, 8))


def bent_pipe() -> Any:
    """Bend a pipe by 90 degrees between two flanges."""
    bend = [(40 - 40 * np.cos(a), 0, 40 + 40 * np.sin(a)) for a in (0, np.pi / 4, np.pi / 2)]

    def along(radius: float) -> Any:
        straight = s.cylinder((0, 0, -1), radius, 41)
        elbow = s.revolve(_circle((0, 0, 40), radius), (40, 0, 40), (0, 1, 0), np.pi / 2)
        return m.fuse(straight, elbow, s.cylinder(bend[-1], radius, 26, (1, 0, 0)))

    solid = m.fuse(along(14), s.cylinder((0, 0, 0), 26, 8), s.cylinder((58, 0, 80), 26, 8, (1, 0, 0)))
    return m.cut(solid, [along(10)])


def _circle(centre: s.Point, radius: float) -> Any:
    return s.wire(BRepBuilderAPI_MakeEdge(gp_Circ(s.axes(centre, s.Z), radius)).Edge())


def wing() -> Any:
    """Loft tapered, twisted aerofoils: a sharp trailing edge and a strongly bent nose."""
    x = (1 - np.cos(np.linspace(0, np.pi, 25))) / 2
    half = 0.8 * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
    camber = 0.12 * x * (1 - x)
    outline = np.concatenate([np.column_stack([x, camber + half])[::-1], np.column_stack([x, camber - half])[1:]])
    sections = []
    for span, chord, twist in ((0, 70, 0), (35, 60, -3), (70, 50, -7), (105, 40, -12)):
        a = np.radians(twist)
        flat = (outline - [0.3, 0]) * chord @ np.array([(np.cos(a), np.sin(a)), (-np.sin(a), np.cos(a))])
        points = np.column_stack([flat[:, 0] + 0.25 * span, np.full(len(flat), span), flat[:, 1]])
        sections.append(s.wire(s.spline(points[: len(x)]), s.spline(points[len(x) - 1 :])))
    return s.loft(sections)


def ball_stud() -> Any:
    """Join a ball, a tapered neck and a shank by a collar with six flats."""
    collar = s.prism([(24 * np.cos(a), 24 * np.sin(a)) for a in np.arange(6) * np.pi / 3], 0, 14)
    solid = m.fuse(s.sphere((0, 0, 48), 20), s.cone((0, 0, 14), 16, 10, 30), collar, s.cylinder((0, 0, -40), 11, 40))
    return s.chamfer(solid, 2.0, s.at(2, -40))


def handwheel() -> Any:
    """Join a round rim to a hub by four spokes."""
    solid = m.fuse(s.torus((0, 0, 0), 50, 8), s.cylinder((0, 0, -12), 15, 28), *s.around(s.cylinder((10, 0, 0), 5, 40, (1, 0, 0)), 4))
    return m.cut(solid, [s.cylinder((0, 0, -13), 7, 40)])


def tee() -> Any:
    """Join two round tubes of unlike width with a blend between them."""
    solid = m.fuse(s.cylinder((-55, 0, 0), 20, 110, (1, 0, 0)), s.cylinder((0, 0, 0), 14, 50))
    solid = s.fillet(solid, 5.0, lambda p: bool(np.abs(p[:, 0]).max() < 15 and p[:, 2].min() > 13 and p[:, 2].max() < 21))
    return m.cut(solid, [s.cylinder((-56, 0, 0), 15, 112, (1, 0, 0)), s.cylinder((0, 0, 0), 10, 51)])


def rod() -> Any:
    """Connect two eyes by a waisted web, with round edges where they meet it."""
    web = m.box((0, 100), (-9, 9), (6, 18))
    solid = m.fuse(s.cylinder((0, 0, 0), 26, 24), s.cylinder((100, 0, 2), 17, 20), web)
    solid = s.fillet(solid, 5.0, lambda p: s.upright(p) and 10 < p[0, 0] < 95)
    return m.cut(solid, [s.cylinder((0, 0, -1), 16, 30), s.cylinder((100, 0, -1), 9, 30), m.box((36, 74), (-5, 5), (14, 20))])


def knob() -> Any:
    """Turn a knob with a domed top, and scallop its grip by eight grooves."""
    dome = m.common(s.sphere((0, 0, -20), 60), s.cylinder((0, 0, -10), 30, 60))
    grooves = s.around(s.cylinder((33, 0, 6), 7, 60), 8)
    solid = m.cut(dome, grooves)
    return m.cut(m.fuse(solid, s.cylinder((0, 0, -22), 13, 13)), [s.cylinder((0, 0, -23), 7, 30)])


def vase() -> Any:
    """Turn a smooth profile into a hollow vessel with a flat rim and foot."""
    z = np.linspace(0, 90, 9)
    r = 24 + 10 * np.sin(z / 20) - 0.08 * z
    outer = np.column_stack([r, 0 * z, z])
    inner = np.column_stack([r - 5, 0 * z, z])[1:][::-1]
    edges = (
        s.spline(outer),
        s.line(outer[-1], inner[0]),
        s.spline(inner),
        s.line(inner[-1], (0, 0, inner[-1, 2])),
        s.line((0, 0, inner[-1, 2]), (0, 0, 0)),
        s.line((0, 0, 0), outer[0]),
    )
    return s.revolve(s.wire(*edges))


def cam() -> Any:
    """Extrude a smooth, eccentric outline; a hub and a keyed bore."""
    turn = np.arange(40) * 2 * np.pi / 40
    r = 30 + 9 * np.cos(turn) + 4 * np.cos(2 * turn)
    plate = m.walls(np.column_stack([r * np.cos(turn), r * np.sin(turn)]), 0.0, 18.0, smooth=True)
    return m.cut(m.fuse(plate, s.cylinder((0, 0, 17), 18, 13)), [s.cylinder((0, 0, -1), 9, 40), m.box((0, 12.5), (-3, 3), (-1, 40))])


def mouse() -> Any:
    """Round the edge between a freeform top and a smooth side wall: soft above, sharp below."""
    top = lambda x, y: 27 - x**2 / 160 - y**2 / 110 + x / 9  # noqa: E731
    body = m.common(
        m.walls(m.ellipse(48, 30, 32, power=2.5), 0.0, 70.0, smooth=True), m.below(m.height_surface(top, (-70, 70), (-55, 55)), 90.0)
    )
    return s.fillet(body, 6.0, lambda p: bool(p[:, 2].min() > 1 and np.ptp(p[:, 0]) > 20))


def impeller() -> Any:
    """Set five twisted blades on a bell-shaped hub."""
    z = np.linspace(0, 46, 8)
    r = 14 + 36 * (1 - z / 46) ** 2.2
    curve = np.column_stack([r, 0 * z, z])
    hub = s.revolve(s.wire(s.spline(curve), s.line(curve[-1], (0, 0, 46)), s.line((0, 0, 46), (0, 0, 0)), s.line((0, 0, 0), curve[0])))
    sections = []
    for radius in np.linspace(9, 48, 7):
        lean, low, high = np.radians(1.1 * (radius - 9)), 0.5, 44 - 0.45 * radius
        foot, across = radius * np.array([np.cos(lean), np.sin(lean)]), np.array([-np.sin(lean), np.cos(lean)])
        # Every section lies in a plane across the radius, leaning backwards in it.
        places = ((-1.6, low), (1.6, low), (1.6 + 0.3 * radius, high), (-1.6 + 0.3 * radius, high))
        sections.append(s.polygon([(*(foot + aside * across), height) for aside, height in places]))
    blade = s.loft(sections)
    return m.cut(m.fuse(hub, *s.around(blade, 5)), [s.cylinder((0, 0, -1), 8, 60)])


def housing() -> Any:
    """Hollow a rounded box, give it a rim, four screw posts and two round openings."""
    outer = s.fillet(m.box((0, 100), (0, 70), (0, 45)), 10.0, s.upright)
    outer = s.fillet(outer, 4.0, s.at(2, 0))
    inner = s.fillet(m.box((4, 96), (4, 66), (4, 46)), 6.0, s.upright)
    rim = s.fillet(m.box((-6, 106), (-6, 76), (39, 45)), 14.0, s.upright)
    shell = m.cut(m.fuse(outer, rim), [inner])
    posts = [s.cylinder((x, y, 3), 7, 36) for x in (16, 84) for y in (16, 54)]
    drills = [s.cylinder((x, y, 12), 3.5, 40) for x in (16, 84) for y in (16, 54)]
    return m.cut(m.fuse(shell, *posts), [*drills, s.cylinder((-1, 35, 22), 10, 6, (1, 0, 0)), s.cylinder((50, -1, 22), 8, 6, (0, 1, 0))])


def open_panel() -> Any:
    """Bend a sheet without thickness: a freeform field with an opening, a flange folded down along one side."""
    height = lambda x, y: 12 - x**2 / 300 - y**2 / 500 + 1.5 * np.sin(x / 20)  # noqa: E731
    field = m.cut(s.face_of(m.height_surface(height, (-60, 60), (-40, 40))), [s.cylinder((15, 5, -20), 14, 60)])
    (side,) = s.edges(field, s.at(1, -40))
    flange = BRepPrimAPI_MakePrism(side, gp_Vec(0, -4, -18)).Shape()
    job = BRepBuilderAPI_Sewing(1e-3)
    job.Add(field)
    job.Add(flange)
    job.Perform()
    return job.SewedShape()
