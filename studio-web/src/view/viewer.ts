/** The picture: draws when something changed, never otherwise; holds the cloud and the layers. */
import * as THREE from "three";
import { Cameras } from "./cameras";
import type { Cloud } from "./cloud";
import { FaceMesh, type Lines } from "./layers";
import { Pace } from "./pace";
import { Picker, type Picture } from "./picking";

export type LayerName = "points" | "curves" | "surfaces" | "nets" | "model";
const SETTLE = 180;
/** So many points are drawn when something moves for the first time, by a graphics card or by the processor. */
const FIRST = { card: 250_000, processor: 20_000 };

export class Viewer {
  readonly canvas = document.createElement("canvas");
  readonly cameras: Cameras;
  readonly palette = { palette: { value: null as THREE.Texture | null }, paletteSize: { value: 1 } };
  cloud: Cloud | null = null;
  /** Milliseconds of the last frames, the newest last. */
  readonly times: number[] = [];
  readonly layers = new Map<LayerName, { parts: (Lines | FaceMesh)[]; on: boolean; opacity: number }>();
  onDrawn: () => void = () => undefined;
  /** Called when a layer was switched on or off. */
  onSwitched: () => void = () => undefined;
  readonly pace: Pace;
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly picker: Picker;
  private readonly slow: boolean;
  private coarse = false;
  private waiting = false;
  private lastMoving = 0;
  private movingUntil = 0;
  private settling = 0;

  constructor(private readonly home: HTMLElement) {
    this.slow = software();
    this.pace = new Pace(this.slow ? FIRST.processor : FIRST.card);
    // A picture that nothing shines through is put on the page sooner; smooth lines cost a processor too much.
    const context = this.canvas.getContext("webgl2", { alpha: false, antialias: !this.slow, powerPreference: "high-performance" });
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, ...(context && { context }) });
    this.renderer.setClearColor(0x10161d, 1);
    this.picker = new Picker(this.renderer);
    this.canvas.tabIndex = 0;
    home.append(this.canvas);
    this.cameras = new Cameras(this.canvas, () => this.moved());
    for (const name of ["points", "curves", "surfaces", "nets", "model"] as LayerName[]) {
      this.layers.set(name, { parts: [], on: name !== "nets", opacity: 1 });
    }
    new ResizeObserver(() => this.resize()).observe(home);
  }

  get width(): number {
    return Math.max(this.home.clientWidth, 1);
  }

  get height(): number {
    return Math.max(this.home.clientHeight, 1);
  }

  show(cloud: Cloud): void {
    if (this.cloud) this.scene.remove(this.cloud.points);
    this.cloud?.dispose();
    this.cloud = cloud;
    this.scene.add(cloud.points);
    this.resize();
    this.cameras.about(cloud.geometry.boundingBox!);
    this.draw();
  }

  replace(layer: LayerName, parts: (Lines | FaceMesh)[]): void {
    const entry = this.layers.get(layer)!;
    for (const part of entry.parts) {
      this.scene.remove(part.object);
      part.dispose();
    }
    entry.parts = parts;
    for (const part of parts) this.scene.add(part.object);
    this.switch(layer, entry.on, entry.opacity);
  }

  switch(layer: LayerName, on: boolean, opacity: number): void {
    const entry = this.layers.get(layer)!;
    const switched = entry.on !== on;
    Object.assign(entry, { on, opacity });
    for (const part of entry.parts) {
      part.object.visible = on && opacity > 0;
      part.fade(opacity);
    }
    if (layer === "points" && this.cloud) {
      this.cloud.points.visible = on && opacity > 0;
      this.cloud.fade(opacity);
    }
    if (switched) this.onSwitched();
    this.draw();
  }

  /** Draw integers instead of colours: of the points alone, or of what is seen of points and faces. */
  pick(pointsOnly: boolean): Picture {
    const objects: THREE.Object3D[] = [];
    if (this.cloud && (pointsOnly || this.cloud.points.visible)) objects.push(this.cloud.picked);
    if (!pointsOnly) {
      for (const { parts } of this.layers.values()) for (const part of parts) if (part instanceof FaceMesh && part.object.visible) objects.push(part.picked);
    }
    this.cloud?.draw(Infinity);
    this.prepare();
    if (this.cloud) Object.assign(this.cloud.picked.material.uniforms["scale"]!, { value: this.cameras.pixels });
    return this.picker.take(objects, this.cameras.current, this.width, this.height);
  }

  draw(): void {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.render();
    });
  }

  render(): void {
    const start = performance.now();
    const moving = start < this.movingUntil;
    this.cloud?.draw(moving ? this.pace.points : Infinity);
    // Where the processor draws, a movement that leaves points out is drawn with half as many pixels each way: as large, half the work.
    if (!moving || this.lastMoving === 0) this.sharpen(!(moving && this.slow && this.pace.points < (this.cloud?.n ?? 0)));
    this.prepare();
    this.renderer.render(this.scene, this.cameras.current);
    this.times.push(performance.now() - start);
    if (this.times.length > 200) this.times.shift();
    this.onDrawn();
    if (moving && this.lastMoving > 0) this.pace.took(start - this.lastMoving, this.cloud?.n ?? 0);
    this.lastMoving = moving ? start : 0;
    if (moving) this.settleLater();
  }

  /** Draw a frame, wait until the graphics card is done, and return the milliseconds. */
  measure(moving: boolean): number {
    this.movingUntil = moving ? performance.now() + 60_000 : 0;
    const start = performance.now();
    this.render();
    const gl = this.renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    this.movingUntil = this.lastMoving = 0;
    clearTimeout(this.settling);
    return performance.now() - start;
  }

  private settleLater(): void {
    clearTimeout(this.settling);
    this.settling = window.setTimeout(() => this.draw(), Math.max(this.movingUntil - performance.now(), 0) + 1);
  }

  /** Something moves: draw as many points as can be drawn smoothly, and all of them once it rests. */
  touch(): void {
    // A processor takes seconds for the millions of points of a whole picture, in which nothing moves: it is sure first that all rests.
    this.movingUntil = performance.now() + Math.max(SETTLE, this.slow ? (this.cloud?.n ?? 0) / 1500 : 0);
    this.draw();
  }

  private moved(): void {
    this.cameras.settle();
    this.touch();
  }

  private sharpen(sharp: boolean): void {
    this.coarse = !sharp;
    const ratio = Math.min(window.devicePixelRatio, 2) * (sharp ? 1 : 0.5);
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
  }

  private prepare(): void {
    if (!this.cloud) return;
    this.cloud.uniforms.least.value = this.coarse ? 1 : 1.5;
    this.cloud.uniforms.scale.value = this.cameras.pixels * this.renderer.getPixelRatio();
    this.cloud.uniforms.perspective.value = this.cameras.isPerspective;
    this.cloud.uniforms.palette.value = this.palette.palette.value;
    this.cloud.uniforms.paletteSize.value = this.palette.paletteSize.value;
  }

  private resize(): void {
    this.sharpen(!this.coarse);
    this.renderer.setSize(this.width, this.height);
    this.cameras.resize(this.width, this.height);
    this.draw();
  }
}

/** Whether pictures are drawn by the processor. */
function software(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl && info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}
