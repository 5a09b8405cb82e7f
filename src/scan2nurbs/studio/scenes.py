"""What is seen of each step: the arrays that the page draws, and the figures beside them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.part_mesh import mesh_part
from scan2nurbs.cloud import PointCloud
from scan2nurbs.edges.detect import Edges
from scan2nurbs.edges.network import edge_network
from scan2nurbs.faces.topology import Topology
from scan2nurbs.part import Model
from scan2nurbs.part_faces import Parted, by_topology, deviations
from scan2nurbs.part_report import face_records
from scan2nurbs.report.colours import face_colours
from scan2nurbs.scale import Scale
from scan2nurbs.studio.frames import pack
from scan2nurbs.studio.messages import FaceEntry, Figure, Step, StepResult
from scan2nurbs.studio.stages import Stages

Floats = NDArray[np.float64]
Scene = tuple[StepResult, list[bytes]]


class Scenes:
    """Makes the scene of a step from what its stages gave.

    Attributes
    ----------
    stages : Stages
        Holds the results.
    """

    def __init__(self, stages: Stages) -> None:
        self.stages = stages

    def scene(self, step: Step, key: str, model: Model | None = None) -> Scene:
        """Return what is shown of a step.

        Parameters
        ----------
        step : str
        key : str
            What the result follows from.
        model : Model, optional
            For the last step, unless it was seen before.
        """
        makers: dict[str, Callable[[str], Scene]] = {
            "scan": self._scan,
            "edges": self._edges,
            "faces": self._faces,
            "surfaces": self._surfaces,
        }
        if model is not None:
            makers["model"] = lambda key: self._model(key, model)

        def make() -> Scene:
            start, before = time.perf_counter(), self.stages.seconds.get(step, 0.0)
            result, frames = makers[step](key)
            # Drawing curves takes as long as finding edges; what is seen of the other steps is quick to make of their results.
            drawing = time.perf_counter() - start if step == "edges" else 0.0
            return replace(result, seconds=round(before + drawing, 3)), frames

        result, frames = self.stages.scene(step, key, make) if step in ("edges", "model") else make()
        return replace(result, warnings=[*result.warnings, *self.stages.notes.get(step, [])]), frames

    def _result(self, step: Step, key: str, figures: Sequence[tuple[str, str]], **more: Any) -> StepResult:
        shown = [Figure(label=label, value=value) for label, value in figures]
        empty: dict[str, Any] = {"warnings": [], "automatic": {}, "faces": []}
        return StepResult(step=step, key=key, seconds=0.0, figures=shown, **(empty | more))

    def _scan(self, key: str) -> Scene:
        cloud: PointCloud = self.stages.results["read"]
        scale: Scale = self.stages.results["scale"]
        low, high = cloud.points.min(axis=0), cloud.points.max(axis=0)
        size = " × ".join(f"{side:.4g}" for side in high - low)
        figures = [
            ("Points", f"{len(cloud.points):,}"),
            ("Extent", f"{size} {cloud.unit}"),
            ("Spacing h", f"{scale.h:.3g} {cloud.unit}"),
            ("Noise", f"{scale.noise:.2g} {cloud.unit}"),
            ("Format", cloud.format.split()[0].upper() + cloud.format[len(cloud.format.split()[0]) :]),
        ]
        figures += [("Rows that are no point", f"{cloud.n_invalid:,}")] if cloud.n_invalid else []
        figures += [("Duplicates", f"{cloud.n_duplicates:,}")] if cloud.n_duplicates else []
        arrays: dict[str, NDArray[Any]] = {"points": cloud.points.astype(np.float32)}
        if len(cloud.rows) != len(cloud.points):
            rows = np.full(len(cloud.points), -1, np.int32)
            real = np.flatnonzero(cloud.rows >= 0)[::-1]
            rows[cloud.rows[real]] = real  # the first row of each point is written last
            arrays["rows"] = rows
        x, y, z = cloud.origin.tolist()
        numbers = {"h": scale.h, "noise": scale.noise, "x": x, "y": y, "z": z}
        frame = pack("cloud", key, arrays, numbers)
        return self._result("scan", key, figures, warnings=[*cloud.notes], automatic={"scan.unit": cloud.unit}), [frame]

    def _edges(self, key: str) -> Scene:
        cloud: PointCloud = self.stages.results["read"]
        scale: Scale = self.stages.results["scale"]
        found: Edges = self.stages.results["edges"]
        edges: Edges = self.stages.results.get("boundary", found)
        network = edge_network(cloud.points, scale, edges.mask)
        corrected = np.zeros(len(edges.mask), np.uint8)
        corrected[edges.mask & ~found.mask] = 1
        corrected[~edges.mask & found.mask] = 2
        arrays: dict[str, NDArray[Any]] = {"strength": edges.strength.astype(np.float32), "corrected": corrected}
        # Unit normals in a byte a coordinate, for shading; the middle stands for none.
        arrays["normals"] = np.round(np.nan_to_num(edges.normal) * 127.0 + 128.0).astype(np.uint8)
        arrays |= _lines("curves", [_polyline(edge.curve.sample(0.5 * scale.h), edge.curve.closed) for edge in network.curves])
        arrays["corners"] = network.corners.astype(np.float32)
        if edges.dn is not None and edges.vdn_small is not None and edges.vdn_large is not None and edges.runs[0][0] == "edn":
            arrays["dn"] = edges.dn.astype(np.float32)
            arrays["vdn"] = np.fmax(edges.vdn_small, edges.vdn_large).astype(np.float32)
        length = sum(edge.curve.length for edge in network.curves)
        figures = [
            ("Edge points", f"{int(edges.mask.sum()):,} of {len(edges.mask):,}"),
            ("Threshold δ", f"{edges.threshold:.3g}°"),
            ("Curves", f"{len(network.curves)}, {length:.4g} {cloud.unit} long"),
            ("Corners", f"{len(network.corners)}"),
        ]
        if corrected.any():
            figures.insert(1, ("By hand", f"{int((corrected == 1).sum()):,} added, {int((corrected == 2).sum()):,} taken away"))
        frame = pack("edges", key, arrays, {"threshold": edges.threshold})
        return self._result("edges", key, figures, automatic={"edges.threshold": edges.threshold}), [frame]

    def _parted(self) -> Parted:
        results = self.stages.results
        if "corrections" in results:
            return results["corrections"]
        faces = results["faces"]
        edges = results.get("boundary", results["edges"])
        return Parted(results["read"], results["scale"], edges, faces, np.arange(len(faces.fits), dtype=np.int32), len(faces.fits))

    def _faces(self, key: str) -> Scene:
        parted = self._parted()
        n = len(parted.faces.fits)
        deviation = deviations(parted.cloud.points, parted.faces.label, parted.faces.fits, np.ones(n, np.int8))
        entries = _entries(parted, deviation)
        unit, none = parted.cloud.unit, int((parted.faces.label < 0).sum())
        figures = [
            ("Faces", f"{n}"),
            ("Types", _types(entries)),
            ("Points without a face", f"{none:,} ({none / len(deviation):.1%})"),
            ("Deviation", _rms(deviation, unit)),
        ]
        frame = pack("faces", key, _point_arrays(parted, deviation))
        automatic = {"segment.tolerance": 3.0 * parted.scale.noise}
        result = self._result("faces", key, figures, warnings=[*parted.faces.notes], faces=entries, automatic=automatic)
        return result, [frame]

    def _surfaces(self, key: str) -> Scene:
        topology: Topology = self.stages.results["topology"]
        related = self.stages.results.get("relations")
        parted = self._parted()
        if related is not None:
            parted = replace(parted, faces=replace(parted.faces, fits=related.fits))
        parted = by_topology(parted, topology)
        deviation = deviations(parted.cloud.points, parted.faces.label, parted.faces.fits, topology.outward)
        entries = _entries(parted, deviation)
        relations = () if related is None else related.relations
        figures = [
            ("Surfaces", _types(entries)),
            ("Relations made exact", f"{len(relations)}"),
            ("Borders", f"{len(topology.borders)}, {sum(-1 in border.faces for border in topology.borders)} free"),
            ("Bodies", f"{len(topology.closed)}, {sum(topology.closed)} closed"),
            ("Deviation", _rms(deviation, parted.cloud.unit)),
        ]
        notes = [*(() if related is None else related.notes), *topology.notes]
        arrays = _point_arrays(parted, deviation) | _sheet(parted, topology) | _nets(parted)
        return self._result("surfaces", key, figures, warnings=notes, faces=entries), [pack("surfaces", key, arrays)]

    def _model(self, key: str, model: Model) -> Scene:
        part, unit = model.part, model.cloud.unit
        mesh = mesh_part(part)
        inner = [edge.points for edge in part.edges if -1 not in edge.faces]
        free = [edge.points for edge in part.edges if -1 in edge.faces]
        arrays = _point_arrays(model, model.deviation)
        arrays["triangles"] = mesh.corners.astype(np.float32).reshape(-1, 3)
        arrays["triangle_faces"] = model.numbers[mesh.face].astype(np.int32)
        arrays |= _lines("edges", inner) | _lines("free", free)
        solids = f"{part.n_solids} closed solid{'s' if part.n_solids != 1 else ''}"
        figures = [
            ("Check", "valid" if part.valid else "NOT valid"),
            ("Body", solids if part.closed else f"open: {part.n_free_edges} free edge{'s' if part.n_free_edges != 1 else ''}"),
            ("Faces", f"{len(part.faces)}"),
            ("Edges", f"{len(part.edges)}, largest tolerance {part.max_tolerance:.2g} {unit}"),
            ("Volume", f"{part.volume:.5g} {unit}³" if part.closed else "none: the body is open"),
            ("Coverage", f"{part.coverage:.1%} of the scan on it"),
            ("Precision", f"{part.precision:.1%} of it on the scan"),
            ("Deviation", _rms(model.deviation, unit)),
        ]
        entries = _entries(model, model.deviation)
        result = self._result("model", key, figures, warnings=list(model.report["warnings"]), faces=entries)
        return result, [pack("model", key, arrays)]


def _point_arrays(parted: Parted, deviation: Floats) -> dict[str, NDArray[Any]]:
    numbers = np.append(parted.numbers, np.int32(-1))
    return {"face": numbers[parted.faces.label].astype(np.int32), "deviation": deviation.astype(np.float32)}


def _entries(parted: Parted, deviation: Floats) -> list[FaceEntry]:
    colours = face_colours(int(parted.numbers.max(initial=-1)) + 1)
    return [
        FaceEntry(
            number=record["number"],
            name=record["name"],
            kind=record["type"],
            parameters=record["parameters"],
            n_points=record["n_points"],
            rms=record["rms"],
            largest=record["max"],
            tolerance=record["tolerance"],
            n_control_points=record["n_control_points"],
            colour=colours[record["number"]].tolist(),
            notes=record["notes"],
        )
        for record in face_records(parted, parted.faces.fits, deviation, None)
    ]


def _types(entries: Sequence[FaceEntry]) -> str:
    kinds = [entry.kind for entry in entries]
    counted = sorted(set(kinds), key=lambda kind: (-kinds.count(kind), kind))
    return ", ".join(f"{kinds.count(kind)} {kind}" for kind in counted) or "none"


def _rms(deviation: Floats, unit: str) -> str:
    off = np.abs(deviation[np.isfinite(deviation)])
    return f"rms {np.sqrt(np.mean(off**2)):.3g} {unit}, largest {off.max():.3g} {unit}" if len(off) else "none"


def _sheet(parted: Parted, topology: Topology) -> dict[str, NDArray[Any]]:
    """Return the mesh that the faces' borders were read off, each face's vertices moved onto its surface."""
    corners = topology.mesh.vertices[topology.mesh.triangles]
    for face, fit in enumerate(parted.faces.fits[: topology.n_faces]):
        own = topology.mesh.face == face
        corners[own] = fit.shape.foot(corners[own].reshape(-1, 3)).reshape(-1, 3, 3)
    arrays: dict[str, NDArray[Any]] = {
        "triangles": corners.astype(np.float32).reshape(-1, 3),
        "triangle_faces": parted.numbers[topology.mesh.face].astype(np.int32),
    }
    inner = [border.points for border in topology.borders if -1 not in border.faces]
    free = [border.points for border in topology.borders if -1 in border.faces]
    return arrays | _lines("edges", inner) | _lines("free", free)


def _nets(parted: Parted) -> dict[str, NDArray[Any]]:
    """Return the control nets of all B-spline surfaces as line segments."""
    lines: list[Floats] = []
    for fit in parted.faces.fits:
        surface = getattr(fit.shape, "surface", None)
        net = None if surface is None else np.asarray(surface.control_points)
        if net is not None and net.ndim == 3:
            lines += [*net, *np.moveaxis(net, 1, 0)]
    return _lines("nets", lines)


def _lines(name: str, lines: Sequence[Floats]) -> dict[str, NDArray[Any]]:
    """Return polylines as the ends of their segments, (2 S, 3)."""
    return {name: np.concatenate([np.zeros((0, 3)), *_segments(lines)]).astype(np.float32)}


def _segments(lines: Sequence[Floats]) -> Iterator[Floats]:
    for line in lines:
        yield np.repeat(line, 2, axis=0)[1:-1]


def _polyline(points: Floats, closed: bool) -> Floats:
    return np.concatenate([points, points[:1]]) if closed else points
