"""The whole parts: closed solids (but for a sheet and a pair of bodies) that are reconstructed entirely, for measuring."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from . import machined, shaped


@dataclass(frozen=True)
class WholePart:
    """A part that is measured as a whole.

    Attributes
    ----------
    name : str
    description : str
        What it is and what it tries, one sentence.
    build : callable
        Makes the ``TopoDS_Shape``, in millimetres.
    bodies : int
        Closed solids in it; 0 for a sheet.
    """

    name: str
    description: str
    build: Callable[[], Any]
    bodies: int = 1


WHOLE: dict[str, WholePart] = {
    part.name: part
    for part in (
        WholePart("bracket", "An angle with a gusset and five holes: planes at right angles.", machined.bracket),
        WholePart("filleted_block", "A stepped block with every edge rounded: no sharp edge at all.", shaped.filleted_block),
        WholePart("roof", "A roof with creases of only 10, 15, 20 and 30 degrees.", machined.roof),
        WholePart("turned_part", "A shaft with shoulders, cones, a bore and a round groove: everything coaxial.", machined.turned_part),
        WholePart("flange", "A pipe flange with a conical neck and a circle of six bolt holes.", machined.flange),
        WholePart("freeform_top", "A block under a wavy freeform top that a bore pierces.", shaped.freeform_top),
        WholePart("boss", "A drafted boss with a round foot on a plate: a torus tangent to a plane and a cone.", shaped.boss),
        WholePart("thin_walls", "A tray with walls a few spacings thick, whose far sides come close.", machined.thin_walls),
        WholePart("square_to_round", "A loft from a rounded square to a circle between a base and a collar.", shaped.square_to_round),
        WholePart("bent_pipe", "A pipe with a quarter bend and two flanges, hollow: cylinders tangent to a torus.", shaped.bent_pipe),
        WholePart("wing", "A tapered, twisted wing with a sharp trailing edge and a strongly bent nose.", shaped.wing),
        WholePart("ribs", "A plate with crossing ribs, many narrow faces.", machined.ribs),
        WholePart("ball_stud", "A ball on a tapered neck, six flats and a chamfered shank.", shaped.ball_stud),
        WholePart("handwheel", "A round rim on four round spokes and a hub: creases of changing angle.", shaped.handwheel),
        WholePart("chamfered_block", "A block with every edge chamfered, and three countersunk holes.", machined.chamfered_block),
        WholePart("gear", "A wheel with ten straight-sided teeth, a hub and a keyway.", machined.gear),
        WholePart("slotted_profile", "An extruded profile with a slot on every side: undercuts, inner angles.", machined.slotted_profile),
        WholePart("pocket_plate", "A plate with five round-cornered pockets of several depths.", machined.pocket_plate),
        WholePart("stepped_wedge", "A slanted extrusion with a dovetail and a vee: angles of all sizes.", machined.stepped_wedge),
        WholePart("two_bodies", "A pin with a domed head in a drilled block, not touching: two bodies.", machined.two_bodies, 2),
        WholePart("tee", "Two tubes of unlike width joined with a blend of changing section, hollow.", shaped.tee),
        WholePart("rod", "Two eyes and a web, rounded where they meet, with a pocket.", shaped.rod),
        WholePart("knob", "A domed knob whose grip has eight scallops: a sphere cut by cylinders.", shaped.knob),
        WholePart("vase", "A hollow vessel turned from a smooth profile.", shaped.vase),
        WholePart("cam", "A smooth eccentric disc with a hub and a keyed bore: an extruded curve.", shaped.cam),
        WholePart("mouse", "A freeform body, soft above where a blend joins top and wall, sharp below.", shaped.mouse),
        WholePart("impeller", "Five twisted blades on a bell-shaped hub: freeform meets freeform.", shaped.impeller),
        WholePart("housing", "A hollow box with rounded corners, a rim, posts and openings: some fifty faces.", shaped.housing),
        WholePart("open_panel", "A bent sheet with an opening and a folded flange: its borders are open.", shaped.open_panel, 0),
    )
}
