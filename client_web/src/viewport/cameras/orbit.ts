/** A camera that orbits a target. Angles in radians, lengths in meters, +Y up. */
import type { Triple } from "../../protocol";
import { add, cross, dot, length, scale, subtract, normalize } from "../../panels/lights/vector";

export interface Orbit {
  target: Triple;
  distance: number;
  /** Azimuth around +Y, from +Z towards +X. */
  azimuth: number;
  /** Elevation above the horizon. */
  elevation: number;
  /** Roll around the view direction, counterclockwise; 0 is upright. */
  roll: number;
  /** Vertical field of view, degrees. */
  yfov: number;
}

export interface CameraPose {
  /** Camera to world, 16 numbers in row-major order; the camera looks along -Z. */
  to_world: number[];
  yfov: number;
}

export interface Bounds {
  lowest: Triple;
  highest: Triple;
}

export const MIN_YFOV = 1;
export const MAX_YFOV = 120;
const HIGHEST = (89.9 * Math.PI) / 180; // straight down, the up direction is undefined
const NEAREST = 1e-4; // fraction of the scene's size
const FARTHEST = 50;

const clamp = (value: number, low: number, high: number) => Math.min(high, Math.max(low, value));

type Axes = { right: Triple; up: Triple; backward: Triple };

function horizontalAxes(azimuth: number, elevation: number): Axes {
  const flat = Math.cos(elevation);
  const backward: Triple = [Math.sin(azimuth) * flat, Math.sin(elevation), Math.cos(azimuth) * flat];
  const right: Triple = [Math.cos(azimuth), 0, -Math.sin(azimuth)];
  return { right, up: cross(backward, right), backward };
}

function cameraAxes({ azimuth, elevation, roll }: Orbit): Axes {
  const { right, up, backward } = horizontalAxes(azimuth, elevation);
  const [cosine, sine] = [Math.cos(roll), Math.sin(roll)];
  const rotated = add(scale(right, cosine), scale(up, sine));
  return { right: rotated, up: add(scale(up, cosine), scale(right, -sine)), backward };
}

export const diagonalOf = ({ lowest, highest }: Bounds): number => Math.max(1e-6, length(subtract(highest, lowest)));
const centerOf = ({ lowest, highest }: Bounds): Triple => scale(add(lowest, highest), 0.5);

export function poseOf(orbit: Orbit): CameraPose {
  const { right, up, backward } = cameraAxes(orbit);
  const position = add(orbit.target, scale(backward, orbit.distance));
  const rows = [0, 1, 2].flatMap((k) => [right[k], up[k], backward[k], position[k]] as number[]);
  return { to_world: [...rows, 0, 0, 0, 1], yfov: orbit.yfov };
}

/** The orbit of a camera around `target`, the point in its image's center; null: the middle of the scene's depth. */
export function orbitOf({ to_world: m, yfov }: CameraPose, bounds: Bounds, target: Triple | null = null): Orbit {
  const column = (k: number): Triple => [m[k] as number, m[4 + k] as number, m[8 + k] as number];
  const position = column(3);
  const backward = normalize(column(2));
  const depth = dot(subtract(position, target ?? centerOf(bounds)), backward);
  const distance = clamp(depth, (target === null ? 0.05 : NEAREST) * diagonalOf(bounds), FARTHEST * diagonalOf(bounds));
  const azimuth = Math.atan2(backward[0], backward[2]);
  const elevation = clamp(Math.asin(clamp(backward[1], -1, 1)), -HIGHEST, HIGHEST);
  const [level, right] = [horizontalAxes(azimuth, elevation), normalize(column(0))];
  const roll = Math.atan2(dot(right, level.up), dot(right, level.right));
  return { target: subtract(position, scale(backward, distance)), distance, azimuth, elevation, roll, yfov };
}

export function rotateOrbit(orbit: Orbit, azimuth: number, elevation: number): Orbit {
  const next = clamp(orbit.elevation + elevation, -HIGHEST, HIGHEST);
  return { ...orbit, azimuth: orbit.azimuth + azimuth, elevation: next };
}

/** Pan with the image: by fractions of its height to the right and down, at the target's depth. */
export function panOrbit(orbit: Orbit, across: number, down: number): Orbit {
  const { right, up } = cameraAxes(orbit);
  const height = 2 * orbit.distance * Math.tan((orbit.yfov * Math.PI) / 360);
  const move = add(scale(right, -across * height), scale(up, down * height));
  return { ...orbit, target: add(orbit.target, move) };
}

export function dollyOrbit(orbit: Orbit, factor: number, bounds: Bounds): Orbit {
  const size = diagonalOf(bounds);
  return { ...orbit, distance: clamp(orbit.distance * factor, NEAREST * size, FARTHEST * size) };
}

export const levelOrbit = (orbit: Orbit): Orbit => ({ ...orbit, roll: 0 });

export const withFieldOfView = (orbit: Orbit, yfov: number): Orbit => ({
  ...orbit,
  yfov: clamp(yfov, MIN_YFOV, MAX_YFOV),
});

/** The shortest signed difference between two angles. */
const interpolateAngle = (from: number, to: number) =>
  ((((to - from + Math.PI) % (2 * Math.PI)) + 2 * Math.PI) % (2 * Math.PI)) - Math.PI;

/** Interpolate between two orbits. */
export function interpolateOrbits(from: Orbit, to: Orbit, fraction: number): Orbit {
  const mix = (a: number, b: number) => a + fraction * (b - a);
  return {
    target: from.target.map((value, k) => mix(value, to.target[k] as number)) as Triple,
    distance: from.distance * (to.distance / from.distance) ** fraction,
    azimuth: from.azimuth + fraction * interpolateAngle(from.azimuth, to.azimuth),
    elevation: mix(from.elevation, to.elevation),
    roll: from.roll + fraction * interpolateAngle(from.roll, to.roll),
    yfov: mix(from.yfov, to.yfov),
  };
}

/** True if two orbits give the same image, to a fraction of a pixel. */
export function isClose(a: Orbit, b: Orbit): boolean {
  const separation = length(subtract(a.target, b.target)) / a.distance + Math.abs(Math.log(a.distance / b.distance));
  const half = (angle: number) => Math.abs(Math.sin(angle / 2));
  const turn = half(a.azimuth - b.azimuth) + Math.abs(a.elevation - b.elevation) + half(a.roll - b.roll);
  return separation + turn + Math.abs(a.yfov - b.yfov) / 60 < 5e-4;
}
