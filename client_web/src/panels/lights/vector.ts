/** World-space vectors: right-handed, +Y up, meters. */
import type { Triple } from "../../protocol";

export const add = (a: Triple, b: Triple): Triple => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a: Triple, b: Triple): Triple => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a: Triple, factor: number): Triple => [a[0] * factor, a[1] * factor, a[2] * factor];
export const dot = (a: Triple, b: Triple): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a: Triple): number => Math.hypot(...a);

export const cross = (a: Triple, b: Triple): Triple => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

/** The unit vector along `a`; `a` itself if its length is zero. */
export function normalize(a: Triple): Triple {
  const size = length(a);
  return size > 0 ? scale(a, 1 / size) : a;
}

/** Round to a tenth of a millimeter, so that documents stay readable. */
export const roundComponents = (a: Triple): Triple => a.map((value) => Number(value.toFixed(4)) + 0) as Triple;
