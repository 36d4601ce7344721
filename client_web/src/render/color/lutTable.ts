/** LUTs as N³ tables, red slowest, with tetrahedral interpolation. Those of views of the server's OpenColorIO config have
 * the shaper s(x) = log(1 + G √x) / (2 log(1 + G)) per channel; display LUTs are linear in display values. The shader and
 * the server compute the same. */
import { LUT_GAIN, LUT_SIZE, type Rgb } from "../../protocol";

/** Display values in [0, 1]; (N, N, N, 3). */
export type LutTable = Float32Array;

const LAST = LUT_SIZE - 1;
const SCALE = LAST / (2 * Math.log1p(LUT_GAIN));

/** From 16-bit numbers, little-endian, as sent by the server. */
export function parseLut(bytes: ArrayBuffer): LutTable {
  const view = new DataView(bytes);
  return Float32Array.from({ length: bytes.byteLength / 2 }, (_, i) => view.getUint16(2 * i, true) / 65535);
}

/** Nodes per channel. */
export const lutSize = (table: LutTable): number => Math.round(Math.cbrt(table.length / 3));

/** Display values of a radiance after exposure, by the table of a view. */
export function sampleLut(table: LutTable, radiance: Rgb): Rgb {
  const shaped = (x: number) => Math.min(LAST, SCALE * Math.log1p(LUT_GAIN * Math.sqrt(Math.max(0, x))));
  return interpolate(table, LUT_SIZE, radiance.map(shaped) as Rgb);
}

/** Display values by a display LUT, of display values in [0, 1]. */
export function sampleDisplayLut(table: LutTable, display: Rgb): Rgb {
  const size = lutSize(table);
  return interpolate(table, size, display.map((x) => (size - 1) * Math.min(1, Math.max(0, x))) as Rgb);
}

/** `coordinates`: in nodes, 0 to `size` − 1. */
function interpolate(table: LutTable, size: number, coordinates: Rgb): Rgb {
  const strides = [3 * size * size, 3 * size, 3] as const;
  const nodes = coordinates.map((coordinate) => Math.min(size - 2, Math.floor(coordinate)));
  const steps = coordinates.map((coordinate, c) => ({
    fraction: coordinate - (nodes[c] as number),
    by: strides[c] as number,
  }));
  steps.sort((a, b) => b.fraction - a.fraction); // the largest fraction first: from the corner at 0 to the one at 1
  let index = nodes.reduce((sum, node, c) => sum + node * (strides[c] as number), 0);
  const displayed: Rgb = [0, 0, 0];
  let previousFraction = 1;
  for (const { fraction, by } of [...steps, { fraction: 0, by: 0 }]) {
    for (let c = 0; c < 3; c++)
      displayed[c] = (displayed[c] as number) + (previousFraction - fraction) * (table[index + c] as number);
    index += by;
    previousFraction = fraction;
  }
  return displayed;
}
