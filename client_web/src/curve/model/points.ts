/** Operations on a curve's points. Points are sorted; those placed by the user are about a `band` apart, the curve's
 * resolution. Nothing is mutated; unchanged points are the same objects. */
import type { Point } from "../../protocol";
import { MAX_DEGREES } from "./axes";
import { MAX_POINTS, roundPoint } from "./fit";

/** Minimum distance between neighbors, in bands. */
const GAP = 0.9;

/** The nearest valid angle of a point: the outer halves of the first and the last band snap to 0° and 90°. */
function pointAtBand(degrees: number, band: number): number {
  if (degrees < band / 2) return 0;
  return degrees > MAX_DEGREES - band / 2 ? MAX_DEGREES : degrees;
}

/** Add a point, or move a nearby one to the new value. Also returns its index, -1 if there is no room. */
export function addPoint(
  points: readonly Point[],
  degrees: number,
  value: number,
  band: number,
): { points: Point[]; index: number } {
  const point = roundPoint(pointAtBand(degrees, band), value);
  const distances = points.map(([x]) => Math.abs(x - point[0]));
  const nearestIndex = distances.indexOf(Math.min(...distances));
  if (distances[nearestIndex] !== undefined && distances[nearestIndex] < GAP * band) {
    return { points: points.map((p, i) => (i === nearestIndex ? [p[0], point[1]] : p)), index: nearestIndex };
  }
  if (points.length >= MAX_POINTS) return { points: [...points], index: -1 };
  const next = [...points, point].sort((a, b) => a[0] - b[0]);
  return { points: next, index: next.indexOf(point) };
}

/** Move a point, at most to its neighbors. */
export function movePoint(
  points: readonly Point[],
  index: number,
  degrees: number,
  value: number,
  band: number,
): Point[] {
  const current = points[index]?.[0] ?? 0;
  const low = Math.min(current, (points[index - 1]?.[0] ?? -MAX_DEGREES) + GAP * band);
  const high = Math.max(current, (points[index + 1]?.[0] ?? 2 * MAX_DEGREES) - GAP * band);
  const x = degrees === current ? current : Math.min(high, Math.max(low, pointAtBand(degrees, band)));
  return points.map((p, i) => (i === index ? roundPoint(x, value) : p));
}

/** Remove a point; at least two remain. */
export function removePoint(points: readonly Point[], index: number): Point[] {
  return points.length <= 2 ? [...points] : points.filter((_, i) => i !== index);
}
