/** From the server's arrays to what is drawn: which layers there are, and how points are coloured. */
import type { Step } from "../messages";
import type { Colouring, Store } from "../store";
import { Cloud, COLOURINGS } from "./cloud";
import { paletteTexture, rampTexture } from "./colours";
import { FaceMesh, Lines, Nets } from "./layers";
import type { Legend } from "./legend";
import type { Viewer } from "./viewer";

/** How much nearer to the eye curves are drawn than they are, in h: points scatter about the surface, and are discs as wide as their distance. */
const LIFT = 2;
const CURVE = 0xffe9a8;
const FREE = 0xff5a5a;
const NET = 0x4dff88;
/** Of surfaces under points that are coloured by their distance from them. */
const GREY = [0.4, 0.45, 0.5];
/** Of points that were added to the edges or taken from them by hand, as the points' program has them. */
const BY_HAND = [
  { name: "added by hand", colour: [0.3, 0.9, 0.55] },
  { name: "taken away by hand", colour: [0.62, 0.45, 0.85] },
];
const TITLES: Record<Colouring, string> = { plain: "", height: "Height", strength: "Edge strength", face: "Faces", deviation: "Deviation" };

export class Sync {
  colouring: Colouring = "plain";
  threshold = 12;
  alpha = 0.4;
  /** Row of the input of each point; null where they are the same. */
  rows: Int32Array | null = null;
  strength: Float32Array | null = null;
  /** How points that were corrected by hand are coloured, where there are such. */
  private byHand: typeof BY_HAND = [];
  private shown = new Map<string, string>();
  /** The colourings that were chosen by hand, by step. */
  private readonly chosen = new Map<Step, Colouring>();

  constructor(
    private readonly store: Store,
    private readonly viewer: Viewer,
    private readonly legend: Legend,
  ) {
    store.on(["frame"], () => this.frame(store.lastFrame));
    store.on(["state", "step"], () => this.refresh());
    store.on(["faces"], () => this.recolour());
    store.on(["step"], () => this.colour(this.natural()));
    store.on(["threshold"], () => this.numbers());
    viewer.onSwitched = () => this.recolour();
  }

  /** The colouring that belongs to a step: the one that was chosen by hand for it, if any. */
  natural(): Colouring {
    const chosen = this.chosen.get(this.store.step);
    if (chosen) return chosen;
    if (this.store.step === "scan") return "height";
    if (this.store.step === "edges") return this.strength ? "strength" : "height";
    if (this.store.step === "surfaces" && this.store.frames.has("surfaces")) return "deviation";
    return this.store.facesStep() ? "face" : "height";
  }

  /** Colour as a person wants it in this step, from now on. */
  choose(colouring: Colouring): void {
    this.chosen.set(this.store.step, colouring);
    this.colour(colouring);
  }

  colour(colouring: Colouring): void {
    this.colouring = colouring;
    this.recolour();
  }

  live(threshold: number, alpha: number): void {
    [this.threshold, this.alpha] = [threshold, alpha];
    this.viewer.touch();
    this.store.tell("threshold");
  }

  private frame(name: string): void {
    const frame = this.store.frames.get(name)!;
    if (name === "cloud") {
      const points = frame.arrays["points"] as Float32Array;
      this.rows = (frame.arrays["rows"] as Int32Array | undefined) ?? null;
      if (this.viewer.cloud?.n !== points.length / 3) this.viewer.show(new Cloud(points, frame.header.numbers["h"] ?? 1));
    } else if (name === "edges" && this.viewer.cloud) {
      const cloud = this.viewer.cloud;
      this.strength = (frame.arrays["strength"] as Float32Array).map((value) => (Number.isNaN(value) ? -1 : value));
      cloud.column("strength", this.strength);
      const corrected = frame.arrays["corrected"]!;
      cloud.column("corrected", corrected);
      this.byHand = BY_HAND.filter((_, k) => corrected.includes(k + 1));
      cloud.normals(frame.arrays["normals"] as Uint8Array);
      const weighted = "dn" in frame.arrays;
      if (weighted) for (const column of ["dn", "vdn"]) cloud.column(column, (frame.arrays[column] as Float32Array).map((value) => (Number.isNaN(value) ? -1 : value)));
      cloud.uniforms.weighted.value = weighted;
      this.threshold = frame.header.numbers["threshold"] ?? this.threshold;
      this.store.tell("threshold");
    }
    this.refresh();
    if (this.natural() !== this.colouring && (name === this.store.step || name === "cloud")) this.colour(this.natural());
  }

