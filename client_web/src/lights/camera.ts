/** Where a point of the world is in a view's picture, and how it moves when it is pulled there. */
import type { HelloMessage, Triple } from "../protocol";
import { add, dot, scaled, subtract } from "./vector";

type View = HelloMessage["views"][number];

/** A pinhole camera. Places in the picture are fractions of its sides from the top left, depths are metres. */
export interface Camera {
  eye: Triple;
  right: Triple;
  up: Triple;
  forward: Triple;
  /** Width and height of what is seen at a depth of one metre. */
  width: number;
  height: number;
}

export interface Seen {
  u: number;
  v: number;
  depth: number;
}

export function cameraOf({ camera, width, height }: View): Camera {
  const column = (k: number) => [0, 4, 8].map((row) => camera.to_world[row + k] as number) as Triple;
  const high = 2 * Math.tan(camera.yfov / 2);
  return {
    eye: column(3),
    right: column(0),
    up: column(1),
    forward: scaled(column(2), -1),
    width: (high * width) / height,
    height: high,
  };
}

/** Nearer than this a point is behind the camera, or as good as. */
const NEAREST = 1e-3;

/** Where a point is seen; null where it is behind the camera. */
export function project(camera: Camera, point: Triple): Seen | null {
  const towards = subtract(point, camera.eye);
  const depth = dot(towards, camera.forward);
  if (depth < NEAREST) return null;
  return {
    u: 0.5 + dot(towards, camera.right) / (depth * camera.width),
    v: 0.5 - dot(towards, camera.up) / (depth * camera.height),
    depth,
  };
}

/** A point moved in the plane parallel to the picture at its depth, by fractions of the picture's sides. */
export function slid(camera: Camera, point: Triple, du: number, dv: number): Triple {
  const depth = Math.max(NEAREST, dot(subtract(point, camera.eye), camera.forward));
  const across = scaled(camera.right, du * depth * camera.width);
  return add(add(point, across), scaled(camera.up, -dv * depth * camera.height));
}

/** A point moved along its line of sight, to `factor` times its distance from the camera. */
export function pushed(camera: Camera, point: Triple, factor: number): Triple {
  return add(camera.eye, scaled(subtract(point, camera.eye), factor));
}
