/** What the page knows: the server's last messages, the arrays of each step, and what is chosen. Views listen to topics. */
import type { Frame } from "./frames";
import type { FaceEntry, FromPage, Progress, State, Step, StepResult, Welcome } from "./messages";

export type Topic = "welcome" | "state" | "frame" | "progress" | "step" | "faces" | "selection" | "threshold" | "online" | "trouble";
export type Colouring = "plain" | "height" | "strength" | "face" | "deviation";

export class Store {
  welcome: Welcome | null = null;
  state: State | null = null;
  progress: Progress | null = null;
  online = { yes: true, why: "" };
  frames = new Map<string, Frame>();
  lastFrame = "";
  step: Step = "scan";
  /** Whether it was asked to stop and has not yet. */
  stopping = false;
  /** Whether it has just stopped because it was asked to. */
  stopped = false;
  /** Numbers of the faces that are chosen, in the order of choosing. */
  faces: number[] = [];
  send: (message: FromPage) => void = () => undefined;
  private readonly listeners = new Map<Topic, (() => void)[]>();

  on(topics: Topic[], listener: () => void): void {
    for (const topic of topics) this.listeners.set(topic, [...(this.listeners.get(topic) ?? []), listener]);
  }

  tell(topic: Topic): void {
    for (const listener of this.listeners.get(topic) ?? []) listener();
  }

  result(step: Step): StepResult | null {
    return this.state?.steps.find((entry) => entry.step === step)?.result ?? null;
  }

  status(step: Step): string {
    return this.state?.steps.find((entry) => entry.step === step)?.status ?? "empty";
  }

  /** The step whose faces are the newest that fit the step that is looked at: what points and list show. */
  facesStep(): Step | null {
    const order: Step[] = this.step === "faces" ? ["faces"] : this.step === "surfaces" ? ["surfaces", "faces"] : ["model", "surfaces", "faces"];
    return (
      order.find((step) => this.status(step) === "current" && this.frames.has(step)) ??
      (["faces", "surfaces", "model"] as Step[]).find((step) => this.frames.has(step)) ??
      null
    );
  }

  entries(): FaceEntry[] {
    const step = this.facesStep();
    return step ? (this.result(step)?.faces ?? []) : [];
  }

  /** Ask the server to stop computing. */
  stop(): void {
    this.stopping = true;
    this.send({ type: "Cancel" });
    this.tell("progress");
  }

  /** Say for a while that it has stopped. */
  hasStopped(): void {
    [this.stopping, this.stopped] = [false, true];
    setTimeout(() => ((this.stopped = false), this.tell("progress")), 6000);
  }

  goTo(step: Step): void {
    if (step === this.step) return;
    this.step = step;
    this.tell("step");
  }

  choose(face: number | null, more: boolean): void {
    if (face === null) this.faces = more ? this.faces : [];
    else if (more) this.faces = this.faces.includes(face) ? this.faces.filter((other) => other !== face) : [...this.faces, face];
    else this.faces = [face];
    this.tell("faces");
  }
}
