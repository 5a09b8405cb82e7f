/** Binary frames: a length, a JSON header, arrays that are looked at where they lie. */
import type { FrameHeader } from "./messages";

export type Values = Float32Array | Int32Array | Uint32Array | Uint8Array;

export interface Frame {
  header: FrameHeader;
  arrays: Record<string, Values>;
  bytes: number;
}

const VIEWS = { float32: Float32Array, int32: Int32Array, uint32: Uint32Array, uint8: Uint8Array } as const;

export function unpack(buffer: ArrayBuffer): Frame {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length))) as FrameHeader;
  const arrays: Record<string, Values> = {};
  for (const info of header.arrays) {
    const size = info.shape.reduce((product, side) => product * side, 1);
    arrays[info.name] = new VIEWS[info.dtype](buffer, 4 + length + info.offset, size);
  }
  return { header, arrays, bytes: buffer.byteLength };
}
