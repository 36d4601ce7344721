/** RGB9_E5 shared-exponent pixels (EXT_texture_shared_exponent): 9 bits each for R, G, B and one 5-bit exponent. */
import type { Rgb } from "../../protocol";

const BIAS = 15;
const MANTISSA_BITS = 9;
const LARGEST = ((2 ** MANTISSA_BITS - 1) / 2 ** MANTISSA_BITS) * 2 ** (31 - BIAS);
const SCALES = Float64Array.from({ length: 32 }, (_, e) => 2 ** (e - BIAS - MANTISSA_BITS));

export function decodeRgb9e5(word: number): Rgb {
  const scale = SCALES[word >>> 27] ?? 0;
  return [(word & 511) * scale, ((word >>> 9) & 511) * scale, ((word >>> 18) & 511) * scale];
}

export function encodeRgb9e5(r: number, g: number, b: number): number {
  const clamp = (value: number) => (value > 0 ? Math.min(value, LARGEST) : 0);
  const [cr, cg, cb] = [clamp(r), clamp(g), clamp(b)];
  const largest = Math.max(cr, cg, cb);
  if (largest === 0) return 0;
  let exponent = Math.max(-BIAS - 1, Math.floor(Math.log2(largest))) + 1 + BIAS;
  // rounding up may need one more bit than the mantissa has
  if (Math.floor(largest / (SCALES[exponent] ?? 1) + 0.5) === 2 ** MANTISSA_BITS) exponent += 1;
  const scale = SCALES[exponent] ?? 1;
  const mantissa = (value: number) => Math.floor(value / scale + 0.5);
  return (mantissa(cr) | (mantissa(cg) << 9) | (mantissa(cb) << 18) | (exponent << 27)) >>> 0;
}
