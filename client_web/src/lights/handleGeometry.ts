/** What of a light is shown in a picture, and what pulling at it changes. */
import type { Light, Triple } from "../protocol";
import type { Camera } from "./camera";
import { add, cross, dot, length, scaled, subtract, tidy, unit } from "./vector";

/** Where a light's handles are: where it is, and where it aims; null where there is no such thing. */
export interface Anchors {
  at: Triple;
  target: Triple | null;
}

const FAR = 0.3;
const SHORTEST = 1e-3;

/** Far light has no place: it is shown a part of the picture's height from what is in the picture's middle, about as
 * far away as the middle of the world. */
function pivotOf(camera: Camera): { middle: Triple; reach: number } {
  const depth = Math.max(0.1, length(camera.eye));
  return { middle: add(camera.eye, scaled(camera.forward, depth)), reach: FAR * depth * camera.height };
}

export function anchorsOf(light: Light, camera: Camera): Anchors | null {
  switch (light.kind) {
    case "point":
      return { at: light.position, target: null };
    case "spot":
    case "rectangle":
      return { at: light.position, target: add(light.position, light.direction) };
    case "directional": {
      const { middle, reach } = pivotOf(camera);
      return { at: subtract(middle, scaled(unit(light.direction), reach)), target: middle };
    }
    case "mesh":
      return null;
  }
}

/** Fields of a light that change together. */
export interface Change {
  position?: Triple;
  direction?: Triple;
}

/** What moving a light to a place changes: where it is, and with a locked aim the way it points, so that it goes on
 * aiming at the same point. Null where that would leave it without a direction. */
export function placed(light: Light, to: Triple, aimLocked: boolean): Change | null {
  if (light.kind === "mesh" || light.kind === "directional") return null;
  const position = tidy(to);
  if (light.kind === "point" || !aimLocked) return { position };
  const direction = subtract(add(light.position, light.direction), position);
  return length(direction) < SHORTEST ? null : { position, direction: tidy(direction) };
}

/** What pulling a light's handle to a point changes. */
export function moved(light: Light, to: Triple, camera: Camera, aimLocked: boolean): Change | null {
  if (light.kind !== "directional") return placed(light, to, aimLocked);
  const direction = subtract(pivotOf(camera).middle, to);
  return length(direction) < SHORTEST ? null : { direction: tidy(unit(direction)) };
}

/** What aiming a light at a point changes. */
export function aimed(light: Light, target: Triple): Change | null {
  if (light.kind !== "spot" && light.kind !== "rectangle") return null;
  const direction = subtract(target, light.position);
  return length(direction) < SHORTEST ? null : { direction: tidy(direction) };
}

/** Two unit vectors across a direction: the first along a rectangle's width, the second along its height. */
export function acrossOf(direction: Triple, degrees: number): [width: Triple, height: Triple] {
  const axis = unit(direction);
  const up: Triple = Math.abs(axis[1]) < 0.999 ? [0, 1, 0] : [0, 0, 1];
  const level = unit(subtract(up, scaled(axis, dot(up, axis))));
  const angle = (degrees * Math.PI) / 180;
  const height = add(scaled(level, Math.cos(angle)), scaled(cross(axis, level), Math.sin(angle)));
  return [cross(height, axis), height];
}

const RING = 48;
const WIDEST_DEGREES = 80;

/** A closed line in the world that shows a light's size: a rectangle's edge, the edge of a spot's cone at its target. */
export function outlineOf(light: Light): Triple[] {
  if (light.kind === "rectangle") {
    const [width, height] = acrossOf(light.direction, light.rotation);
    const corner = (x: number, y: number) =>
      add(light.position, add(scaled(width, (x * light.size[0]) / 2), scaled(height, (y * light.size[1]) / 2)));
    return [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
  }
  if (light.kind === "spot") {
    const [width, height] = acrossOf(light.direction, 0);
    const radius = length(light.direction) * Math.tan((Math.min(light.cone[1], WIDEST_DEGREES) * Math.PI) / 180);
    const middle = add(light.position, light.direction);
    return Array.from({ length: RING }, (_, k) => {
      const angle = (2 * Math.PI * k) / RING;
      return add(middle, add(scaled(width, radius * Math.cos(angle)), scaled(height, radius * Math.sin(angle))));
    });
  }
  return [];
}
