/** Histogram of an image: luminance, red, green and blue in stops relative to middle gray. */
import { decodeRgb9e5 } from "./color/rgb9e5";
import { luminance } from "./color/tonemap";
import { transformColor, type Matrix } from "./color/whiteBalance";

export const MIDDLE_GRAY = 0.18;
export const MIN_STOP = -10;
export const MAX_STOP = 8;
export const BINS_PER_STOP = 6;
export const NUM_BINS = (MAX_STOP - MIN_STOP) * BINS_PER_STOP;
/** More samples than this change no bar visibly. */
const MAX_SAMPLES = 60_000;

export interface Histogram {
  luminance: Uint32Array;
  /** Red, green, blue. */
  channels: [Uint32Array, Uint32Array, Uint32Array];
  samples: number;
}

/** The bin of a radiance, clamped to the first and the last. */
export function binIndex(value: number): number {
  const stop = Math.log2(Math.max(value, 1e-12) / MIDDLE_GRAY);
  return Math.min(NUM_BINS - 1, Math.max(0, Math.floor((stop - MIN_STOP) * BINS_PER_STOP)));
}

/** Histogram of RGB9_E5 pixels under a display matrix; a large image is sampled uniformly. */
export function computeHistogram(encoded: Uint32Array, matrix: Matrix): Histogram {
  const bins = () => new Uint32Array(NUM_BINS);
  const result: Histogram = { luminance: bins(), channels: [bins(), bins(), bins()], samples: 0 };
  const count = (bins: Uint32Array, value: number) => {
    const bin = binIndex(value);
    bins[bin] = (bins[bin] as number) + 1;
  };
  // an odd step avoids aliasing with the image's columns
  const step = Math.ceil(encoded.length / MAX_SAMPLES) | 1;
  for (let i = 0; i < encoded.length; i += step) {
    const rgb = transformColor(matrix, decodeRgb9e5(encoded[i] as number));
    count(result.luminance, luminance(rgb));
    result.channels.forEach((channel, c) => count(channel, rgb[c] as number));
    result.samples += 1;
  }
  return result;
}

/** Quantile of the luminances in stops, to a bin's precision. */
export function percentile(histogram: Histogram, fraction: number): number {
  let sum = 0;
  const bin = histogram.luminance.findIndex((n) => (sum += n) >= fraction * histogram.samples);
  return MIN_STOP + (Math.max(0, bin) + 0.5) / BINS_PER_STOP;
}
