/** Linear Rec. 709 radiance to sRGB-encoded display values in [0, 1], as in the shader, for pixel probe and export. */
import type { Rgb } from "../../protocol";
import { withContrast } from "./contrast";
import { sampleDisplayLut, sampleLut, type LutTable } from "./lutTable";
import { transformColor, type Matrix } from "./whiteBalance";

export const TONE_MAPS = [
  { name: "agx", label: "AgX" },
  { name: "filmic", label: "Filmic" },
  { name: "none", label: "None" },
] as const;

/** A display transform: a tone map, or the table of a view. */
export type DisplayedToneMap = (typeof TONE_MAPS)[number]["name"] | LutTable;

/** Conversion of radiance to display values. */
export interface DisplayTransform {
  /** Exposure times white balance, for linear Rec. 709. */
  matrix: Matrix;
  /** Slope of log radiance about middle gray. */
  contrast: number;
  toneMap: DisplayedToneMap;
  /** Display LUT after the tone map. */
  lut: LutTable | null;
}

const clamp01 = (x: number) => Math.min(1, Math.max(0, x));

/** IEC 61966-2-1. */
export function srgbEncode(x: number): number {
  const v = clamp01(x);
  return v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055;
}

export function srgbDecode(v: number): number {
  return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
}

// AgX by Troy Sobotka, in the polynomial form of Benjamin Wrensch ("Minimal AgX Implementation"); columns
const AGX_INSET = [
  0.842479062253094, 0.0423282422610123, 0.0423756549057051, 0.0784335999999992, 0.878468636469772, 0.0784336,
  0.0792237451477643, 0.0791661274605434, 0.879142973793104,
];
const AGX_OUTSET = [
  1.19687900512017, -0.0528968517574562, -0.0529716355144438, -0.0980208811401368, 1.15190312990417,
  -0.0980434501171241, -0.0990297440797205, -0.0989611768448433, 1.15107367264116,
];
const AGX_MIN_EV = -12.47393;
const AGX_MAX_EV = 4.026069;

function multiply(columns: number[], [r, g, b]: Rgb): Rgb {
  const row = (i: number) => (columns[i] ?? 0) * r + (columns[i + 3] ?? 0) * g + (columns[i + 6] ?? 0) * b;
  return [row(0), row(1), row(2)];
}

function agxContrast(x: number): number {
  const x2 = x * x;
  const x4 = x2 * x2;
  return 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
}

function agx(rgb: Rgb): Rgb {
  const log = multiply(AGX_INSET, rgb).map((v) => {
    const ev = Math.min(AGX_MAX_EV, Math.max(AGX_MIN_EV, Math.log2(Math.max(v, 1e-10))));
    return agxContrast((ev - AGX_MIN_EV) / (AGX_MAX_EV - AGX_MIN_EV));
  }) as Rgb;
  return multiply(AGX_OUTSET, log).map(clamp01) as Rgb;
}

/** Krzysztof Narkowicz, "ACES Filmic Tone Mapping Curve", 2015. */
function filmic(x: number): number {
  return (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14);
}

/** Display values of a radiance: white balance and exposure, contrast, tone map and sRGB curve or a view, a LUT. */
export function toDisplay(radiance: Rgb, { matrix, contrast, toneMap, lut }: DisplayTransform): Rgb {
  const graded = transformColor(matrix, radiance).map((v) => withContrast(Math.max(0, v), contrast)) as Rgb;
  const display = applyToneMap(graded, toneMap);
  return lut === null ? display : sampleDisplayLut(lut, display);
}

function applyToneMap(graded: Rgb, toneMap: DisplayedToneMap): Rgb {
  if (typeof toneMap !== "string") return sampleLut(toneMap, graded);
  if (toneMap === "agx") return agx(graded);
  if (toneMap === "filmic") return graded.map((v) => srgbEncode(filmic(v))) as Rgb;
  return graded.map(srgbEncode) as Rgb;
}

export function luminance([r, g, b]: Rgb): number {
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}
