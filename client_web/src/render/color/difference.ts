/** Differences of two images: signed, in stops of luminance, and perceptual, ΔE ITP. The shader computes the same.
 *
 * ΔE ITP (ITU-R BT.2124): 720 times the distance in I, T = C_T / 2, P = C_P of IC_TC_P (BT.2100), of display values with
 * white at 100 cd/m²; 1 is about just noticeable. */
import type { Rgb } from "../../protocol";
import { luminance, srgbDecode, type DisplayTransform } from "./tonemap";
import { transformColor, type Matrix } from "./whiteBalance";

export const DIFFERENCE_MODES = ["off", "stops", "delta_e"] as const;
export type DifferenceMode = (typeof DIFFERENCE_MODES)[number];

/** The ends of the scales: stops, ΔE. */
export const RANGES = { stops: 1, delta_e: 20 } as const;
/** Colors of the scales, display values: A darker, equal, A brighter; and none to most. */
export const SCALES = {
  stops: [
    [0.1, 0.35, 0.95],
    [0.5, 0.5, 0.5],
    [0.98, 0.5, 0.05],
  ],
  delta_e: [
    [0.05, 0.05, 0.05],
    [0.7, 0.15, 0.4],
    [1, 0.9, 0.35],
  ],
} as const satisfies Record<string, readonly [Rgb, Rgb, Rgb]>;
/** Luminance after exposure below which pixels count as equally black: ten stops below middle gray. */
export const BLACK = 0.18 / 1024;

/** Linear Rec. 709 to LMS of BT.2100. */
export const RGB_TO_LMS: Matrix = [
  [0.295809, 0.623101, 0.081089],
  [0.156249, 0.727326, 0.116425],
  [0.035136, 0.156575, 0.80829],
];
/** LMS after the PQ curve to I, T, P. */
export const LMS_TO_ITP: Matrix = [
  [0.5, 0.5, 0],
  [0.806885, -1.661743, 0.854858],
  [4.378174, -4.245605, -0.132568],
];
export const PQ = { m1: 0.1593017578125, m2: 78.84375, c1: 0.8359375, c2: 18.8515625, c3: 18.6875 } as const;

function pq(fraction: number): number {
  const power = Math.max(0, fraction) ** PQ.m1;
  return ((PQ.c1 + PQ.c2 * power) / (1 + PQ.c3 * power)) ** PQ.m2;
}

/** I, T, P of display values: sRGB with white at 100 cd/m². */
function itp(display: Rgb): Rgb {
  const lms = transformColor(RGB_TO_LMS, display.map(srgbDecode) as Rgb);
  return transformColor(LMS_TO_ITP, lms.map((v) => pq(v / 100)) as Rgb);
}

/** ΔE ITP of display values. */
export function deltaE(a: Rgb, b: Rgb): number {
  const [x, y] = [itp(a), itp(b)];
  return 720 * Math.hypot(x[0] - y[0], x[1] - y[1], x[2] - y[2]);
}

/** Luminance of A over that of B, in stops. */
export function stopsBetween(a: Rgb, b: Rgb, { matrix }: DisplayTransform): number {
  const level = (radiance: Rgb) => Math.max(0, luminance(transformColor(matrix, radiance))) + BLACK;
  return Math.log2(level(a) / level(b));
}
