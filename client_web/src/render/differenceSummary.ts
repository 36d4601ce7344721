/** Mean and largest difference of two images. */
import { deltaE, stopsBetween } from "./color/difference";
import { decodeRgb9e5 } from "./color/rgb9e5";
import { toDisplay, type DisplayTransform } from "./color/tonemap";
import type { PixelBuffer } from "./pixels";

export interface DifferenceSummary {
  mean: number;
  /** Of the largest magnitude, with its sign. */
  maximum: number;
  /** Every so many pixels were read. */
  step: number;
}

const MAX_SAMPLES = 50_000;

/** Mean and maximum of a difference A − B; null for images of different sizes. */
export function summarizeDifference(
  a: PixelBuffer,
  b: PixelBuffer,
  transform: DisplayTransform,
  mode: "stops" | "delta_e",
): DifferenceSummary | null {
  if (a.width !== b.width || a.height !== b.height) return null;
  // an odd step avoids aliasing with the image's columns
  const step = a.encoded.length > MAX_SAMPLES ? Math.ceil(a.encoded.length / MAX_SAMPLES) | 1 : 1;
  let [sum, maximum, count] = [0, 0, 0];
  for (let i = 0; i < a.encoded.length; i += step) {
    const [x, y] = [decodeRgb9e5(a.encoded[i] as number), decodeRgb9e5(b.encoded[i] as number)];
    const difference =
      mode === "stops" ? stopsBetween(x, y, transform) : deltaE(toDisplay(x, transform), toDisplay(y, transform));
    sum += difference;
    count += 1;
    if (Math.abs(difference) > Math.abs(maximum)) maximum = difference;
  }
  return { mean: sum / count, maximum, step };
}
