/** Monotone cubic interpolation (PCHIP, Fritsch & Carlson 1980, with the end rule of Moler's pchiptx), the rule by which
 * the server reads a curve's points: no overshoot between them, constant outside. */
import type { Point } from "../../protocol";

function endSlope(h0: number, h1: number, d0: number, d1: number): number {
  const slope = ((2 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
  if (Math.sign(slope) !== Math.sign(d0)) return 0;
  if (Math.sign(d0) !== Math.sign(d1) && Math.abs(slope) > 3 * Math.abs(d0)) return 3 * d0;
  return slope;
}

function pchipSlopes(points: readonly Point[]): number[] {
  const n = points.length;
  const h = points.slice(1).map((p, i) => p[0] - (points[i] as Point)[0]);
  const d = points.slice(1).map((p, i) => (p[1] - (points[i] as Point)[1]) / (h[i] as number));
  if (n === 2) return [d[0] as number, d[0] as number];
  const inner = Array.from({ length: n - 2 }, (_, i) => {
    const [d0, d1, h0, h1] = [d[i] as number, d[i + 1] as number, h[i] as number, h[i + 1] as number];
    if (d0 * d1 <= 0) return 0;
    const [w0, w1] = [2 * h1 + h0, h1 + 2 * h0];
    return (w0 + w1) / (w0 / d0 + w1 / d1);
  });
  const first = endSlope(h[0] as number, h[1] as number, d[0] as number, d[1] as number);
  const last = endSlope(h[n - 2] as number, h[n - 3] as number, d[n - 2] as number, d[n - 3] as number);
  return [first, ...inner, last];
}

/** The interpolant of at least one point, with strictly increasing angles; never below zero. */
export function pchip(points: readonly Point[]): (degrees: number) => number {
  const first = points[0];
  const last = points.at(-1);
  if (first === undefined || last === undefined) return () => 0;
  const m = points.length > 1 ? pchipSlopes(points) : [0];
  return (x) => {
    if (x <= first[0]) return first[1];
    if (x >= last[0]) return last[1];
    let low = 0;
    let high = points.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if ((points[middle] as Point)[0] <= x) low = middle;
      else high = middle;
    }
    const [x0, y0] = points[low] as Point;
    const [x1, y1] = points[high] as Point;
    const h = x1 - x0;
    const t = (x - x0) / h;
    const [t2, t3] = [t * t, t * t * t];
    const y =
      (2 * t3 - 3 * t2 + 1) * y0 +
      (t3 - 2 * t2 + t) * h * (m[low] as number) +
      (3 * t2 - 2 * t3) * y1 +
      (t3 - t2) * h * (m[high] as number);
    return Math.max(0, y);
  };
}

/** Nodes of the three-point Gauss rule on [0, 1], and their weights: exact for cubics. */
const GAUSS: [number, number][] = [
  [0.5 - Math.sqrt(0.15), 5 / 18],
  [0.5, 8 / 18],
  [0.5 + Math.sqrt(0.15), 5 / 18],
];

/** The interpolated curve as averages over equal bands of 0…90°. */
export function averageBands(points: readonly Point[], numBands: number): number[] {
  const curve = pchip(points);
  const valueAtBand = (band: number) => curve((90 * band) / numBands);
  return Array.from({ length: numBands }, (_, j) => GAUSS.reduce((sum, [x, w]) => sum + w * valueAtBand(j + x), 0));
}
