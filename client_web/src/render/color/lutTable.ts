/** A view of the server's OpenColorIO config as an N³ table with the shaper s(x) = log(1 + G √x) / (2 log(1 + G)) per
 * channel, red slowest, with tetrahedral interpolation. The shader and the server compute the same. */
import { LUT_GAIN, LUT_SIZE, type Rgb } from "../../protocol";

/** Display values in [0, 1]; (N, N, N, 3). */
export type LutTable = Float32Array;

const LAST = LUT_SIZE - 1;
const SCALE = LAST / (2 * Math.log1p(LUT_GAIN));
/** Index strides of the channels. */
const STEPS = [3 * LUT_SIZE * LUT_SIZE, 3 * LUT_SIZE, 3] as const;

/** From 16-bit numbers, little-endian, as sent by the server. */
export function parseLut(bytes: ArrayBuffer): LutTable {
  const view = new DataView(bytes);
  return Float32Array.from({ length: bytes.byteLength / 2 }, (_, i) => view.getUint16(2 * i, true) / 65535);
}

/** Display values of a radiance after exposure. */
export function sampleLut(table: LutTable, radiance: Rgb): Rgb {
  const coordinates = radiance.map((x) => Math.min(LAST, SCALE * Math.log1p(LUT_GAIN * Math.sqrt(Math.max(0, x)))));
  const nodes = coordinates.map((coordinate) => Math.min(LAST - 1, Math.floor(coordinate)));
  const steps = coordinates.map((coordinate, c) => ({
    fraction: coordinate - (nodes[c] as number),
    by: STEPS[c] as number,
  }));
  steps.sort((a, b) => b.fraction - a.fraction); // the largest fraction first: from the corner at 0 to the one at 1
  let index = nodes.reduce((sum, node, c) => sum + node * (STEPS[c] as number), 0);
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
