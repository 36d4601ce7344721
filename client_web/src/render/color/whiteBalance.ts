/** White balance of the display: von Kries adaptation in Bradford's cone space, as the server computes it
 * (`relume.image_io.white_balance`). */
import { DEFAULTS, RANGES } from "../../look.gen";
import type { Rgb } from "../../protocol";
import { planckian } from "./planckian";

/** Rows of a 3 × 3 matrix. */
export type Matrix = readonly [Rgb, Rgb, Rgb];

const NEUTRAL_KELVIN = DEFAULTS.display.temperature;
/** Units of tint per distance in u, v. */
const TINTS_PER_UV = 3000;
const XYZ_TO_CONES: Matrix = [
  [0.8951, 0.2664, -0.1614],
  [-0.7502, 1.7135, 0.0367],
  [0.0389, -0.0685, 1.0296],
];
const RGB_TO_XYZ: Matrix = [
  [0.4123907993, 0.3575843394, 0.1804807884],
  [0.2126390059, 0.7151686788, 0.0721923154],
  [0.0193308187, 0.1191947798, 0.9505321522],
];

const dot = (a: Rgb, b: Rgb): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

export const transformColor = (matrix: Matrix, color: Rgb): Rgb => matrix.map((row) => dot(row, color)) as Rgb;

const column = (matrix: Matrix, c: 0 | 1 | 2): Rgb => [matrix[0][c], matrix[1][c], matrix[2][c]];

function multiply(a: Matrix, b: Matrix): Matrix {
  const row = (left: Rgb): Rgb => [dot(left, column(b, 0)), dot(left, column(b, 1)), dot(left, column(b, 2))];
  return [row(a[0]), row(a[1]), row(a[2])];
}

const cross = ([a, b, c]: Rgb, [d, e, f]: Rgb): Rgb => [b * f - c * e, c * d - a * f, a * e - b * d];

function invert(matrix: Matrix): Matrix {
  const [x, y, z] = matrix;
  const columns: Matrix = [cross(y, z), cross(z, x), cross(x, y)];
  const determinant = dot(x, columns[0]);
  const row = (c: 0 | 1 | 2): Rgb => column(columns, c).map((v) => v / determinant) as Rgb;
  return [row(0), row(1), row(2)];
}

const scaled = (matrix: Matrix, factors: Rgb): Matrix =>
  matrix.map((row, i) => row.map((v) => v * (factors[i] as number))) as unknown as Matrix;

const RGB_TO_CONES = multiply(XYZ_TO_CONES, RGB_TO_XYZ);
const CONES_TO_RGB = invert(RGB_TO_CONES);
const CONES_TO_XYZ = invert(XYZ_TO_CONES);

/** Unit vector in u, v across the Planckian locus, toward green. */
function acrossLocus(kelvin: number): [number, number] {
  const [[u0, v0], [u1, v1]] = [planckian(kelvin - 1), planckian(kelvin + 1)];
  const length = Math.hypot(u1 - u0, v1 - v0);
  return [(v1 - v0) / length, -(u1 - u0) / length];
}

/** Responses of Bradford's cones to the white of a setting, of luminance 1. */
function whiteCones(kelvin: number, tint: number): Rgb {
  const [along, across] = [planckian(kelvin), acrossLocus(kelvin)];
  const [u, v] = [along[0] + (tint / TINTS_PER_UV) * across[0], along[1] + (tint / TINTS_PER_UV) * across[1]];
  return transformColor(XYZ_TO_CONES, [(1.5 * u) / v, 1, (4 - u - 10 * v) / (2 * v)]);
}

const ratio = (a: Rgb, b: Rgb): Rgb => [a[0] / b[0], a[1] / b[1], a[2] / b[2]];

/** Matrix for linear Rec. 709 that makes a white neutral, times the gain of an exposure in stops. */
export function displayMatrix(exposure: number, kelvin: number, tint: number): Matrix {
  const gain = 2 ** exposure;
  if (kelvin === NEUTRAL_KELVIN && tint === 0)
    return [
      [gain, 0, 0],
      [0, gain, 0],
      [0, 0, gain],
    ];
  const gains = ratio(whiteCones(NEUTRAL_KELVIN, 0), whiteCones(kelvin, tint)).map((v) => v * gain) as Rgb;
  return multiply(CONES_TO_RGB, scaled(RGB_TO_CONES, gains));
}

const clamp = (value: number, { minimum, maximum }: { minimum: number; maximum: number }) =>
  Math.min(maximum, Math.max(minimum, value));

/** Temperature at which the locus is nearest to a chromaticity: its offset is perpendicular there. */
function nearestKelvin(u: number, v: number): number {
  let [low, high] = [RANGES.display.temperature.minimum, RANGES.display.temperature.maximum] as [number, number];
  for (let step = 0; step < 40; step++) {
    const middle = Math.sqrt(low * high);
    const [[a, b], [acrossU, acrossV]] = [planckian(middle), acrossLocus(middle)];
    if ((u - a) * acrossV - (v - b) * acrossU > 0) high = middle;
    else low = middle;
  }
  return Math.sqrt(low * high);
}

/** The white balance that makes a color gray, as near as the ranges allow; null for black. */
export function balanceForGray(color: Rgb): { temperature: number; tint: number } | null {
  const cones = transformColor(RGB_TO_CONES, color);
  if (!(Math.min(...cones) > 0)) return null;
  const neutral = ratio(whiteCones(NEUTRAL_KELVIN, 0), transformColor(RGB_TO_CONES, [1, 1, 1]));
  const [X, Y, Z] = transformColor(CONES_TO_XYZ, [cones[0] * neutral[0], cones[1] * neutral[1], cones[2] * neutral[2]]);
  const sum = X + 15 * Y + 3 * Z;
  const [u, v] = [(4 * X) / sum, (6 * Y) / sum];
  const temperature = Math.round(nearestKelvin(u, v));
  const [[a, b], [acrossU, acrossV]] = [planckian(temperature), acrossLocus(temperature)];
  const tint = TINTS_PER_UV * ((u - a) * acrossU + (v - b) * acrossV);
  return { temperature, tint: Number(clamp(tint, RANGES.display.tint).toFixed(2)) };
}
