/** The direction of a distant light as azimuth and elevation of its source, in degrees.
 *
 * Azimuth is clockwise from above: 0° is −Z, 90° is +X. Elevation is above the horizon. */
import type { Triple } from "../../protocol";
import { length } from "./vector";

const DEGREES = 180 / Math.PI;

export interface SunPosition {
  azimuth: number;
  elevation: number;
}

/** Position of the source of light that travels along a direction. */
export function sunPosition(direction: Triple): SunPosition {
  const [x, y, z] = direction;
  return { azimuth: DEGREES * Math.atan2(-x, z), elevation: DEGREES * Math.asin(-y / length(direction)) };
}

/** Unit direction of the light from a position. */
export function directionFrom({ azimuth, elevation }: SunPosition): Triple {
  const [a, e] = [azimuth / DEGREES, elevation / DEGREES];
  return [-Math.sin(a) * Math.cos(e), -Math.sin(e), Math.cos(a) * Math.cos(e)];
}
