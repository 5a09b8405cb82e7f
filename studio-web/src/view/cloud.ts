/** The points: one buffer a column, coloured on the graphics card. While the view moves, a random part of them is drawn. */
import * as THREE from "three";
import type { Values } from "../frames";
import { rampTexture } from "./colours";
import { PICK_FRAGMENT, PICK_POINTS_VERTEX, POINTS_FRAGMENT, POINTS_VERTEX } from "./shaders";

/** So many points are drawn while the view moves, at first; then as many as the graphics card can draw smoothly. */
const MOVING = 250_000;
const FEWEST = 20_000;
export const COLOURINGS = ["plain", "height", "strength", "face", "deviation"] as const;
const COLUMNS = ["strength", "deviation", "dn", "vdn", "face", "corrected", "chosen"];

export class Cloud {
  readonly geometry = new THREE.BufferGeometry();
  readonly points: THREE.Points<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  readonly picked: THREE.Points<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  readonly uniforms = {
    palette: { value: null as THREE.Texture | null },
    paletteSize: { value: 1 },
    ramp: { value: rampTexture("viridis") as THREE.Texture },
    range: { value: new THREE.Vector2(0, 1) },
    colouring: { value: 0 },
    threshold: { value: 90 },
    alpha: { value: 0.4 },
    weighted: { value: false },
    shaded: { value: false },
    perspective: { value: false },
    scale: { value: 1 },
    size: { value: 1 },
    least: { value: 1.5 },
    opacity: { value: 1 },
  };
  readonly chosen: Uint8Array;
  moving = MOVING;

  constructor(
    readonly positions: Float32Array,
    readonly spacing: number,
  ) {
    const n = positions.length / 3;
    this.chosen = new Uint8Array(n);
    this.geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    this.geometry.setIndex(new THREE.BufferAttribute(shuffled(n), 1));
    // Columns that are not known yet are one value for all points.
    for (const name of COLUMNS) this.geometry.setAttribute(name, constant(name === "face" ? -1 : name === "deviation" ? 1e30 : 0, n));
    this.geometry.setAttribute("shadeNormal", new THREE.BufferAttribute(new Uint8Array(3 * n).fill(128), 3, true));
    this.column("chosen", this.chosen);
    this.geometry.computeBoundingBox();
    this.geometry.computeBoundingSphere();
    this.uniforms.size.value = 1.5 * spacing;
    const material = { glslVersion: THREE.GLSL3, uniforms: this.uniforms };
    this.points = new THREE.Points(
      this.geometry,
      new THREE.RawShaderMaterial({ ...material, vertexShader: head(POINTS_VERTEX), fragmentShader: POINTS_FRAGMENT }),
    );
    const pick = { ...this.uniforms, size: { value: 2.2 * spacing }, least: { value: 4 } };
    this.picked = new THREE.Points(
      this.geometry,
      new THREE.RawShaderMaterial({ ...material, uniforms: pick, vertexShader: head(PICK_POINTS_VERTEX), fragmentShader: PICK_FRAGMENT }),
    );
    this.points.frustumCulled = this.picked.frustumCulled = false;
  }

  get n(): number {
    return this.chosen.length;
  }

  column(name: string, values: Values): void {
    this.geometry.setAttribute(name, new THREE.BufferAttribute(values, 1));
  }

  normals(values: Uint8Array): void {
    this.geometry.setAttribute("shadeNormal", new THREE.BufferAttribute(values, 3, true));
    this.uniforms.shaded.value = true;
  }

  draw(moving: boolean): void {
    this.geometry.setDrawRange(0, moving ? Math.min(this.moving, this.n) : this.n);
  }

  /** Draw fewer points where the last frame of a movement took too long, more where there was time left. */
  adapt(milliseconds: number): void {
    if (milliseconds > 40) this.moving = Math.max(FEWEST, Math.round(this.moving * 0.7));
    else if (milliseconds < 20) this.moving = Math.min(Math.max(this.n, FEWEST), Math.round(this.moving * 1.15));
  }

  fade(opacity: number): void {
    this.uniforms.opacity.value = opacity;
    this.points.material.transparent = opacity < 1;
    this.points.material.depthWrite = opacity >= 1;
  }

  chosenChanged(): void {
    this.geometry.getAttribute("chosen").needsUpdate = true;
  }

  dispose(): void {
    this.geometry.dispose();
  }
}

/** What three.js declares by itself in its own materials only. */
export function head(shader: string): string {
  return `
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform mat3 normalMatrix;
in vec3 position;
${shader}`;
}

function constant(value: number, n: number): THREE.BufferAttribute {
  return new THREE.BufferAttribute(new Float32Array(n).fill(value), 1);
}

/** A fixed random order, so that the first points of it are an even sample of the cloud. */
function shuffled(n: number): Uint32Array {
  const order = Uint32Array.from({ length: n }, (_, k) => k);
  let seed = 12345;
  for (let k = n - 1; k > 0; k--) {
    seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
    const other = Math.floor((seed / 4294967296) * (k + 1));
    const kept = order[k]!;
    order[k] = order[other]!;
    order[other] = kept;
  }
  return order;
}
