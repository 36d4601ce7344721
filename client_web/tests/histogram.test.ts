import { describe, expect, test } from "vitest";
import { displayMatrix } from "../src/render/color/whiteBalance";
import { encodeRgb9e5 } from "../src/render/color/rgb9e5";
import {
  BINS_PER_STOP,
  binIndex,
  computeHistogram,
  MIDDLE_GRAY,
  MIN_STOP,
  NUM_BINS,
  percentile,
} from "../src/render/histogram";
import { toggledSolo } from "../src/state/visibility/soloSources";

const total = (bins: Uint32Array) => bins.reduce((a, b) => a + b, 0);

describe("histogram", () => {
  test("bins are a sixth of a stop, the ends take what lies beyond them", () => {
    const middle = -MIN_STOP * BINS_PER_STOP;
    expect(binIndex(MIDDLE_GRAY * 1.01)).toBe(middle);
    expect(binIndex(MIDDLE_GRAY * 2.02)).toBe(middle + BINS_PER_STOP);
    expect([binIndex(0), binIndex(1e9)]).toEqual([0, NUM_BINS - 1]);
  });

  test("channels and luminance are counted apart", () => {
    const encoded = new Uint32Array(10).fill(encodeRgb9e5(0.5, 0, 0));
    const { luminance, channels, samples } = computeHistogram(encoded, displayMatrix(0, 6500, 0));
    expect(samples).toBe(10);
    expect(luminance[binIndex(0.5 * 0.2126)]).toBe(10);
    expect(channels[0][binIndex(0.5)]).toBe(10);
    expect([channels[1][0], channels[2][0]]).toEqual([10, 10]);
  });

  test("a stop of exposure moves everything by a stop", () => {
    const encoded = Uint32Array.from({ length: 500 }, (_, i) => encodeRgb9e5(0.02 + i / 300, 0.1, 0.3));
    const [before, after] = [
      computeHistogram(encoded, displayMatrix(0, 6500, 0)),
      computeHistogram(encoded, displayMatrix(1, 6500, 0)),
    ];
    expect([...after.luminance.subarray(BINS_PER_STOP)]).toEqual([
      ...before.luminance.subarray(0, NUM_BINS - BINS_PER_STOP),
    ]);
  });

  test("a large picture is sampled, every sample is counted once in each channel", () => {
    const encoded = Uint32Array.from({ length: 1_000_000 }, (_, i) => encodeRgb9e5(i % 640 < 320 ? 0.05 : 1, 0.2, 0.2));
    const { luminance, channels, samples } = computeHistogram(encoded, displayMatrix(0, 6500, 0));
    expect(samples).toBeLessThanOrEqual(60_000);
    for (const bins of [luminance, ...channels]) expect(total(bins)).toBe(samples);
    expect((channels[0][binIndex(1)] as number) / samples).toBeCloseTo(0.5, 2);
  });

  test("percentiles are stops about middle gray", () => {
    const encoded = Uint32Array.from({ length: 100 }, (_, i) =>
      encodeRgb9e5(...gray(i < 50 ? MIDDLE_GRAY : 4 * MIDDLE_GRAY)),
    );
    const histogram = computeHistogram(encoded, displayMatrix(0.01, 6500, 0));
    expect(percentile(histogram, 0.25)).toBeCloseTo(0, 0);
    expect(percentile(histogram, 0.75)).toBeCloseTo(2, 0);
  });
});

function gray(value: number): [number, number, number] {
  return [value, value, value];
}

test("solo takes the selected material, and ends on itself or without one", () => {
  expect(toggledSolo(null, "Teapot")).toBe("Teapot");
  expect(toggledSolo("Teapot", "Cloth")).toBe("Cloth");
  expect([toggledSolo("Teapot", "Teapot"), toggledSolo("Teapot", null), toggledSolo(null, null)]).toEqual([
    null,
    null,
    null,
  ]);
});
