/** The points: one buffer a column, coloured on the graphics card. While the view moves, a random part of them is drawn. */
import * as THREE from "three";
import type { Values } from "../frames";
import { rampTexture } from "./colours";
import { PICK_FRAGMENT, PICK_POINTS_VERTEX, POINTS_FRAGMENT, POINTS_VERTEX } from "./shaders";

export const COLOURINGS = ["plain", "height", "strength", "face", "deviation"] as const;
/** What columns hold that are not known yet: one value for all points. */
const UNKNOWN = { strength: 0, deviation: 1e30, dn: 0, vdn: 0, face: -1, corrected: 0 };

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
  /** Whether each point is chosen, in the order of the input, as `positions`. */
  readonly chosen: Uint8Array;
  /** The order in which points lie in the buffers and are drawn: the first of them are an even sample, and lie together in memory. */
  private readonly order: Uint32Array;

  constructor(
    readonly positions: Float32Array,
    readonly spacing: number,
  ) {
    const n = positions.length / 3;
    this.order = shuffled(n);
    this.chosen = new Uint8Array(n);
    this.column("position", positions, 3);
    for (const [name, value] of Object.entries(UNKNOWN)) this.constant(name, new Float32Array([value]), 1);
    this.constant("shadeNormal", new Float32Array([0.5, 0.5, 0.5]), 3);
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

  /** Give all points a column of values, which are in the order of the input. */
  column(name: string, values: Values, size = 1, normalized = false): void {
    const ordered = new (values.constructor as new (n: number) => Values)(values.length);
    this.fill(ordered, values, size);
    this.geometry.setAttribute(name, new THREE.BufferAttribute(ordered, size, normalized));
  }

  normals(values: Uint8Array): void {
    this.column("shadeNormal", values, 3, true);
    this.uniforms.shaded.value = true;
  }

  /** Draw so many points, all unless there are as many. */
  draw(count: number): void {
    this.geometry.setDrawRange(0, Math.min(count, this.n));
  }

  fade(opacity: number): void {
    this.uniforms.opacity.value = opacity;
    this.points.material.transparent = opacity < 1;
    this.points.material.depthWrite = opacity >= 1;
  }

  chosenChanged(): void {
    const attribute = this.geometry.getAttribute("chosen");
    this.fill(attribute.array as Uint8Array, this.chosen, 1);
    attribute.needsUpdate = true;
  }

  dispose(): void {
    this.geometry.dispose();
  }

  private constant(name: string, value: Float32Array, size: number): void {
    // What is given once an instance is the same for all points where there is one instance.
    this.geometry.setAttribute(name, new THREE.InstancedBufferAttribute(value, size));
  }

  private fill(ordered: Values, values: Values, size: number): void {
    const { order } = this;
    if (size === 1) for (let k = 0; k < order.length; k++) ordered[k] = values[order[k]!]!;
    else for (let k = 0; k < order.length; k++) for (let i = 0; i < size; i++) ordered[size * k + i] = values[size * order[k]! + i]!;
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
