"""Everything that server and page say to each other: the one schema, of which the page's types are generated.

Text frames hold one of these as JSON, with its class's name as `type`; arrays travel in binary frames, see `frames`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

Step = Literal["scan", "edges", "faces", "surfaces", "model", "export"]
STEPS: tuple[Step, ...] = ("scan", "edges", "faces", "surfaces", "model", "export")
Status = Literal["empty", "current", "outdated", "running", "failed"]
FieldKind = Literal["number", "integer", "flag", "choice", "choices", "text"]


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure of a step, ready to be read."""

    label: str
    value: str


@dataclass(frozen=True, kw_only=True)
class FormField:
    """A parameter: `stage` and `name` say which, `low` and `high` its range, `automatic` whether null lets the stage choose."""

    stage: str
    name: str
    step: Step
    label: str
    kind: FieldKind
    help: str
    unit: str
    low: float | None
    high: float | None
    choices: list[str]
    default: Any
    automatic: bool
    common: bool


@dataclass(frozen=True, kw_only=True)
class FaceEntry:
    """A face: its number, which never passes to another one, its type, its surface's parameters and deviations in the scan's unit.

    `tolerance` is the one that the face was given by hand, `n_control_points` that of a B-spline.
    """

    number: int
    name: str
    kind: str
    parameters: str
    n_points: int
    rms: float | None
    largest: float | None
    tolerance: float | None
    n_control_points: int | None
    colour: list[float]
    notes: list[str]


@dataclass(frozen=True, kw_only=True)
class StepResult:
    """What came out of a step; `key` names the edits that it follows from."""

    step: Step
    key: str
    seconds: float
    figures: list[Figure]
    warnings: list[str]
    automatic: dict[str, float | str | None]
    faces: list[FaceEntry]


@dataclass(frozen=True, kw_only=True)
class StepState:
    """A step as it stands."""

    step: Step
    status: Status
    result: StepResult | None
    trouble: str | None


@dataclass(frozen=True, kw_only=True)
class FileEntry:
    """A file that was exported."""

    name: str
    size: int
    current: bool


@dataclass(frozen=True, kw_only=True)
class EditEntry:
    """An edit in the list: what it does, in words, and whether it is done or was undone."""

    text: str
    step: Step
    done: bool


@dataclass(frozen=True, kw_only=True)
class ExportKind:
    """A format that the model can be taken away in."""

    name: str
    suffix: str
    text: str
    available: bool


# ---- from the server


@dataclass(frozen=True, kw_only=True)
class Welcome:
    """The first message: what does not change while the server runs."""

    version: str
    fields: list[FormField]
    kinds: list[str]
    exports: list[ExportKind]


@dataclass(frozen=True, kw_only=True)
class State:
    """The project as it stands; sent whenever it changes. Without a project, `project` is empty.

    `opens` tells whether a scan may be sent: where there is none, or the one that is open cannot be read. `reached` is the step to begin
    with: the last one that was computed, now or before the studio was started again. `idle` are those of the `values` that make no
    difference as the others are: they are not shown. `notice` is what should be known all the time, as a sentence, else empty.
    """

    project: str
    scan: str
    opens: bool
    reached: Step
    unit: str
    revision: int
    edits: list[EditEntry]
    can_undo: bool
    can_redo: bool
    values: dict[str, Any]
    idle: list[str]
    steps: list[StepState]
    running: Step | None
    files: list[FileEntry]
    notice: str


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far the running step is."""

    step: Step
    stage: str
    done: int
    total: int


@dataclass(frozen=True, kw_only=True)
class Trouble:
    """Something that could not be done, as a sentence."""

    text: str


@dataclass(frozen=True, kw_only=True)
class ArrayInfo:
    """Where an array lies in a binary frame: `offset` bytes after the header."""

    name: str
    dtype: Literal["float32", "int32", "uint32", "uint8"]
    shape: list[int]
    offset: int


@dataclass(frozen=True, kw_only=True)
class FrameHeader:
    """The head of a binary frame; `numbers` are single values that belong to the arrays."""

    name: str
    key: str
    arrays: list[ArrayInfo]
    numbers: dict[str, float]


# ---- from the page


@dataclass(frozen=True, kw_only=True)
class Edit:
    """Do an edit, see `edits`."""

    edit: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Undo:
    """Undo the last edit that is done."""


@dataclass(frozen=True, kw_only=True)
class Redo:
    """Do the edit again that was undone last."""


@dataclass(frozen=True, kw_only=True)
class Compute:
    """Compute everything up to a step that is not up to date."""

    until: Step


@dataclass(frozen=True, kw_only=True)
class Cancel:
    """Stop computing."""


@dataclass(frozen=True, kw_only=True)
class Export:
    """Write the model in a format."""

    kind: str


FROM_SERVER = (Welcome, State, Progress, Trouble)
FROM_PAGE = (Edit, Undo, Redo, Compute, Cancel, Export)
FromPage = Edit | Undo | Redo | Compute | Cancel | Export
