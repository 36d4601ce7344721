/** Vectors of the world: right-handed, +Y up, metres. */
import type { Triple } from "../protocol";

export const add = (a: Triple, b: Triple): Triple => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a: Triple, b: Triple): Triple => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scaled = (a: Triple, by: number): Triple => [a[0] * by, a[1] * by, a[2] * by];
export const dot = (a: Triple, b: Triple): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a: Triple): number => Math.hypot(...a);

export const cross = (a: Triple, b: Triple): Triple => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

/** The unit vector along `a`; `a` itself where it has no direction. */
export function unit(a: Triple): Triple {
  const size = length(a);
  return size > 0 ? scaled(a, 1 / size) : a;
}

/** Numbers that a document can be read with: tenths of a millimetre are enough. */
export const tidy = (a: Triple): Triple => a.map((value) => Number(value.toFixed(4)) + 0) as Triple;
