/** A camera that orbits a target, turns where it stands, or walks. Angles in radians, lengths in meters, +Y up. */
import type { LensBody, Triple } from "../../protocol";
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
  /** Distance of the near clipping plane; surfaces before it are not drawn. */
  near: number;
}

export interface CameraPose {
  /** Camera to world, 16 numbers in row-major order; the camera looks along -Z. */
  to_world: number[];
  yfov: number;
  near?: number;
  /** Depth of field of a camera to bake. */
  lens?: LensBody | null;
}

export interface Bounds {
  lowest: Triple;
  highest: Triple;
}

export const MIN_FOCUS_DISTANCE = 1e-3; // meters
export const MIN_YFOV = 1;
export const MAX_YFOV = 170;
const HIGHEST = (89.9 * Math.PI) / 180; // straight down, the up direction is undefined
const NEAREST = 1e-3; // fraction of the scene's size
const FARTHEST = 50;
const PASS = 0.07; // fraction of the scene's size per step of one e-fold, past the target

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

export const positionOf = (orbit: Orbit): Triple =>
  add(orbit.target, scale(cameraAxes(orbit).backward, orbit.distance));

export function poseOf(orbit: Orbit): CameraPose {
  const { right, up, backward } = cameraAxes(orbit);
  const position = positionOf(orbit);
  const rows = [0, 1, 2].flatMap((k) => [right[k], up[k], backward[k], position[k]] as number[]);
  return { to_world: [...rows, 0, 0, 0, 1], yfov: orbit.yfov, near: orbit.near };
}

/** The orbit of a camera around `target`, the point in its image's center; null: the middle of the scene's depth. */
export function orbitOf(
  { to_world: m, yfov, near = 0 }: CameraPose,
  bounds: Bounds,
  target: Triple | null = null,
): Orbit {
  const column = (k: number): Triple => [m[k] as number, m[4 + k] as number, m[8 + k] as number];
  const position = column(3);
  const backward = normalize(column(2));
  const depth = dot(subtract(position, target ?? centerOf(bounds)), backward);
  const distance = clamp(depth, (target === null ? 0.05 : NEAREST) * diagonalOf(bounds), FARTHEST * diagonalOf(bounds));
  const azimuth = Math.atan2(backward[0], backward[2]);
  const elevation = clamp(Math.asin(clamp(backward[1], -1, 1)), -HIGHEST, HIGHEST);
  const [level, right] = [horizontalAxes(azimuth, elevation), normalize(column(0))];
  const roll = Math.atan2(dot(right, level.up), dot(right, level.right));
  return { target: subtract(position, scale(backward, distance)), distance, azimuth, elevation, roll, yfov, near };
}

export function rotateOrbit(orbit: Orbit, azimuth: number, elevation: number): Orbit {
  const next = clamp(orbit.elevation + elevation, -HIGHEST, HIGHEST);
  return { ...orbit, azimuth: orbit.azimuth + azimuth, elevation: next };
}

/** The view direction. */
export const forwardOf = (orbit: Orbit): Triple => scale(cameraAxes(orbit).backward, -1);

/** Depth of a point along the view direction, meters. */
export const depthOf = (orbit: Orbit, point: Triple): number =>
  Math.max(MIN_FOCUS_DISTANCE, dot(subtract(point, positionOf(orbit)), forwardOf(orbit)));

/** Turn the head: the camera stays where it is. */
export function turnHead(orbit: Orbit, azimuth: number, elevation: number): Orbit {
  const turned = rotateOrbit(orbit, azimuth, elevation);
  return { ...turned, target: subtract(positionOf(orbit), scale(cameraAxes(turned).backward, orbit.distance)) };
}

export const translateOrbit = (orbit: Orbit, offset: Triple): Orbit => ({
  ...orbit,
  target: add(orbit.target, offset),
});

