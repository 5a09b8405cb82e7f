"""Whole parts as a machine shop makes them: planes, cylinders, cones, chamfers, holes, extruded and turned profiles."""

from __future__ import annotations

from typing import Any

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.TopoDS import TopoDS_Compound

from . import modelling as m
from . import solids as s


def bracket() -> Any:
    profile = [(0, 0), (70, 0), (70, 10), (10, 10), (10, 55), (0, 55)]
    angle = s.extrude(s.polygon([(x, -25, z) for x, z in profile]), (0, 50, 0))
    gusset = s.extrude(s.polygon([(9, -5, 9), (42, -5, 9), (9, -5, 42)]), (0, 10, 0))
    holes = [s.cylinder((55, y, -1), 5, 12) for y in (-14, 14)] + [s.cylinder((-1, 0, 47), 4, 12, (1, 0, 0))]
    return m.cut(m.fuse(angle, gusset), [*holes, s.cylinder((-1, 16, 30), 4, 12, (1, 0, 0)), s.cylinder((-1, -16, 30), 4, 12, (1, 0, 0))])


def roof() -> Any:
    """Bend the roof by 10, 15, 20 and 30 degrees at four creases."""
    headings, lengths = np.radians([40, 30, 15, -5, -35]), (22, 22, 26, 22, 22)
    steps = np.column_stack([np.cos(headings), np.sin(headings)]) * np.array(lengths)[:, None]
    top = np.array([0, 14]) + np.concatenate([[(0, 0)], np.cumsum(steps, axis=0)])
    profile = [*map(tuple, top), (top[-1, 0], 0), (0, 0)]
    return s.extrude(s.polygon([(x, -35, z) for x, z in profile]), (0, 70, 0))


def turned_part() -> Any:
    outline = [(0, 0), (18, 0), (20, 2), (20, 22), (32, 22), (32, 32), (24, 40), (24, 62), (14, 72), (14, 95), (12, 97), (0, 97)]
    shaft = s.turned(outline)
    groove = s.torus((0, 0, 51), 25, 4)
    return m.cut(shaft, [groove, s.cylinder((0, 0, -1), 8, 40)])


def flange() -> Any:
    disc = m.fuse(s.cylinder((0, 0, 0), 50, 12), s.cone((0, 0, 12), 30, 24, 24), s.cylinder((0, 0, 36), 24, 10))
    bolts = s.around(s.cylinder((38, 0, -1), 5, 14), 6)
    return m.cut(disc, [*bolts, s.cylinder((0, 0, -1), 16, 60)])


def thin_walls() -> Any:
    tray = m.cut(m.box((0, 90), (0, 60), (0, 35)), [m.box((2.5, 87.5), (2.5, 57.5), (2.5, 36))])
    return m.fuse(tray, m.box((44, 46.5), (1, 59), (1, 28)), m.box((45, 89), (30, 32.5), (1, 20)))


def ribs() -> Any:
    plate = m.box((0, 100), (0, 70), (0, 6))
    along = [m.box((4, 96), (y, y + 4), (5, 22)) for y in (12, 33, 54)]
    across = [m.box((x, x + 4), (4, 66), (5, 16)) for x in (28, 68)]
    return m.fuse(plate, *along, *across)


def chamfered_block() -> Any:
    block = s.chamfer(m.box((0, 80), (0, 60), (0, 34)), 4.0)
    sinks = []
    for x, y in ((20, 18), (60, 18), (40, 42)):
        sinks += [s.cylinder((x, y, -1), 5, 40), s.cone((x, y, 26), 5, 13, 8.001)]
    return m.cut(block, sinks)


def gear() -> Any:
    """Cut ten straight-sided teeth into a wheel with a hub, a bore and a keyway."""
    teeth = []
    for k in range(10):
        turn = 2 * np.pi * k / 10
        teeth += [(r * np.cos(turn + a), r * np.sin(turn + a)) for r, a in ((36, -0.20), (50, -0.09), (50, 0.09), (36, 0.20))]
    wheel = s.prism(teeth, 0, 22)
    hub = s.cylinder((0, 0, 21), 22, 14)
    return m.cut(m.fuse(wheel, hub), [s.cylinder((0, 0, -1), 11, 40), m.box((0, 15), (-3.5, 3.5), (-1, 40))])


def slotted_profile() -> Any:
    """Extrude a square profile with a T-slot on every side and a bore."""
    quarter = np.array([(-22, -22), (-6, -22), (-6, -16), (-12, -16), (-6, -9), (6, -9), (12, -16), (6, -16), (6, -22)])
    turns = [np.array([(np.cos(a), -np.sin(a)), (np.sin(a), np.cos(a))]) for a in np.arange(4) * np.pi / 2]
    outline = np.concatenate([quarter @ turn.T for turn in turns])
    return m.cut(s.prism(outline, 0, 60), [s.cylinder((0, 0, -1), 5, 62)])


def pocket_plate() -> Any:
    """Mill round-cornered pockets of several depths into a plate."""
    plate = m.box((0, 120), (0, 80), (0, 18))
    rooms = (((8, 40), (8, 50), 6), ((48, 78), (8, 34), 4), ((86, 112), (8, 72), 10), ((8, 40), (56, 72), 12), ((48, 78), (42, 72), 8))
    tools = [s.fillet(m.box(x, y, (floor, 20)), 5.0, s.upright) for x, y, floor in rooms]
    return m.cut(plate, [*tools, s.cylinder((63, 57, -1), 7, 20), s.cylinder((24, 28, -1), 6, 20)])


def two_bodies() -> Any:
    """Set a pin with a domed head into a drilled block, without touching it."""
    block = m.cut(m.box((-35, 35), (-25, 25), (0, 30)), [s.cylinder((0, 0, -1), 14, 40)])
    pin = m.fuse(s.cylinder((0, 0, -12), 9, 70), m.common(s.sphere((0, 0, 48), 24), m.box((-40, 40), (-40, 40), (58, 90))))
    pin = m.fuse(pin, s.cylinder((0, 0, 44), float(np.sqrt(24**2 - 10**2)), 14))
    builder, both = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(both)
    builder.Add(both, block)
    builder.Add(both, pin)
    return both


def stepped_wedge() -> Any:
    """Cut a dovetail, a vee and a slanted top into a block: dihedral angles of 45 to 150 degrees, none of them 90."""
    profile = [(0, 0), (25, 0), (15, 12), (55, 12), (45, 0), (90, 0), (90, 22), (76, 34), (62, 22), (48, 46), (20, 52), (0, 36)]
    return s.extrude(s.polygon([(x, 0, z) for x, z in profile]), (8, 60, 0))
