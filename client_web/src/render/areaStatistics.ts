/** Mean, minimum and maximum of an area's pixels: linear radiance, display values, and luminance in stops. */
import type { Rgb } from "../protocol";
import type { Area } from "../state/areaProbe";
import { decodeRgb9e5 } from "./color/rgb9e5";
import { luminance, toDisplay, type DisplayTransform } from "./color/tonemap";
import { transformColor } from "./color/whiteBalance";
import { MIDDLE_GRAY } from "./histogram";
import type { PixelBuffer } from "./pixels";

interface Range<T> {
  mean: T;
  minimum: T;
  maximum: T;
}

export interface AreaStatistics {
  /** Linear radiance, each channel by itself. */
  radiance: Range<Rgb>;
  /** Display values in [0, 1], each channel by itself. */
  display: Range<Rgb>;
  /** Luminance after exposure and white balance, relative to middle gray; −∞ for black. `mean`: of the mean radiance. */
  stops: Range<number>;
}

class ChannelRange implements Range<Rgb> {
  readonly minimum: Rgb = [Infinity, Infinity, Infinity];
  readonly maximum: Rgb = [-Infinity, -Infinity, -Infinity];
  private readonly sum: Rgb = [0, 0, 0];
  private count = 0;

  add(color: Rgb): void {
    this.count += 1;
    for (const c of [0, 1, 2] as const) {
      this.sum[c] += color[c];
      this.minimum[c] = Math.min(this.minimum[c], color[c]);
      this.maximum[c] = Math.max(this.maximum[c], color[c]);
    }
  }

  get mean(): Rgb {
    return this.sum.map((v) => v / this.count) as Rgb;
  }
}

const stopsOf = (value: number): number => Math.log2(Math.max(0, value) / MIDDLE_GRAY);

/** Statistics of the part of an area that is in the image; null if there is none. */
export function areaStatistics(
  { width, height, encoded }: PixelBuffer,
  { x, y, ...size }: Area,
  transform: DisplayTransform,
): AreaStatistics | null {
  const [right, bottom] = [Math.min(width, x + size.width), Math.min(height, y + size.height)];
  if (right <= x || bottom <= y) return null;
  const [radiance, display] = [new ChannelRange(), new ChannelRange()];
  let [minimum, maximum] = [Infinity, 0];
  for (let row = y; row < bottom; row++)
    for (let column = x; column < right; column++) {
      const color = decodeRgb9e5(encoded[row * width + column] as number);
      const value = luminance(transformColor(transform.matrix, color));
      radiance.add(color);
      display.add(toDisplay(color, transform));
      [minimum, maximum] = [Math.min(minimum, value), Math.max(maximum, value)];
    }
  const mean = luminance(transformColor(transform.matrix, radiance.mean));
  return {
    radiance,
    display,
    stops: { mean: stopsOf(mean), minimum: stopsOf(minimum), maximum: stopsOf(maximum) },
  };
}
