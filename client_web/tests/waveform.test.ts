/** The waveform counts display values of each column. */
import { describe, expect, test } from "vitest";
import { encodeRgb9e5 } from "../src/render/color/rgb9e5";
import { srgbEncode } from "../src/render/color/tonemap";
import { displayMatrix } from "../src/render/color/whiteBalance";
import { computeWaveform, summarizeWaveform } from "../src/render/waveform";

const LEVELS = 101;
const transform = { matrix: displayMatrix(1, 6500, 0), contrast: 1, toneMap: "none", lut: null } as const;
const level = (linear: number) => Math.round(srgbEncode(2 * linear) * (LEVELS - 1));

/** Left half red, right half a gray. */
function halves(width: number, height: number) {
  const [red, gray] = [encodeRgb9e5(0.25, 0, 0), encodeRgb9e5(0.125, 0.125, 0.125)];
  return {
    width,
    height,
    encoded: Uint32Array.from({ length: width * height }, (_, i) => (i % width < width / 2 ? red : gray)),
  };
}

describe("waveform", () => {
  test.each([
    [8, 6, 6],
    [3000, 1000, 120],
  ])("of %s × %s pixels has each column's values after the display transform", (width, height, rows) => {
    const { luma, channels, ...size } = computeWaveform(halves(width, height), transform, 4, LEVELS);
    expect(size).toEqual({ columns: 4, levels: LEVELS, rows });
    const at = (column: number, value: number) => column * LEVELS + value;
    for (const column of [0, 1]) {
      expect(channels[0][at(column, level(0.25))]).toBe(rows);
      expect(channels[1][at(column, 0)]).toBe(rows);
      expect(luma[at(column, Math.round(0.2126 * srgbEncode(0.5) * (LEVELS - 1)))]).toBe(rows);
    }
    for (const counts of [luma, ...channels]) expect(counts[at(3, level(0.125))]).toBe(rows);
  });

  test("its summary names the range of luma", () => {
    const { encoded } = halves(4, 1);
    const waveform = computeWaveform({ width: 4, height: 1, encoded }, transform, 4, LEVELS);
    expect(summarizeWaveform(waveform)).toBe(`Median 16 %, 98 % in 16 to ${level(0.125)} %`);
  });
});
