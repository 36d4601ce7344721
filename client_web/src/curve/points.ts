/** Operations on a curve's points. Points are sorted, their angles at least `MIN_GAP` apart; nothing is mutated. */
import type { Point } from "../protocol";
import { MAX_DEGREES, valueAt, type Axes } from "./axes";
import { fitPoints, MAX_POINTS, Stroke, tidyPoint } from "./fit";
import { pchip } from "./pchip";

export const MIN_GAP = 0.01;

function clampDegrees(degrees: number): number {
  return Math.min(MAX_DEGREES, Math.max(0, degrees));
}

/** Add a point; one that is as good as there takes the new value. Returns its index too. */
export function addPoint(points: readonly Point[], degrees: number, value: number): { points: Point[]; index: number } {
  const point = tidyPoint(clampDegrees(degrees), value);
  const near = points.findIndex(([x]) => Math.abs(x - point[0]) < MIN_GAP);
  if (near >= 0) return { points: points.map((p, i) => (i === near ? [p[0], point[1]] : p)), index: near };
  if (points.length >= MAX_POINTS) return { points: [...points], index: -1 };
  const next = [...points, point].sort((a, b) => a[0] - b[0]);
  return { points: next, index: next.indexOf(point) };
}

/** Move a point; its neighbours stop it. */
export function movePoint(points: readonly Point[], index: number, degrees: number, value: number): Point[] {
  const low = (points[index - 1]?.[0] ?? -MIN_GAP) + MIN_GAP;
  const high = (points[index + 1]?.[0] ?? MAX_DEGREES + MIN_GAP) - MIN_GAP;
  const x = Math.min(high, Math.max(low, clampDegrees(degrees)));
  return points.map((p, i) => (i === index ? tidyPoint(x, value) : p));
}

/** Remove a point; two always stay. */
export function removePoint(points: readonly Point[], index: number): Point[] {
  return points.length <= 2 ? [...points] : points.filter((_, i) => i !== index);
}

/** Points with one at each end of a stretch, so that what lies outside keeps its shape. */
function fenced(points: readonly Point[], from: number, to: number): Point[] {
  const curve = pchip(points);
  let next = [...points];
  for (const x of [from, to]) {
    if (x > 0 && x < MAX_DEGREES) next = addPoint(next, x, curve(x)).points;
  }
  return next;
}

const inside = (x: number, from: number, to: number) => x >= from - MIN_GAP / 2 && x <= to + MIN_GAP / 2;

/** Multiply the values of a stretch. The fences stand one band outside it, so the step is as steep as is resolved. */
export function scaleStretch(
  points: readonly Point[],
  from: number,
  to: number,
  factor: number,
  band: number,
): Point[] {
  const outer = fenced(points, clampDegrees(from - band), clampDegrees(to + band));
  return fenced(outer, from, to).map(([x, y]) => (inside(x, from, to) ? tidyPoint(x, y * factor) : [x, y]));
}

/** Move a stretch along the angle; points it runs over give way. */
export function shiftStretch(points: readonly Point[], from: number, to: number, degrees: number): Point[] {
  const shift = Math.min(MAX_DEGREES - to, Math.max(-from, degrees));
  const all = fenced(points, from, to);
  const moved = all.filter(([x]) => inside(x, from, to)).map(([x, y]) => tidyPoint(x + shift, y));
  const kept = all.filter(([x]) => !inside(x, from, to) && !inside(x, from + shift - MIN_GAP, to + shift + MIN_GAP));
  return [...kept, ...moved].sort((a, b) => a[0] - b[0]);
}

/** Lay a freehand stroke over the curve: what it covers is replaced, the rest keeps its points. */
export function mergeStroke(base: readonly Point[], stroke: Stroke, axes: Axes): Point[] {
  const extent = stroke.extent();
  if (extent === null) return [...base];
  const samples = stroke.heights().map(([x, height]): Point => [x, valueAt(axes, Math.max(0, height))]);
  const budget = Math.round(5 + 24 * stroke.share(...extent));
  const fitted = fitPoints(samples, axes, Math.min(MAX_POINTS / 2, budget));
  const [from, to] = [extent[0] - stroke.bandDegrees, extent[1] + stroke.bandDegrees];
  const merged = [...base.filter(([x]) => x < from || x > to), ...fitted].sort((a, b) => a[0] - b[0]);
  return merged.length <= MAX_POINTS ? merged : fitPoints(merged, axes, MAX_POINTS);
}