/** Walk by meters to the right, up and forward. `isLevel`: along the floor; else along the view direction. */
export function walkOrbit(orbit: Orbit, [across, above, ahead]: Triple, isLevel: boolean): Orbit {
  const { right, up, backward } = horizontalAxes(orbit.azimuth, isLevel ? 0 : orbit.elevation);
  return translateOrbit(orbit, add(add(scale(right, across), scale(up, above)), scale(backward, -ahead)));
}

/** Pan with the image: by fractions of its height to the right and down, at the target's depth. */
export function panOrbit(orbit: Orbit, across: number, down: number): Orbit {
  const { right, up } = cameraAxes(orbit);
  const height = 2 * orbit.distance * Math.tan((orbit.yfov * Math.PI) / 360);
  const move = add(scale(right, -across * height), scale(up, down * height));
  return { ...orbit, target: add(orbit.target, move) };
}

/** Move towards the target or away from it; a camera that has reached its target moves on, with the target before it. */
export function dollyOrbit(orbit: Orbit, factor: number, bounds: Bounds): Orbit {
  const size = diagonalOf(bounds);
  const distance = orbit.distance * factor;
  if (distance >= NEAREST * size) return { ...orbit, distance: Math.min(distance, FARTHEST * size) };
  const pushed = scale(cameraAxes(orbit).backward, -PASS * size * Math.min(1, -Math.log(Math.max(factor, 1e-6))));
  return { ...translateOrbit(orbit, pushed), distance: NEAREST * size };
}

export const levelOrbit = (orbit: Orbit): Orbit => ({ ...orbit, roll: 0 });

export const withFieldOfView = (orbit: Orbit, yfov: number): Orbit => ({
  ...orbit,
  yfov: clamp(yfov, MIN_YFOV, MAX_YFOV),
});

export const withNearPlane = (orbit: Orbit, near: number): Orbit => ({ ...orbit, near: Math.max(0, near) });

/** The shortest signed difference between two angles. */
const interpolateAngle = (from: number, to: number) =>
  ((((to - from + Math.PI) % (2 * Math.PI)) + 2 * Math.PI) % (2 * Math.PI)) - Math.PI;

/** Interpolate between two orbits. Of target and position, the one that moves less moves along a line: the target of an
 * orbiting camera stays, and so does the position of a turning one. */
export function interpolateOrbits(from: Orbit, to: Orbit, fraction: number): Orbit {
  const mix = (a: number, b: number) => a + fraction * (b - a);
  const mixPoints = (a: Triple, b: Triple) => add(a, scale(subtract(b, a), fraction));
  const orbit: Orbit = {
    target: mixPoints(from.target, to.target),
    distance: from.distance * (to.distance / from.distance) ** fraction,
    azimuth: from.azimuth + fraction * interpolateAngle(from.azimuth, to.azimuth),
    elevation: mix(from.elevation, to.elevation),
    roll: from.roll + fraction * interpolateAngle(from.roll, to.roll),
    yfov: mix(from.yfov, to.yfov),
    near: mix(from.near, to.near),
  };
  const [start, end] = [positionOf(from), positionOf(to)];
  if (length(subtract(end, start)) >= length(subtract(to.target, from.target))) return orbit;
  return translateOrbit(orbit, subtract(mixPoints(start, end), positionOf(orbit)));
}

/** True if two orbits give the same image, to a fraction of a pixel. */
export function isClose(a: Orbit, b: Orbit): boolean {
  const separation = length(subtract(a.target, b.target)) / a.distance + Math.abs(Math.log(a.distance / b.distance));
  const half = (angle: number) => Math.abs(Math.sin(angle / 2));
  const turn = half(a.azimuth - b.azimuth) + Math.abs(a.elevation - b.elevation) + half(a.roll - b.roll);
  const clip = Math.abs(a.near - b.near) / a.distance;
  return separation + turn + clip + Math.abs(a.yfov - b.yfov) / 60 < 5e-4;
}
