/** The points that are chosen by hand, and how they are named for the server: as a lasso where that says all, else by rows. */
import * as THREE from "three";
import type { Store } from "../store";
import type { Sync } from "../view/sync";
import type { Viewer } from "../view/viewer";

export type How = "replace" | "add" | "remove";
export type Corner = [number, number];
export interface LassoSpec {
  origin: number[];
  u: number[];
  v: number[];
  polygon: Corner[];
}

export class Selection {
  count = 0;
  private lasso: LassoSpec | null = null;

  constructor(
    private readonly store: Store,
    private readonly viewer: Viewer,
    private readonly sync: Sync,
  ) {}

  /** Choose the points inside an outline on the screen. */
  outline(corners: Corner[], how: How, through: boolean): void {
    const inside = maskOf(corners, this.viewer.width, this.viewer.height);
    const found = this.within((x, y) => inside[y * this.viewer.width + x]! > 0, bounds(corners), through);
    this.apply(found, how, through && !this.viewer.cameras.isPerspective ? this.spec(corners) : null);
  }

  /** Choose the points within some pixels of a stroke from one place on the screen to another. */
  stroke([x, y]: Corner, to: Corner, radius: number, how: How, through: boolean): void {
    const [dx, dy] = [to[0] - x, to[1] - y];
    const length2 = Math.max(dx * dx + dy * dy, 1e-9);
    const near = (px: number, py: number) => {
      const along = Math.min(Math.max(((px - x) * dx + (py - y) * dy) / length2, 0), 1);
      return (px - x - along * dx) ** 2 + (py - y - along * dy) ** 2 <= radius ** 2;
    };
    const [left, top, right, bottom] = bounds([[x, y], to]) as [number, number, number, number];
    this.apply(this.within(near, [left - radius, top - radius, right + radius, bottom + radius], through), how, null);
  }

  clear(): void {
    this.viewer.cloud?.chosen.fill(0);
    this.changed(null);
  }

  /** What the server is told. */
  named(): Record<string, unknown> {
    if (this.lasso) return { lassos: [this.lasso] };
    const rows = this.sync.rows;
    const indices: number[] = [];
    this.viewer.cloud?.chosen.forEach((on, k) => on && indices.push(rows ? rows[k]! : k));
    return { indices };
  }

  private apply(found: number[], how: How, lasso: LassoSpec | null): void {
    const chosen = this.viewer.cloud?.chosen;
    if (!chosen) return;
    if (how === "replace") chosen.fill(0);
    for (const k of found) chosen[k] = how === "remove" ? 0 : 1;
    this.changed(how === "replace" ? lasso : null);
  }

  private changed(lasso: LassoSpec | null): void {
    this.lasso = lasso;
    this.count = this.viewer.cloud?.chosen.reduce((sum, on) => sum + on, 0) ?? 0;
    this.viewer.cloud?.chosenChanged();
    this.viewer.draw();
    this.store.tell("selection");
  }

  /** Return the points on the screen that a test takes; unless `through`, only those that nothing hides. */
  private within(test: (x: number, y: number) => boolean, box: number[], through: boolean): number[] {
    const { viewer } = this;
    const cloud = viewer.cloud;
    if (!cloud) return [];
    const picture = through ? null : viewer.pick(true);
    const camera = viewer.cameras.current;
    camera.updateMatrixWorld();
    const matrix = new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    const view = camera.matrixWorldInverse.elements;
    const [width, height, p] = [viewer.width, viewer.height, cloud.positions];
    const [left, top, right, bottom] = [box[0]!, box[1]!, box[2]!, box[3]!];
    const place = new THREE.Vector4();
    const found: number[] = [];
    for (let k = 0; k < cloud.n; k++) {
      const [a, b, c] = [p[3 * k]!, p[3 * k + 1]!, p[3 * k + 2]!];
      place.set(a, b, c, 1).applyMatrix4(matrix);
      const x = Math.floor(((place.x / place.w + 1) * width) / 2);
      const y = Math.floor(((1 - place.y / place.w) * height) / 2);
      if (place.w <= 0 || x < left || x > right || y < top || y > bottom || x < 0 || y < 0 || x >= width || y >= height) continue;
      if (!test(x, y)) continue;
      if (picture) {
        const depth = -(view[2]! * a + view[6]! * b + view[10]! * c + view[14]!);
        if (depth > picture.depth(x, y) + 3 * cloud.spacing) continue;
      }
      found.push(k);
    }
    return found;
  }

  /** An outline on the screen as a lasso in the input's coordinates. */
  private spec(corners: Corner[]): LassoSpec {
    const camera = this.viewer.cameras.orthographic;
    camera.updateMatrixWorld();
    const e = camera.matrixWorld.elements;
    const numbers = this.store.frames.get("cloud")!.header.numbers;
    const origin = [e[12]! + numbers["x"]!, e[13]! + numbers["y"]!, e[14]! + numbers["z"]!];
    const scale = 1 / this.viewer.cameras.pixels;
    const [w, h] = [this.viewer.width / 2, this.viewer.height / 2];
    return { origin, u: [e[0]!, e[1]!, e[2]!], v: [e[4]!, e[5]!, e[6]!], polygon: corners.map(([x, y]) => [(x - w) * scale, (h - y) * scale]) };
  }
}

function bounds(corners: Corner[]): number[] {
  const [x, y] = [corners.map((c) => c[0]), corners.map((c) => c[1])];
  return [Math.min(...x), Math.min(...y), Math.max(...x), Math.max(...y)];
}

function maskOf(corners: Corner[], width: number, height: number): Uint8Array {
  const canvas = new OffscreenCanvas(width, height);
  const pen = canvas.getContext("2d")!;
  pen.beginPath();
  for (const [x, y] of corners) pen.lineTo(x, y);
  pen.fill("evenodd");
  const data = pen.getImageData(0, 0, width, height).data;
  return Uint8Array.from({ length: width * height }, (_, k) => (data[4 * k + 3]! > 127 ? 1 : 0));
}
