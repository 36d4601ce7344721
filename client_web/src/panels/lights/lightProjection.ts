/** Projects world points into a view's image, and moves them by drags in the image. */
import type { HelloMessage, Triple } from "../../protocol";
import { add, dot, scale, subtract } from "./vector";

type SessionView = HelloMessage["views"][number];

/** A pinhole camera. Image positions are fractions of its sides from the top left; depths are in meters. */
export interface ProjectionCamera {
  position: Triple;
  right: Triple;
  up: Triple;
  forward: Triple;
  /** Width and height of the visible area at a depth of one meter. */
  width: number;
  height: number;
}

export interface ProjectedPoint {
  u: number;
  v: number;
  depth: number;
}

export function projectionCameraOf({ camera, width, height }: SessionView): ProjectionCamera {
  const column = (k: number) => [0, 4, 8].map((row) => camera.to_world[row + k] as number) as Triple;
  const high = 2 * Math.tan(camera.yfov / 2);
  return {
    position: column(3),
    right: column(0),
    up: column(1),
    forward: scale(column(2), -1),
    width: (high * width) / height,
    height: high,
  };
}

/** Points nearer than this count as behind the camera. */
const NEAREST = 1e-3;

/** Project a point; null if it is behind the camera. */
export function project(camera: ProjectionCamera, point: Triple): ProjectedPoint | null {
  const towards = subtract(point, camera.position);
  const depth = dot(towards, camera.forward);
  if (depth < NEAREST) return null;
  return {
    u: 0.5 + dot(towards, camera.right) / (depth * camera.width),
    v: 0.5 - dot(towards, camera.up) / (depth * camera.height),
    depth,
  };
}

/** A point moved parallel to the image at its depth, by fractions of the image's sides. */
export function slidePoint(camera: ProjectionCamera, point: Triple, du: number, dv: number): Triple {
  const depth = Math.max(NEAREST, dot(subtract(point, camera.position), camera.forward));
  const across = scale(camera.right, du * depth * camera.width);
  return add(add(point, across), scale(camera.up, -dv * depth * camera.height));
}

/** A point moved along its line of sight, to `factor` times its distance from the camera. */
export function pushPoint(camera: ProjectionCamera, point: Triple, factor: number): Triple {
  return add(camera.position, scale(subtract(point, camera.position), factor));
}
