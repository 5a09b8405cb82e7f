"""How to look for edges: the parameters of every operator."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, fields, replace
from typing import Any

from scan2nurbs.errors import ParameterError

OPERATORS = ("auto", "crease", "one-sided", "dn", "vdn", "edn")


_NORMALS = ("dn", "vdn", "edn")


def _about(
    default: Any, help: str, unit: str = "", low: float | None = None, high: float | None = None, *, of: tuple[str, ...] = OPERATORS
) -> Any:
    """Describe a parameter; `of` are the operators that use it."""
    return field(default=default, metadata={"help": help, "unit": unit, "low": low, "high": high, "of": of})


@dataclass(frozen=True, kw_only=True)
class EdgeParams:
    """Parameters of `detect_edges`; without arguments everything is chosen from the cloud.

    Radii of the paper's operators (dn, vdn, edn) are in units of d̄, the mean distance to the nearest other point; the radius of
    the one-sided normals is in units of h, the noise-stable spacing. With ``absolute=True`` all of them are in the cloud's unit.

    Attributes
    ----------
    operator : {"auto", "crease", "one-sided", "dn", "vdn", "edn"}
        "crease" asks how wide a bend is, marks thin edges where it is sharp, and the ends of the scan; "one-sided", its
        first pass, compares one-sided normals, and marks bands where the surface bends sharply, narrow roundings and smooth steps
        included. Both withstand noise. The others are those of the paper, exactly. "auto" is "crease" where edges are wanted, and
        "one-sided" where they bound a surface.
    radius : float, optional
        Radius of the one-sided normals, (0, inf); None chooses it from the noise.
    reach : float, optional
        "crease" marks the points up to this far from the crease, in h, (0, inf); None: 0.6, and the nearest point to each place on it.
    small_radius, large_radius : float
        r_s and r_l of the paper's operators, (0, inf), r_s < r_l. VDN by itself uses r_l.
    absolute : bool
        Whether radii are lengths in the cloud's unit.
    exact : bool
        Whether the paper's operators sum every point; else small cells stand for the points in VDN of balls of more than about 500,
        and in normals of balls of more than about 2,500, which moves normals by less than half a degree (docs/performance.md).
    alpha : float
        Weight α of DN in EDN, [0, 1].
    beta : float, optional
        Weight β of VDN in EDN, [0, 1]; 1 − α unless given.
    threshold : float, optional
        δ in degrees, [0, 90]; a point is on an edge where its strength is larger. None: 20 for the paper's operators, 12 for
        "crease", chosen from the noise for "one-sided".
    sectors : int
        g of VDN, [2, 64]; 4 is Algorithm 1.
    repeat : int
        How often the operator runs, each time on the points that the previous run kept, [1, 100].
    sequence : str, optional
        Operators to run one after the other instead, such as "vdn*3, dn".
    """

    operator: str = _about(
        "auto",
        "crease (thin edges where faces meet sharply), one-sided (bands where the surface bends sharply), dn, vdn or edn as in the paper; "
        "auto: crease where edges are wanted, one-sided where they bound a surface",
    )
    radius: float | None = _about(
        None, "radius of the one-sided normals; from the noise unless given", "h", 0.0, math.inf, of=("auto", "crease", "one-sided")
    )
    reach: float | None = _about(
        None, "how far from a crease points are marked; 0.6 unless given", "h", 0.0, math.inf, of=("auto", "crease")
    )
    small_radius: float = _about(1.5, "r_s of dn and edn", "d̄", 0.0, math.inf, of=("dn", "edn"))
    large_radius: float = _about(10.0, "r_l of dn, vdn and edn", "d̄", 0.0, math.inf, of=_NORMALS)
    absolute: bool = _about(False, "radii are lengths in the cloud's unit")
    exact: bool = _about(False, "sum every point of balls of thousands, instead of small cells", of=_NORMALS)
    alpha: float = _about(0.4, "weight α of DN in EDN", "", 0.0, 1.0, of=("edn",))
    beta: float | None = _about(None, "weight β of VDN in EDN; 1 − α unless given", "", 0.0, 1.0, of=("edn",))
    threshold: float | None = _about(None, "δ: strength above which a point is on an edge", "degrees", 0.0, 90.0)
    sectors: int = _about(4, "g: parts of a neighbourhood that VDN compares", "", 2, 64, of=("vdn", "edn"))
    repeat: int = _about(1, "runs of the operator, each on what the previous one kept", "", 1, 100)
    sequence: str | None = _about(None, 'operators to run one after the other, such as "vdn*3, dn"')

    def __post_init__(self) -> None:
        """Check every range."""
        if self.operator not in OPERATORS:
            raise ParameterError(f"The 'operator' of detect_edges must be one of {', '.join(OPERATORS)}. Got {self.operator!r} instead.")
        for f in fields(self):
            low, high = f.metadata["low"], f.metadata["high"]
            value = getattr(self, f.name)
            if low is None or value is None:
                continue
            whole = isinstance(f.default, int)
            closed = high != math.inf
            good = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
            if not good or not (low <= value <= high if closed else low < value < high):
                kind, span = ("an int" if whole else "a float"), (f"[{low:g}, {high:g}]" if closed else "(0, inf)")
                raise ParameterError(f"The '{f.name}' parameter of detect_edges must be {kind} in {span}. Got {value!r} instead.")
        if not self.small_radius < self.large_radius:
            raise ParameterError(
                "The 'small_radius' of detect_edges must be smaller than the 'large_radius'. "
                f"Got {self.small_radius:g} and {self.large_radius:g} instead."
            )
        if self.beta is not None and abs(self.alpha + self.beta - 1.0) > 1e-9:
            raise ParameterError(f"The weights of EDN must satisfy alpha + beta = 1. Got {self.alpha:g} + {self.beta:g} instead.")
        self.runs()

    def resolved(self, automatic: str) -> EdgeParams:
        """Return the same parameters with the operator "auto" replaced."""
        return replace(self, operator=automatic) if self.operator == "auto" else self

    def idle(self) -> frozenset[str]:
        """Return the names of the parameters that make no difference for the operators that run."""
        runs = set(self.runs())
        unused = {f.name for f in fields(self) if runs.isdisjoint(f.metadata["of"])}
        return frozenset(unused if self.sequence is None else unused | {"operator", "repeat"})

    def runs(self) -> tuple[str, ...]:
        """Return the operators to run, in order."""
        if self.sequence is None:
            return (self.operator,) * self.repeat
        runs: list[str] = []
        named = [name for name in OPERATORS if name != "auto"]
        for part in self.sequence.split(","):
            match = re.fullmatch(r"\s*([a-z-]+)\s*(?:\*\s*(\d{1,3}))?\s*", part)
            if match is None or match[1] not in named:
                raise ParameterError(
                    f"The 'sequence' of detect_edges must read like 'vdn*3, dn' with the operators {', '.join(named)}. "
                    f"Got {self.sequence!r} instead."
                )
            runs += [match[1]] * int(match[2] or 1)
        if not runs:
            raise ParameterError("The 'sequence' of detect_edges must name at least one operator.")
        return tuple(runs)
