/** Fits few editable control points to many samples of a curve. */
import { MAX_CURVE_VALUE } from "../../look.gen";
import type { Point } from "../../protocol";
import { xFraction, yFraction, type CurveAxes } from "./axes";
import { sampleBands } from "./edits";
import { pchip } from "./pchip";

export const MAX_POINTS = 64;
const TOLERANCE = 0.004;

/** Six digits exceed an image's precision and keep the document readable. */
export function roundValue(value: number): number {
  return Number(Math.min(MAX_CURVE_VALUE, Math.max(0, value)).toPrecision(6));
}

export function roundPoint(degrees: number, value: number): Point {
  return [Number(degrees.toFixed(3)), roundValue(value)];
}

/** Few points whose monotone cubic stays within `TOLERANCE` of the plot's height of all `samples` (angles increasing).
 * Greedy: the worst sample becomes the next point. */
export function fitPoints(samples: readonly Point[], axes: CurveAxes, maxPoints = 24): Point[] {
  const first = samples[0];
  const last = samples.at(-1);
  if (first === undefined || last === undefined) return [];
  if (samples.length <= 2) return samples.map(([x, y]) => roundPoint(x, y));
  const selected = new Set<number>([0, samples.length - 1]);
  while (selected.size < Math.min(maxPoints, samples.length)) {
    const points = [...selected].sort((a, b) => a - b).map((i) => samples[i] as Point);
    const curve = pchip(points);
    let worst = TOLERANCE;
    let worstIndex = -1;
    samples.forEach(([x, y], i) => {
      const error = Math.abs(yFraction(axes, y) - yFraction(axes, curve(x)));
      if (error > worst && !selected.has(i)) [worst, worstIndex] = [error, i];
    });
    if (worstIndex < 0) break;
    selected.add(worstIndex);
  }
  return [...selected].sort((a, b) => a - b).map((i) => roundPoint(...(samples[i] as Point)));
}

/** Band averages as samples at the band centers, with the ends extended to 0° and 90°. */
export function bandSamples(bands: readonly number[], maxDegrees = 90): Point[] {
  const width = maxDegrees / bands.length;
  const inner = bands.map((value, j): Point => [(j + 0.5) * width, value]);
  return [[0, bands[0] ?? 0], ...inner, [maxDegrees, bands.at(-1) ?? 0]];
}

/** Band averages as samples at valid point angles: the first and the last band's at 0° and 90°. */
export function knotSamples(bands: readonly number[], maxDegrees = 90): Point[] {
  const width = maxDegrees / bands.length;
  const last = bands.length - 1;
  return bands.map((value, j) => [j === 0 ? 0 : j === last ? maxDegrees : (j + 0.5) * width, value]);
}

/** Points at given angles, exactly on the curve: used after rounding their angles. */
export function outlinePoints(points: readonly Point[], bands: readonly number[]): Point[] {
  return points.map(([degrees]) => {
    const [x] = roundPoint(degrees, 0);
    return roundPoint(x, sampleBands(bands, x));
  });
}

/** A freehand stroke: a smoothed height per covered band; later passes overwrite earlier ones. */
export class BrushStroke {
  private readonly values: Float64Array;
  private last: Point | null = null;

  constructor(
    private readonly numBands: number,
    private readonly axes: CurveAxes,
  ) {
    // heights in the plot, so that smoothing acts alike on linear and logarithmic axes
    this.values = new Float64Array(numBands).fill(Number.NaN);
  }

  private bin(degrees: number): number {
    return Math.min(this.numBands - 1, Math.max(0, Math.floor((degrees / 90) * this.numBands)));
  }

  add(degrees: number, height: number): void {
    const [fromX, fromY] = this.last ?? [degrees, height];
    const [a, b] = [this.bin(fromX), this.bin(degrees)];
    const step = a <= b ? 1 : -1;
    for (let j = a; j !== b + step; j += step) {
      this.values[j] = a === b ? height : fromY + ((height - fromY) * (j - a)) / (b - a);
    }
    this.last = [degrees, height];
  }

  /** First and last drawn band. */
  range(): [first: number, last: number] | null {
    const a = this.values.findIndex((v) => !Number.isNaN(v));
    const b = this.values.findLastIndex((v) => !Number.isNaN(v));
    return a < 0 ? null : [a, b];
  }

  /** Heights from the first band to the last, smoothed by `passes` of a binomial filter; the ends stay fixed. */
  heights(passes = 6): number[] {
    const range = this.range();
    if (range === null) return [];
    let heights = Array.from(this.values.subarray(range[0], range[1] + 1));
    for (let pass = 0; pass < passes; pass++) {
      heights = heights.map((v, i) => {
        const [previous, after] = [heights[i - 1], heights[i + 1]];
        return previous === undefined || after === undefined ? v : 0.25 * previous + 0.5 * v + 0.25 * after;
      });
    }
    return heights;
  }

  /** Fraction of the plot's width that the stroke covers; it determines the number of points. */
  mergeAxes(): number {
    const [first, last] = this.range() ?? [0, 0];
    return xFraction(this.axes, (90 * (last + 1)) / this.numBands) - xFraction(this.axes, (90 * first) / this.numBands);
  }
}
