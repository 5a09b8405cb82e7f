/** Colour ramps and palettes as small textures, and the same colours for legends. */
import * as THREE from "three";

type Rgb = [number, number, number];
const RAMPS: Record<string, Rgb[]> = {
  viridis: [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]],
  heat: [[255, 214, 102], [255, 166, 61], [247, 105, 67], [224, 49, 86], [192, 38, 132]],
  diverging: [[49, 104, 214], [126, 176, 238], [232, 232, 226], [244, 165, 116], [205, 45, 50]],
};
export type Ramp = keyof typeof RAMPS;

export function rampColour(ramp: string, at: number): Rgb {
  const stops = RAMPS[ramp] ?? RAMPS["viridis"]!;
  const place = Math.min(Math.max(at, 0), 1) * (stops.length - 1);
  const k = Math.min(Math.floor(place), stops.length - 2);
  const a = stops[k]!;
  const b = stops[k + 1]!;
  return [0, 1, 2].map((i) => Math.round(a[i]! + (b[i]! - a[i]!) * (place - k))) as Rgb;
}

export function css([r, g, b]: readonly number[]): string {
  return `rgb(${r}, ${g}, ${b})`;
}

function texture(data: Uint8Array, width: number, filter: THREE.MagnificationTextureFilter): THREE.DataTexture {
  const made = new THREE.DataTexture(data, width, 1, THREE.RGBAFormat);
  made.magFilter = made.minFilter = filter;
  made.needsUpdate = true;
  return made;
}

const ramps = new Map<string, THREE.DataTexture>();
export function rampTexture(ramp: string): THREE.DataTexture {
  let made = ramps.get(ramp);
  if (!made) {
    const data = new Uint8Array(256 * 4);
    for (let k = 0; k < 256; k++) data.set([...rampColour(ramp, k / 255), 255], 4 * k);
    ramps.set(ramp, (made = texture(data, 256, THREE.LinearFilter)));
  }
  return made;
}

/** One colour a face number; chosen faces are bright, the others fade while some are chosen. */
export function paletteTexture(colours: Map<number, readonly number[]>, chosen: readonly number[]): { map: THREE.DataTexture; size: number } {
  const size = Math.max(1, ...[...colours.keys()].map((face) => face + 1));
  const data = new Uint8Array(size * 4).fill(128);
  for (const [face, colour] of colours) {
    const on = chosen.includes(face);
    const rgb = colour.map((c) => Math.round(255 * (chosen.length === 0 ? c : on ? 0.35 + 0.65 * c : 0.2 + 0.28 * c)));
    data.set([...rgb, on ? 255 : 0], 4 * face);
  }
  return { map: texture(data, size, THREE.NearestFilter), size };
}
