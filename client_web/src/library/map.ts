/** Sun's navigation map: where a point of the plane lies on the plot. Reflectance by its root, roughness by its logarithm. */
export interface Range {
  f0: [low: number, high: number];
  sigma: [low: number, high: number];
}
export interface Place {
  x: number;
  y: number;
}

const share = (value: number, [low, high]: [number, number]) => (value - low) / (high - low || 1);
const between = (at: number, [low, high]: [number, number]) => low + Math.min(1, Math.max(0, at)) * (high - low);

/** Of the materials on the map; at least two. */
export function rangeOf(points: readonly { f0: number; sigma: number }[]): Range {
  const [f0, sigma] = [points.map((p) => p.f0), points.map((p) => p.sigma)];
  return { f0: [Math.min(...f0), Math.max(...f0)], sigma: [Math.min(...sigma), Math.max(...sigma)] };
}

const roots = (range: Range): [number, number] => [Math.sqrt(range.f0[0]), Math.sqrt(range.f0[1])];
const logs = (range: Range): [number, number] => [Math.log(range.sigma[0]), Math.log(range.sigma[1])];

/** Place in a unit square, smooth and dark at the upper left. */
export function placeOf(point: { f0: number; sigma: number }, range: Range): Place {
  return { x: share(Math.sqrt(point.f0), roots(range)), y: share(Math.log(point.sigma), logs(range)) };
}

/** The inverse; places outside the square are moved to its edge. */
export function pointOf(place: Place, range: Range): { f0: number; sigma: number } {
  return { f0: between(place.x, roots(range)) ** 2, sigma: Math.exp(between(place.y, logs(range))) };
}
