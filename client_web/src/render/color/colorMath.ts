/** Colors of the look (linear Rec. 709, may exceed 1) and the picker's #rrggbb (sRGB, at most 1). */
import type { Rgb } from "../../protocol";
import { srgbDecode, srgbEncode } from "./tonemap";

/** Divisor that fits a color into the picker's range: only above 1; a quantity (`minimum` 0) always fills the range. */
export function peakValue(color: Rgb, minimum = 1): number {
  return Math.max(minimum, ...color) || 1;
}

export function toHex(color: Rgb, minimum = 1): string {
  const scale = peakValue(color, minimum);
  return `#${color
    .map((v) =>
      Math.round(255 * srgbEncode(v / scale))
        .toString(16)
        .padStart(2, "0"),
    )
    .join("")}`;
}

/** The picked color at the old one's scale; six digits keep the document readable. */
export function fromHex(hex: string, previous: Rgb, minimum = 1): Rgb {
  const scale = peakValue(previous, minimum);
  const channel = (i: number) => srgbDecode(parseInt(hex.slice(1 + 2 * i, 3 + 2 * i), 16) / 255) * scale;
  return [0, 1, 2].map((i) => Number(channel(i).toPrecision(6))) as Rgb;
}
