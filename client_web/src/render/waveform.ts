/** Waveform of an image: how often each display value occurs in each column, for luma, red, green and blue. */
import { decodeRgb9e5 } from "./color/rgb9e5";
import { luminance, toDisplay, type DisplayTransform } from "./color/tonemap";
import type { PixelBuffer } from "./pixels";

/** More rows than this change the waveform hardly. */
const MAX_ROWS = 120;

export interface Waveform {
  columns: number;
  levels: number;
  /** Sampled pixels of each column. */
  rows: number;
  /** Counts of luma (Rec. 709, of display values); column after column, dark first. */
  luma: Uint32Array;
  /** Red, green, blue. */
  channels: [Uint32Array, Uint32Array, Uint32Array];
}

/** Waveform of uniformly sampled pixels. */
export function computeWaveform(
  { width, height, encoded }: PixelBuffer,
  transform: DisplayTransform,
  columns: number,
  levels: number,
): Waveform {
  const counts = () => new Uint32Array(columns * levels);
  const rows = Math.min(height, MAX_ROWS);
  const result: Waveform = { columns, levels, rows, luma: counts(), channels: [counts(), counts(), counts()] };
  const count = (into: Uint32Array, column: number, value: number) => {
    const at = column * levels + Math.round(Math.min(1, Math.max(0, value)) * (levels - 1));
    into[at] = (into[at] as number) + 1;
  };
  for (let column = 0; column < columns; column++) {
    const x = Math.floor(((column + 0.5) * width) / columns);
    for (let row = 0; row < rows; row++) {
      const y = Math.floor(((row + 0.5) * height) / rows);
      const display = toDisplay(decodeRgb9e5(encoded[y * width + x] as number), transform);
      count(result.luma, column, luminance(display));
      result.channels.forEach((channel, c) => count(channel, column, display[c] as number));
    }
  }
  return result;
}

/** The range of luma that most pixels have, in percent of the display. */
export function summarizeWaveform({ luma, levels, columns, rows }: Waveform): string {
  const sums = new Uint32Array(levels);
  luma.forEach((n, at) => (sums[at % levels] = (sums[at % levels] as number) + n));
  const quantile = (fraction: number) => {
    let sum = 0;
    const level = sums.findIndex((n) => (sum += n) >= fraction * rows * columns);
    return Math.round((100 * level) / (levels - 1));
  };
  return `Median ${quantile(0.5)} %, 98 % in ${quantile(0.01)} to ${quantile(0.99)} %`;
}
