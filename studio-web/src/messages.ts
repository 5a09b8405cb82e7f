// Made of src/scan2nurbs/studio/messages.py by `python -m scan2nurbs.studio.typescript`: do not edit.

export const STEPS = ["scan", "edges", "faces", "surfaces", "model", "export"] as const;
export type Step = (typeof STEPS)[number];

/** A figure of a step, ready to be read. */
export interface Figure {
  label: string;
  value: string;
}

/** A parameter: `stage` and `name` say which, `low` and `high` its range, `automatic` whether null lets the stage choose. */
export interface FormField {
  stage: string;
  name: string;
  step: Step;
  label: string;
  kind: "number" | "integer" | "flag" | "choice" | "choices" | "text";
  help: string;
  unit: string;
  low: number | null;
  high: number | null;
  choices: string[];
  default: unknown;
  automatic: boolean;
  common: boolean;
}

/** A face: its number, which never passes to another one, its type, its surface's parameters and deviations in the scan's unit. */
export interface FaceEntry {
  number: number;
  name: string;
  kind: string;
  parameters: string;
  n_points: number;
  rms: number | null;
  largest: number | null;
  tolerance: number | null;
  n_control_points: number | null;
  colour: number[];
  notes: string[];
}

/** What came out of a step; `key` names the edits that it follows from. */
export interface StepResult {
  step: Step;
  key: string;
  seconds: number;
  figures: Figure[];
  warnings: string[];
  automatic: Record<string, number | string | null>;
  faces: FaceEntry[];
}

/** A step as it stands. */
export interface StepState {
  step: Step;
  status: "empty" | "current" | "outdated" | "running" | "failed";
  result: StepResult | null;
  trouble: string | null;
}

/** A file that was exported. */
export interface FileEntry {
  name: string;
  size: number;
  current: boolean;
}

/** An edit in the list: what it does, in words, and whether it is done or was undone. */
export interface EditEntry {
  text: string;
  step: Step;
  done: boolean;
}

/** A format that the model can be taken away in. */
export interface ExportKind {
  name: string;
  suffix: string;
  text: string;
  available: boolean;
}

/** The first message: what does not change while the server runs. */
export interface Welcome {
  version: string;
  fields: FormField[];
  kinds: string[];
  exports: ExportKind[];
}

/** The project as it stands; sent whenever it changes. Without a project, `project` is empty. */
export interface State {
  project: string;
  scan: string;
  opens: boolean;
  reached: Step;
  unit: string;
  revision: number;
  edits: EditEntry[];
  can_undo: boolean;
  can_redo: boolean;
  values: Record<string, unknown>;
  idle: string[];
  steps: StepState[];
  running: Step | null;
  files: FileEntry[];
  notice: string;
}

/** How far the running step is. */
export interface Progress {
  step: Step;
  stage: string;
  done: number;
  total: number;
}

/** Something that could not be done, as a sentence. */
export interface Trouble {
  text: string;
}

/** Where an array lies in a binary frame: `offset` bytes after the header. */
export interface ArrayInfo {
  name: string;
  dtype: "float32" | "int32" | "uint32" | "uint8";
  shape: number[];
  offset: number;
}

/** The head of a binary frame; `numbers` are single values that belong to the arrays. */
export interface FrameHeader {
  name: string;
  key: string;
  arrays: ArrayInfo[];
  numbers: Record<string, number>;
}

/** Do an edit, see `edits`. */
export interface Edit {
  edit: Record<string, unknown>;
}

/** Undo the last edit that is done. */
export type Undo = Record<never, never>;

/** Do the edit again that was undone last. */
export type Redo = Record<never, never>;

/** Compute everything up to a step that is not up to date. */
export interface Compute {
  until: Step;
}

/** Stop computing. */
export type Cancel = Record<never, never>;

/** Write the model in a format. */
export interface Export {
  kind: string;
}

export type FromServer = ({ type: "Welcome" } & Welcome) | ({ type: "State" } & State) | ({ type: "Progress" } & Progress) | ({ type: "Trouble" } & Trouble);

export type FromPage = ({ type: "Edit" } & Edit) | ({ type: "Undo" } & Undo) | ({ type: "Redo" } & Redo) | ({ type: "Compute" } & Compute) | ({ type: "Cancel" } & Cancel) | ({ type: "Export" } & Export);
