/** The histogram of edge strengths with the threshold on it; moving it recolours at once, letting go sends it. */
import { count, fill, h, number, write } from "../dom";
import type { Store } from "../store";
import { css, rampColour } from "../view/colours";
import type { Sync } from "../view/sync";

const BINS = 900;
const [WIDTH, HEIGHT] = [300, 84];
const degreesOf = (column: number) => ((2 * column + 1) * 90) / WIDTH;
const COLOURS = Array.from({ length: WIDTH / 2 }, (_, k) => css(rampColour("heat", degreesOf(k) / 90)));

export function thresholdPanel(store: Store, sync: Sync): HTMLElement {
  const canvas = h("canvas", { width: WIDTH, height: HEIGHT, class: "histogram", title: "How many points have which strength (logarithmic)" });
  const slider = h("input", { type: "range", id: "threshold", min: "0", max: "90", step: "0.1", "aria-label": "Threshold δ in degrees" });
  const alpha = h("input", { type: "range", id: "alpha", min: "0", max: "1", step: "0.01", "aria-label": "Weight α of DN" });
  const said = h("span", { id: "threshold-said" });
  const [degrees, weight] = [h("output", { for: "threshold", class: "value" }), h("output", { for: "alpha", class: "value" })];
  const reset = h("button", { class: "reset", id: "threshold-reset", title: "Back to automatic", onclick: () => send("threshold", null) }, "↺");
  const alphaRow = h("div", { class: "line" }, h("label", { for: "alpha" }, "Weight α"), alpha, weight);
  const help = h("p", { class: "help" }, "Points with a strength above δ, from 0° to 90°, lie on an edge. Unless it is moved, it is chosen for the operator.");
  const element = h("div", { class: "threshold" }, canvas, h("div", { class: "line" }, h("label", { for: "threshold" }, "Threshold δ"), slider, degrees, reset), help, alphaRow, said);
  let bins = new Uint32Array(BINS);
  let counted: unknown = null;

  function strengths(): Float32Array | null {
    const frame = store.frames.get("edges");
    const [dn, vdn] = [frame?.arrays["dn"], frame?.arrays["vdn"]];
    if (!dn || !vdn) return sync.strength;
    return Float32Array.from(dn, (value, k) => sync.alpha * value + (1 - sync.alpha) * vdn[k]!);
  }

  function draw(): void {
    const frame = store.frames.get("edges");
    element.hidden = !frame;
    if (!frame || !sync.strength) return;
    alphaRow.hidden = !("dn" in frame.arrays);
    const key = `${frame.header.key} ${"dn" in frame.arrays ? sync.alpha : ""}`;
    if (counted !== key) {
      counted = key;
      bins = new Uint32Array(BINS);
      for (const value of strengths()!) if (value >= 0) bins[Math.min(BINS - 1, Math.floor((value / 90) * BINS))]!++;
    }
    paint(canvas, bins, sync.threshold);
    if (document.activeElement !== slider) slider.value = String(sync.threshold);
    if (document.activeElement !== alpha) alpha.value = String(sync.alpha);
    write(degrees, `${number(sync.threshold)}°`);
    write(weight, sync.alpha.toFixed(2));
    reset.hidden = typeof store.state?.values["edges.threshold"] !== "number";
    const above = bins.subarray(Math.ceil((sync.threshold / 90) * BINS)).reduce((sum, n) => sum + n, 0);
    write(said, `${count(above)} points are stronger than ${number(sync.threshold)}°`);
  }

  const moved = () => sync.live(Number(slider.value), Number(alpha.value));
  slider.addEventListener("input", moved);
  alpha.addEventListener("input", moved);
  const send = (name: string, value: number | null) => store.send({ type: "Edit", edit: { set: { stage: "edges", name, value } } });
  slider.addEventListener("change", () => (send("threshold", Number(slider.value)), slider.blur()));
  alpha.addEventListener("change", () => (send("alpha", Number(alpha.value)), alpha.blur()));
  const drag = (event: PointerEvent) => {
    slider.value = String(Math.min(Math.max(event.offsetX / canvas.clientWidth, 0), 1) * 90);
    moved();
  };
  canvas.addEventListener("pointerdown", (event) => (canvas.setPointerCapture(event.pointerId), drag(event)));
  canvas.addEventListener("pointermove", (event) => canvas.hasPointerCapture(event.pointerId) && drag(event));
  canvas.addEventListener("pointerup", (event) => canvas.hasPointerCapture(event.pointerId) && send("threshold", Number(slider.value)));
  const given = () => {
    const value = store.state?.values["edges.alpha"];
    if (typeof value === "number" && document.activeElement !== alpha) sync.alpha = value;
  };
  /** What was refused does not stay. */
  const takeBack = () => {
    const found = store.frames.get("edges")?.header.numbers["threshold"];
    given();
    if (found !== undefined && document.activeElement !== slider) sync.live(found, sync.alpha);
  };
  store.on(["state"], given);
  store.on(["trouble"], takeBack);
  canvas.addEventListener("pointercancel", takeBack);
  store.on(["threshold", "frame", "step", "state"], draw);
  fill(said, "");
  draw();
  return element;
}

function paint(canvas: HTMLCanvasElement, bins: Uint32Array, threshold: number): void {
  const pen = canvas.getContext("2d")!;
  pen.clearRect(0, 0, WIDTH, HEIGHT);
  const columns = Array.from({ length: WIDTH / 2 }, (_, k) => {
    const [from, to] = [Math.floor((k * BINS * 2) / WIDTH), Math.floor(((k + 1) * BINS * 2) / WIDTH)];
    return Math.log1p(bins.subarray(from, to).reduce((sum, n) => sum + n, 0));
  });
  const most = Math.max(...columns, 1e-9);
  columns.forEach((value, k) => {
    if (value === 0) return;
    pen.fillStyle = degreesOf(k) > threshold ? COLOURS[k]! : "#738799";
    pen.fillRect(2 * k, HEIGHT - 14 - (value / most) * (HEIGHT - 16), 2, (value / most) * (HEIGHT - 16));
  });
  pen.fillStyle = "#c9d3dd";
  pen.font = "11px system-ui, sans-serif";
  for (const degrees of [0, 30, 60, 90]) pen.fillText(`${degrees}°`, Math.min((degrees / 90) * WIDTH, WIDTH - 20), HEIGHT - 2);
  pen.fillStyle = "#ffffff";
  pen.fillRect((threshold / 90) * WIDTH - 1, 0, 2, HEIGHT - 13);
}
