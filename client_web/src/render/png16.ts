/** Decodes 16-bit gray PNGs: browsers reduce them to 8 bits, too few for material ids. */

import { decode } from "fast-png";

const SIGNATURE = [137, 80, 78, 71, 13, 10, 26, 10];
const [WIDTH_AT, HEIGHT_AT, DEPTH_AT, COLOR_TYPE_AT] = [16, 20, 24, 25]; // in the header, which is always the first chunk
const HEADER_BYTES = 33;
const MAX_PIXELS = 1 << 26;

export interface MaterialIds {
  width: number;
  height: number;
  /** Row-major, top row first; 65535 = background. */
  values: Uint16Array;
}

/** Reject anything but a 16-bit gray PNG of acceptable size, before decompressing it. */
function checkHeader(buffer: ArrayBuffer): void {
  const bytes = new Uint8Array(buffer);
  if (bytes.length < HEADER_BYTES || SIGNATURE.some((byte, i) => bytes[i] !== byte)) {
    throw new Error("the material image is not a PNG");
  }
  if (bytes[DEPTH_AT] !== 16 || bytes[COLOR_TYPE_AT] !== 0) throw new Error("the material image is not 16-bit gray");
  const view = new DataView(buffer);
  const pixels = view.getUint32(WIDTH_AT) * view.getUint32(HEIGHT_AT);
  if (pixels === 0 || pixels > MAX_PIXELS) throw new Error("the material image has no usable size");
}

/** Decode the ids of an image. Throws if it is not a 16-bit gray PNG, too large or damaged. */
export function decodeIds(buffer: ArrayBuffer): MaterialIds {
  checkHeader(buffer);
  const { width, height, data } = decode(buffer, { checkCrc: true });
  if (!(data instanceof Uint16Array)) throw new Error("the material image is not 16-bit gray");
  return { width, height, values: data };
}