  /** Give points and layers what belongs to the step that is looked at. */
  private refresh(): void {
    const { store, viewer } = this;
    if (!viewer.cloud) return;
    const edges = store.frames.get("edges");
    const [surfaces, model] = [store.frames.get("surfaces"), store.frames.get("model")];
    const late = store.step === "model" || store.step === "export";
    const lines = late && model ? model : (store.step === "surfaces" || late) && surfaces ? surfaces : store.step === "edges" || store.step === "faces" ? edges : undefined;
    const lift = LIFT * (store.frames.get("cloud")?.header.numbers["h"] ?? 0);
    this.layer("curves", lines, () =>
      lines === edges ? [new Lines(lines!.arrays["curves"]!, CURVE, lift)] : [new Lines(lines!.arrays["edges"]!, CURVE, lift), new Lines(lines!.arrays["free"]!, FREE, lift)],
    );
    this.layer("surfaces", store.step === "surfaces" ? surfaces : undefined, () => [mesh(surfaces!.arrays, viewer)]);
    this.layer("nets", store.step === "surfaces" || late ? surfaces : undefined, () => [new Nets(surfaces!.arrays["nets"]!, NET)]);
    this.layer("model", late ? model : undefined, () => [mesh(model!.arrays, viewer)]);
    const step = store.facesStep();
    const frame = step ? store.frames.get(step) : undefined;
    if (frame && this.shown.get("points") !== frame.header.key + step) {
      this.shown.set("points", frame.header.key + step);
      viewer.cloud.column("face", Float32Array.from(frame.arrays["face"]!));
      viewer.cloud.column("deviation", (frame.arrays["deviation"] as Float32Array).map((value) => (Number.isNaN(value) ? 1e30 : value)));
    }
    this.recolour();
  }

  private layer(name: "curves" | "surfaces" | "nets" | "model", frame: { header: { key: string; name: string } } | undefined, make: () => (Lines | FaceMesh)[]): void {
    const key = frame ? frame.header.name + frame.header.key : "";
    if ((this.shown.get(name) ?? "") === key) return;
    this.shown.set(name, key);
    this.viewer.replace(name, frame ? make() : []);
  }

  private recolour(): void {
    const { store, viewer } = this;
    if (!viewer.cloud) return;
    const entries = store.entries();
    const neutral = this.colouring === "deviation" && store.step === "surfaces" && store.faces.length === 0 && viewer.layers.get("points")!.on;
    const palette = paletteTexture(new Map(entries.map((entry) => [entry.number, neutral ? GREY : entry.colour])), store.faces);
    viewer.palette.palette.value?.dispose();
    viewer.palette.palette.value = palette.map;
    viewer.palette.paletteSize.value = palette.size;
    this.numbers();
  }

  /** Give the points' program its numbers, and the legend: all that changes while a slider moves. */
  private numbers(): void {
    const { store, viewer, legend } = this;
    const cloud = viewer.cloud;
    if (!cloud) return;
    const entries = store.entries();
    const uniforms = cloud.uniforms;
    uniforms.colouring.value = COLOURINGS.indexOf(this.colouring);
    uniforms.threshold.value = this.threshold;
    uniforms.alpha.value = this.alpha;
    const [ramp, low, high] = this.range();
    uniforms.ramp.value = rampTexture(ramp);
    uniforms.range.value.set(low, high);
    const unit = store.state?.unit ?? "";
    const shift = this.colouring === "height" ? (store.frames.get("cloud")?.header.numbers["z"] ?? 0) : 0;
    const strength = this.colouring === "strength";
    const points = viewer.layers.get("points")!.on;
    if (!points || this.colouring === "face") {
      // Without points it is the faces that are seen, in their colours.
      const faces = points || (["surfaces", "model"] as const).some((name) => viewer.layers.get(name)!.on && viewer.layers.get(name)!.parts.length > 0);
      if (faces && entries.length) legend.faces(entries);
      else legend.hide();
    } else if (this.colouring === "plain") legend.hide();
    else legend.ramp(TITLES[this.colouring], ramp, low + shift, high + shift, strength ? "°" : unit, strength ? this.threshold : undefined, strength ? this.byHand : []);
    viewer.draw();
  }

  private range(): [string, number, number] {
    const box = this.viewer.cloud!.geometry.boundingBox!;
    if (this.colouring === "strength") return ["heat", 0, 90];
    if (this.colouring === "deviation") {
      const noise = this.store.frames.get("cloud")?.header.numbers["noise"] ?? 0;
      const widest = 3 * Math.max(noise, ...this.store.entries().map((entry) => entry.rms ?? 0), 1e-12);
      return ["diverging", -widest, widest];
    }
    return ["viridis", box.min.z, box.max.z];
  }
}

function mesh(arrays: Record<string, import("../frames").Values>, viewer: Viewer): FaceMesh {
  return new FaceMesh(arrays["triangles"]!, arrays["triangle_faces"]!, viewer.palette);
}
