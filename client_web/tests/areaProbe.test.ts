/** The area probe: rectangles inside the image, and the statistics of their pixels. */
import { describe, expect, test } from "vitest";
import { areaStatistics } from "../src/render/areaStatistics";
import { encodeRgb9e5 } from "../src/render/color/rgb9e5";
import { srgbEncode } from "../src/render/color/tonemap";
import { displayMatrix } from "../src/render/color/whiteBalance";
import { areaBetween, MAX_AREA_SIDE, middleArea, steppedArea } from "../src/state/areaProbe";

const transform = { matrix: displayMatrix(1, 6500, 0), contrast: 1, toneMap: "none", lut: null } as const;

test("rectangles include both pixels, stay inside, and are limited", () => {
  expect(areaBetween([6, 2], [3, 4], [10, 10])).toEqual({ x: 3, y: 2, width: 4, height: 3 });
  expect(areaBetween([-5, 8], [50, 99], [10, 10])).toEqual({ x: 0, y: 8, width: 10, height: 2 });
  const wide = areaBetween([3000, 0], [0, 0], [4000, 10]);
  expect(wide).toEqual({ x: 3001 - MAX_AREA_SIDE, y: 0, width: MAX_AREA_SIDE, height: 1 });
  expect(middleArea([80, 40])).toEqual({ x: 35, y: 17, width: 10, height: 5 });
});

test("keys move or resize a rectangle inside the image", () => {
  const area = { x: 1, y: 1, width: 3, height: 2 };
  expect(steppedArea(area, -10, 1, false, [8, 8])).toEqual({ ...area, x: 0, y: 2 });
  expect(steppedArea(area, 10, -10, true, [8, 8])).toEqual({ x: 1, y: 1, width: 7, height: 1 });
});

describe("statistics", () => {
  const gray = (v: number) => encodeRgb9e5(v, v, v);
  const pixels = {
    width: 3,
    height: 2,
    encoded: new Uint32Array([gray(0.125), encodeRgb9e5(0.5, 0.25, 0), gray(9), gray(0.375), gray(0), gray(9)]),
  };

  test("are those of linear radiance, of display values, and of luminance in stops after exposure", () => {
    const found = areaStatistics(pixels, { x: 0, y: 0, width: 2, height: 2 }, transform);
    expect(found?.radiance.mean).toEqual([0.25, 0.1875, 0.125]);
    expect(found?.radiance.minimum).toEqual([0, 0, 0]);
    expect(found?.radiance.maximum).toEqual([0.5, 0.375, 0.375]);
    const red = [0.25, 1, 0.75, 0].map(srgbEncode);
    expect(found?.display.mean[0]).toBeCloseTo(red.reduce((a, b) => a + b, 0) / 4, 6);
    const luminance = 0.2126 * 0.25 + 0.7152 * 0.1875 + 0.0722 * 0.125;
    expect(found?.stops.mean).toBeCloseTo(Math.log2((2 * luminance) / 0.18), 5);
    expect(found?.stops.maximum).toBeCloseTo(Math.log2(0.75 / 0.18), 5);
    expect(found?.stops.minimum).toBe(-Infinity);
  });

  test("leave out what is outside the image", () => {
    const corner = areaStatistics(pixels, { x: 2, y: 1, width: 5, height: 5 }, transform);
    expect(corner?.radiance.mean).toEqual([9, 9, 9]);
    expect(areaStatistics(pixels, { x: 3, y: 0, width: 1, height: 1 }, transform)).toBeNull();
  });
});
