/** Sun's navigation map: positions on the plot. Reflectance by its square root, roughness by its logarithm. */
import type { ParamValue, Term } from "../../protocol";

export interface HighlightRange {
  f0: [low: number, high: number];
  sigma: [low: number, high: number];
}
export interface Highlight {
  f0: number;
  sigma: number;
}
export interface MapPosition {
  x: number;
  y: number;
}

const fractionOf = (value: number, [low, high]: [number, number]) => (value - low) / (high - low || 1);
const interpolate = (fraction: number, [low, high]: [number, number]) =>
  low + Math.min(1, Math.max(0, fraction)) * (high - low);

/** Range over the materials on the map; at least two. */
export function mapRange(points: readonly Highlight[]): HighlightRange {
  const [f0, sigma] = [points.map((p) => p.f0), points.map((p) => p.sigma)];
  return { f0: [Math.min(...f0), Math.max(...f0)], sigma: [Math.min(...sigma), Math.max(...sigma)] };
}

const mean = (value: ParamValue | undefined, otherwise: number): number =>
  value === undefined ? otherwise : typeof value === "number" ? value : (value[0] + value[1] + value[2]) / 3;

/** Position of a material's highlight on the map; null if it has no Cook–Torrance highlight. */
export function highlightOf(terms: readonly Term[]): Highlight | null {
  const params = terms.find(({ model }) => model === "cook_torrance")?.params;
  if (params === undefined) return null;
  const [n, k] = [mean(params.ior, 1.5), mean(params.extinction, 0)];
  return { f0: ((n - 1) ** 2 + k ** 2) / ((n + 1) ** 2 + k ** 2), sigma: mean(params.sigma, 0.2) };
}

const squareRootRange = (range: HighlightRange): [number, number] => [Math.sqrt(range.f0[0]), Math.sqrt(range.f0[1])];
const logRange = (range: HighlightRange): [number, number] => [Math.log(range.sigma[0]), Math.log(range.sigma[1])];

/** Position in the unit square; smooth and dark is at the upper left. */
export function positionOf(point: Highlight, range: HighlightRange): MapPosition {
  return {
    x: fractionOf(Math.sqrt(point.f0), squareRootRange(range)),
    y: fractionOf(Math.log(point.sigma), logRange(range)),
  };
}

/** Inverse of `positionOf`; points outside the square are clamped to its edge. */
export function highlightAt(position: MapPosition, range: HighlightRange): Highlight {
  return {
    f0: interpolate(position.x, squareRootRange(range)) ** 2,
    sigma: Math.exp(interpolate(position.y, logRange(range))),
  };
}
