/** Handle positions of a light, and the changes when they are dragged. */
import type { Light, Triple } from "../../protocol";
import type { ProjectionCamera } from "./lightProjection";
import { add, cross, dot, length, scale, subtract, roundComponents, normalize } from "./vector";

/** Lights with a position and a target. */
type AimedLight = Extract<Light, { kind: "spot" | "rectangle" | "disc" }>;

export const isAimed = (light: Light): light is AimedLight =>
  light.kind === "spot" || light.kind === "rectangle" || light.kind === "disc";

/** World positions of a light's handles: position and target; null if the light has none. */
export interface Anchors {
  position: Triple;
  target: Triple | null;
}

const FAR = 0.3;
const MIN_LENGTH = 1e-3;

/** A directional light has no position: its handle is shown a fraction of the image's height from the image's center, at
 * about the distance of the world's origin. */
function placementPivot(camera: ProjectionCamera): { middle: Triple; reach: number } {
  const depth = Math.max(0.1, length(camera.position));
  return { middle: add(camera.position, scale(camera.forward, depth)), reach: FAR * depth * camera.height };
}

export function anchorsOf(light: Light, camera: ProjectionCamera): Anchors | null {
  switch (light.kind) {
    case "point":
    case "sphere":
    case "tube":
      return { position: light.position, target: null };
    case "spot":
    case "rectangle":
    case "disc":
      return { position: light.position, target: add(light.position, light.direction) };
    case "directional": {
      const { middle, reach } = placementPivot(camera);
      return { position: subtract(middle, scale(normalize(light.direction), reach)), target: middle };
    }
    case "mesh":
    case "points":
    case "panels":
    case "directionals":
    case "surfaces":
      return null;
  }
}

/** Fields of a light that change together. */
export interface LightChange {
  position?: Triple;
  direction?: Triple;
}

/** Changes of a light moved to a position: the position, and with a locked target the direction. Null if that would
 * leave no direction. */
export function placeLight(light: Light, to: Triple, aimLocked: boolean): LightChange | null {
  if (!("position" in light)) return null;
  const position = roundComponents(to);
  if (!isAimed(light) || !aimLocked) return { position };
  const direction = subtract(add(light.position, light.direction), position);
  return length(direction) < MIN_LENGTH ? null : { position, direction: roundComponents(direction) };
}

/** Changes of a light whose handle is dragged to a point. */
export function moveLight(light: Light, to: Triple, camera: ProjectionCamera, aimLocked: boolean): LightChange | null {
  if (light.kind !== "directional") return placeLight(light, to, aimLocked);
  const direction = subtract(placementPivot(camera).middle, to);
  return length(direction) < MIN_LENGTH ? null : { direction: roundComponents(normalize(direction)) };
}

/** Changes of a light aimed at a point. */
export function aimLight(light: Light, target: Triple): LightChange | null {
  if (!isAimed(light)) return null;
  const direction = subtract(target, light.position);
  return length(direction) < MIN_LENGTH ? null : { direction: roundComponents(direction) };
}

/** Two unit vectors perpendicular to a direction: along a rectangle's width, and along its height. */
export function spotEdgePoint(direction: Triple, degrees: number): [width: Triple, height: Triple] {
  const axis = normalize(direction);
  const up: Triple = Math.abs(axis[1]) < 0.999 ? [0, 1, 0] : [0, 0, 1];
  const level = normalize(subtract(up, scale(axis, dot(up, axis))));
  const angle = (degrees * Math.PI) / 180;
  const height = add(scale(level, Math.cos(angle)), scale(cross(axis, level), Math.sin(angle)));
  return [cross(height, axis), height];
}

const RING = 48;
const WIDEST_DEGREES = 80;

/** A circle about a point, closed. */
function ring(middle: Triple, width: Triple, height: Triple, radius: number): Triple[] {
  return Array.from({ length: RING + 1 }, (_, k) => {
    const angle = (2 * Math.PI * k) / RING;
    return add(middle, add(scale(width, radius * Math.cos(angle)), scale(height, radius * Math.sin(angle))));
  });
}

/** World-space outline of a light: the edge of a rectangle or a disc, two circles of a sphere, the ends of a tube, or a
 * spot's cone at its target. */
export function lightOutline(light: Light): Triple[] {
  switch (light.kind) {
    case "rectangle": {
      const [width, height] = spotEdgePoint(light.direction, light.rotation);
      const corner = (x: number, y: number) =>
        add(light.position, add(scale(width, (x * light.size[0]) / 2), scale(height, (y * light.size[1]) / 2)));
      return [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
    }
    case "disc":
      return ring(light.position, ...spotEdgePoint(light.direction, 0), light.radius);
    case "sphere":
      return [
        ...ring(light.position, [1, 0, 0], [0, 0, 1], light.radius),
        ...ring(light.position, [1, 0, 0], [0, 1, 0], light.radius),
      ];
    case "tube": {
      const [width, height] = spotEdgePoint(light.direction, 0);
      const half = scale(normalize(light.direction), light.length / 2);
      return [
        ...ring(subtract(light.position, half), width, height, light.radius),
        ...ring(add(light.position, half), width, height, light.radius),
      ];
    }
    case "spot": {
      const radius = length(light.direction) * Math.tan((Math.min(light.cone[1], WIDEST_DEGREES) * Math.PI) / 180);
      return ring(add(light.position, light.direction), ...spotEdgePoint(light.direction, 0), radius);
    }
    default:
      return [];
  }
}
