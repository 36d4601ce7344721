/** Operations on a curve's points. Points are sorted, those placed by the user about a `band` apart: nothing finer is
 * resolved. Nothing is mutated; points that stay are the same objects. */
import type { Point } from "../../protocol";
import { MAX_DEGREES } from "./axes";
import { MAX_POINTS, roundPoint } from "./fit";

/** Degrees between neighbors, in bands. */
const GAP = 0.9;

/** An angle where a point can stand: the outer halves of the first and the last band are their ends. */
function pointAtBand(degrees: number, band: number): number {
  if (degrees < band / 2) return 0;
  return degrees > MAX_DEGREES - band / 2 ? MAX_DEGREES : degrees;
}

/** Add a point; one that is as good as there takes the new value. Returns its index too, -1 where there is no room. */
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

/** Move a point; its neighbors stop it. */
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

/** Remove a point; two always stay. */
export function removePoint(points: readonly Point[], index: number): Point[] {
  return points.length <= 2 ? [...points] : points.filter((_, i) => i !== index);
}
