/** A camera that goes round a place: what hands move. Angles in radians, lengths in metres, +Y up. */
import type { Triple } from "../protocol";
import { add, cross, dot, length, scaled, subtract, unit } from "../lights/vector";

export interface Orbit {
  target: Triple;
  distance: number;
  /** About +Y, from +Z towards +X. */
  azimuth: number;
  /** Above the horizon. */
  elevation: number;
  /** About the line of sight, counter-clockwise as the eye sees itself turn; 0 stands upright. */
  roll: number;
  /** Vertical field of view, degrees. */
  yfov: number;
}

export interface Frame {
  /** Camera to world, 16 numbers by row; it looks along -Z. */
  to_world: number[];
  yfov: number;
}

export interface Bounds {
  lowest: Triple;
  highest: Triple;
}

export const MIN_YFOV = 1;
export const MAX_YFOV = 120;
const HIGHEST = (89.9 * Math.PI) / 180; // straight down there is no upper side
const NEAREST = 1e-4; // of the scene's size
const FARTHEST = 50;

const clamp = (value: number, low: number, high: number) => Math.min(high, Math.max(low, value));

type Axes = { right: Triple; up: Triple; backward: Triple };

function levelAxes(azimuth: number, elevation: number): Axes {
  const flat = Math.cos(elevation);
  const backward: Triple = [Math.sin(azimuth) * flat, Math.sin(elevation), Math.cos(azimuth) * flat];
  const right: Triple = [Math.cos(azimuth), 0, -Math.sin(azimuth)];
  return { right, up: cross(backward, right), backward };
}

function axes({ azimuth, elevation, roll }: Orbit): Axes {
  const { right, up, backward } = levelAxes(azimuth, elevation);
  const [cosine, sine] = [Math.cos(roll), Math.sin(roll)];
  const turned = add(scaled(right, cosine), scaled(up, sine));
  return { right: turned, up: add(scaled(up, cosine), scaled(right, -sine)), backward };
}

export const sizeOf = ({ lowest, highest }: Bounds): number => Math.max(1e-6, length(subtract(highest, lowest)));
const centreOf = ({ lowest, highest }: Bounds): Triple => scaled(add(lowest, highest), 0.5);

export function frameOf(orbit: Orbit): Frame {
  const { right, up, backward } = axes(orbit);
  const eye = add(orbit.target, scaled(backward, orbit.distance));
  const rows = [0, 1, 2].flatMap((k) => [right[k], up[k], backward[k], eye[k]] as number[]);
  return { to_world: [...rows, 0, 0, 0, 1], yfov: orbit.yfov };
}

/** The orbit that sees what a camera sees, about `place` in the middle of its picture; null where that is empty:
 * about the middle of the scene's depth. */
export function orbitOf({ to_world: m, yfov }: Frame, bounds: Bounds, place: Triple | null = null): Orbit {
  const column = (k: number): Triple => [m[k] as number, m[4 + k] as number, m[8 + k] as number];
  const eye = column(3);
  const backward = unit(column(2));
  const depth = dot(subtract(eye, place ?? centreOf(bounds)), backward);
  const distance = clamp(depth, (place === null ? 0.05 : NEAREST) * sizeOf(bounds), FARTHEST * sizeOf(bounds));
  const azimuth = Math.atan2(backward[0], backward[2]);
  const elevation = clamp(Math.asin(clamp(backward[1], -1, 1)), -HIGHEST, HIGHEST);
  const [level, right] = [levelAxes(azimuth, elevation), unit(column(0))];
  const roll = Math.atan2(dot(right, level.up), dot(right, level.right));
  return { target: subtract(eye, scaled(backward, distance)), distance, azimuth, elevation, roll, yfov };
}

export function turned(orbit: Orbit, azimuth: number, elevation: number): Orbit {
  const next = clamp(orbit.elevation + elevation, -HIGHEST, HIGHEST);
  return { ...orbit, azimuth: orbit.azimuth + azimuth, elevation: next };
}

/** Moved with the picture: by fractions of its height to the right and down, at the target's depth. */
export function panned(orbit: Orbit, across: number, down: number): Orbit {
  const { right, up } = axes(orbit);
  const height = 2 * orbit.distance * Math.tan((orbit.yfov * Math.PI) / 360);
  const move = add(scaled(right, -across * height), scaled(up, down * height));
  return { ...orbit, target: add(orbit.target, move) };
}

export function approached(orbit: Orbit, factor: number, bounds: Bounds): Orbit {
  const size = sizeOf(bounds);
  return { ...orbit, distance: clamp(orbit.distance * factor, NEAREST * size, FARTHEST * size) };
}

export const levelled = (orbit: Orbit): Orbit => ({ ...orbit, roll: 0 });

export const withAngle = (orbit: Orbit, yfov: number): Orbit => ({ ...orbit, yfov: clamp(yfov, MIN_YFOV, MAX_YFOV) });

/** From one angle to another, the short way round. */
const turnTo = (from: number, to: number) =>
  ((((to - from + Math.PI) % (2 * Math.PI)) + 2 * Math.PI) % (2 * Math.PI)) - Math.PI;

/** A share of the way from one to another. */
export function between(from: Orbit, to: Orbit, share: number): Orbit {
  const mix = (a: number, b: number) => a + share * (b - a);
  return {
    target: from.target.map((value, k) => mix(value, to.target[k] as number)) as Triple,
    distance: from.distance * (to.distance / from.distance) ** share,
    azimuth: from.azimuth + share * turnTo(from.azimuth, to.azimuth),
    elevation: mix(from.elevation, to.elevation),
    roll: from.roll + share * turnTo(from.roll, to.roll),
    yfov: mix(from.yfov, to.yfov),
  };
}

/** Whether both show the same, to a fraction of a pixel. */
export function isNear(a: Orbit, b: Orbit): boolean {
  const apart = length(subtract(a.target, b.target)) / a.distance + Math.abs(Math.log(a.distance / b.distance));
  const half = (angle: number) => Math.abs(Math.sin(angle / 2));
  const turn = half(a.azimuth - b.azimuth) + Math.abs(a.elevation - b.elevation) + half(a.roll - b.roll);
  return apart + turn + Math.abs(a.yfov - b.yfov) / 60 < 5e-4;
}
