import { describe, expect, test } from "vitest";
import { encodeRgb9e5 } from "../src/color/rgb9e5";
import {
  BINS_PER_STOP,
  binOf,
  histogramOf,
  MIDDLE_GREY,
  MIN_STOP,
  NUM_BINS,
  percentile,
} from "../src/picture/histogram";
import { nextSolo } from "../src/seen/solo";

const total = (bins: Uint32Array) => bins.reduce((a, b) => a + b, 0);

describe("histogram", () => {
  test("bins are a sixth of a stop, the ends take what lies beyond them", () => {
    const middle = -MIN_STOP * BINS_PER_STOP;
    expect(binOf(MIDDLE_GREY * 1.01)).toBe(middle);
    expect(binOf(MIDDLE_GREY * 2.02)).toBe(middle + BINS_PER_STOP);
    expect([binOf(0), binOf(1e9)]).toEqual([0, NUM_BINS - 1]);
  });

  test("channels and luminance are counted apart", () => {
    const words = new Uint32Array(10).fill(encodeRgb9e5(0.5, 0, 0));
    const { luminance, channels, samples } = histogramOf(words, 0);
    expect(samples).toBe(10);
    expect(luminance[binOf(0.5 * 0.2126)]).toBe(10);
    expect(channels[0][binOf(0.5)]).toBe(10);
    expect([channels[1][0], channels[2][0]]).toEqual([10, 10]);
  });

  test("a stop of exposure moves everything by a stop", () => {
    const words = Uint32Array.from({ length: 500 }, (_, i) => encodeRgb9e5(0.02 + i / 300, 0.1, 0.3));
    const [before, after] = [histogramOf(words, 0), histogramOf(words, 1)];
    expect([...after.luminance.subarray(BINS_PER_STOP)]).toEqual([
      ...before.luminance.subarray(0, NUM_BINS - BINS_PER_STOP),
    ]);
  });

  test("a large picture is sampled, every sample is counted once in each channel", () => {
    const words = Uint32Array.from({ length: 1_000_000 }, (_, i) => encodeRgb9e5(i % 640 < 320 ? 0.05 : 1, 0.2, 0.2));
    const { luminance, channels, samples } = histogramOf(words, 0);
    expect(samples).toBeLessThanOrEqual(60_000);
    for (const bins of [luminance, ...channels]) expect(total(bins)).toBe(samples);
    expect((channels[0][binOf(1)] as number) / samples).toBeCloseTo(0.5, 2);
  });

  test("percentiles are stops about middle grey", () => {
    const words = Uint32Array.from({ length: 100 }, (_, i) => encodeRgb9e5(...grey(i < 50 ? MIDDLE_GREY : 4 * MIDDLE_GREY)));
    const histogram = histogramOf(words, 0.01);
    expect(percentile(histogram, 0.25)).toBeCloseTo(0, 0);
    expect(percentile(histogram, 0.75)).toBeCloseTo(2, 0);
  });
});

function grey(value: number): [number, number, number] {
  return [value, value, value];
}

test("solo takes the selected material, and ends on itself or without one", () => {
  expect(nextSolo(null, "Teapot")).toBe("Teapot");
  expect(nextSolo("Teapot", "Cloth")).toBe("Cloth");
  expect([nextSolo("Teapot", "Teapot"), nextSolo("Teapot", null), nextSolo(null, null)]).toEqual([null, null, null]);
});
