/** What the pointer does on the picture: turn, pick, brush, lasso. Right and middle button, and the wheel, always move the view. */
import { h } from "../dom";
import type { Store } from "../store";
import type { Viewer } from "../view/viewer";
import type { Corner, How, Selection } from "./selection";

export type Tool = "turn" | "brush" | "lasso";

export class Pointer {
  tool: Tool = "turn";
  through = false;
  radius = 14;
  private readonly svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  private readonly line = document.createElementNS("http://www.w3.org/2000/svg", "polygon");
  private readonly ring = document.createElementNS("http://www.w3.org/2000/svg", "circle");
  readonly hint = h("div", { class: "hover" });
  private corners: Corner[] = [];
  private from: Corner = [0, 0];
  private busy = false;

  constructor(
    private readonly store: Store,
    private readonly viewer: Viewer,
    private readonly selection: Selection,
    home: HTMLElement,
  ) {
    this.svg.setAttribute("class", "ink");
    this.svg.append(this.line, this.ring);
    home.append(this.svg, this.hint);
    const canvas = viewer.canvas;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointerleave", () => this.ring.setAttribute("r", "0"));
    this.use("turn");
  }

  use(tool: Tool): void {
    this.tool = tool;
    // three.js turns with the left button unless a tool has it.
    const buttons = this.viewer.cameras.controls.mouseButtons as { LEFT: number | null };
    buttons.LEFT = tool === "turn" ? 0 : null;
    this.viewer.canvas.style.cursor = tool === "turn" ? "grab" : "crosshair";
    this.ring.setAttribute("r", "0");
    this.store.tell("selection");
  }

  /** Give up what is being drawn; tell whether something was. */
  abort(): boolean {
    const drawing = this.busy;
    this.busy = false;
    this.corners = [];
    this.line.setAttribute("points", "");
    return drawing;
  }

  private down(event: PointerEvent): void {
    this.from = [event.offsetX, event.offsetY];
    if (event.button !== 0 || this.tool === "turn") return;
    this.busy = true;
    this.viewer.canvas.setPointerCapture(event.pointerId);
    this.corners = [this.from];
    if (this.tool === "brush") this.selection.stroke(this.from, this.from, this.radius, howOf(event), this.through);
  }

  private move(event: PointerEvent): void {
    const at: Corner = [event.offsetX, event.offsetY];
    if (this.tool === "brush") {
      this.ring.setAttribute("cx", String(at[0]));
      this.ring.setAttribute("cy", String(at[1]));
      this.ring.setAttribute("r", String(this.radius));
      if (this.busy) this.selection.stroke(this.corners[0]!, at, this.radius, event.altKey ? "remove" : "add", this.through);
      if (this.busy) this.corners = [at];
    } else if (this.tool === "lasso" && this.busy) {
      this.corners.push(at);
      this.line.setAttribute("points", this.corners.map((corner) => corner.join(",")).join(" "));
    }
  }

  private up(event: PointerEvent): void {
    if (event.button !== 0) return;
    const still = Math.hypot(event.offsetX - this.from[0], event.offsetY - this.from[1]) < 4;
    if (this.tool === "turn" && still) this.pick(event);
    if (this.tool === "lasso" && this.busy && this.corners.length > 2) this.selection.outline(this.corners, howOf(event), this.through);
    this.abort();
  }

  private pick(event: PointerEvent): void {
    const face = this.viewer.pick(false).face(event.offsetX, event.offsetY);
    this.store.choose(face, event.shiftKey || event.ctrlKey);
  }
}

function howOf(event: PointerEvent): How {
  return event.altKey ? "remove" : event.shiftKey ? "add" : "replace";
}
