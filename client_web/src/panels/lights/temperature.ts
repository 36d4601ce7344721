/** Black-body colors: temperature in kelvin to linear Rec. 709, and the nearest temperature of a color. */
import { planckian } from "../../render/color/planckian";
import { luminance } from "../../render/color/tonemap";
import type { Rgb } from "../../protocol";

export const MIN_KELVIN = 1000;
export const MAX_KELVIN = 15000;
/** Distance from the Planckian locus in CIE 1960 (u, v) above which a color counts as colored. */
const MAX_PLANCKIAN_DISTANCE = 0.03;

/** Linear Rec. 709 of a black body, of luminance 1. Out-of-gamut colors, below 1,900 K, are clipped. */
export function rgbOfKelvin(kelvin: number): Rgb {
  const [u, v] = planckian(kelvin);
  const scale = 2 * u - 8 * v + 4;
  const [x, y] = [(3 * u) / scale, (2 * v) / scale];
  const [X, Z] = [x / y, (1 - x - y) / y];
  const rgb: Rgb = [
    Math.max(0, 3.2404542 * X - 1.5371385 - 0.4985314 * Z),
    Math.max(0, -0.969266 * X + 1.8760108 + 0.041556 * Z),
    Math.max(0, 0.0556434 * X - 0.2040259 + 1.0572252 * Z),
  ];
  return rgb.map((value) => value / luminance(rgb)) as Rgb;
}

function uvOf([r, g, b]: Rgb): [u: number, v: number] {
  const X = 0.4124564 * r + 0.3575761 * g + 0.1804375 * b;
  const Y = 0.2126729 * r + 0.7151522 * g + 0.072175 * b;
  const Z = 0.0193339 * r + 0.119192 * g + 0.9503041 * b;
  const scale = X + 15 * Y + 3 * Z;
  return [(4 * X) / scale, (6 * Y) / scale];
}

const STEPS = 400;
const kelvinSteps = Array.from({ length: STEPS + 1 }, (_, k) => MIN_KELVIN * (MAX_KELVIN / MIN_KELVIN) ** (k / STEPS));
const chromaticities = kelvinSteps.map(planckian);

/** The correlated color temperature, and whether the color is far from the Planckian locus. */
export function kelvinOf(rgb: Rgb): { kelvin: number; isColored: boolean } {
  if (luminance(rgb) <= 0) return { kelvin: 6500, isColored: false };
  const [u, v] = uvOf(rgb);
  const distances = chromaticities.map(([a, b]) => Math.hypot(u - a, v - b));
  const nearest = distances.reduce((best, distance, k) => (distance < (distances[best] as number) ? k : best), 0);
  const kelvin = kelvinSteps[nearest] as number;
  return { kelvin: Math.round(kelvin / 10) * 10, isColored: (distances[nearest] as number) > MAX_PLANCKIAN_DISTANCE };
}

/** A light quantity of the same brightness with the color of a black body. */
export function withKelvin(previous: Rgb, kelvin: number): Rgb {
  const brightness = luminance(previous);
  return rgbOfKelvin(kelvin).map((value) => Number((value * brightness).toPrecision(6))) as Rgb;
}
