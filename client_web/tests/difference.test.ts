/** Differences of two images: values of BT.2124, signs, and summaries. */
import { expect, test } from "vitest";
import { deltaE, stopsBetween } from "../src/render/color/difference";
import { summarizeDifference } from "../src/render/differenceSummary";
import { encodeRgb9e5 } from "../src/render/color/rgb9e5";
import { displayMatrix } from "../src/render/color/whiteBalance";
import { fragmentShader } from "../src/render/displayShaders";
import { differenceText } from "../src/viewport/DifferenceLegend";
import type { Rgb } from "../src/protocol";

const transform = { matrix: displayMatrix(0, 6500, 0), contrast: 1, toneMap: "none", lut: null } as const;

// computed with NumPy from the matrices of ITU-R BT.2100 and BT.2087, and the PQ curve
test.each<[Rgb, Rgb, number]>([
  [[0.5, 0.5, 0.5], [0.5, 0.5, 0.5], 0],
  [[0.5, 0.5, 0.5], [0.51, 0.51, 0.51], 2.6945],
  [[1, 0, 0], [0, 1, 0], 239.968],
  [[0.2, 0.3, 0.4], [0.4, 0.3, 0.2], 74.3956],
])("ΔE ITP of %o and %o is %s", (a, b, expected) => {
  expect(deltaE(a, b)).toBeCloseTo(expected, 1);
  expect(deltaE(b, a)).toBeCloseTo(deltaE(a, b), 9);
});

test("stops are positive where A is brighter, and zero between blacks", () => {
  const gray = (v: number): Rgb => [v, v, v];
  expect(stopsBetween(gray(2), gray(1), transform)).toBeCloseTo(1, 3);
  expect(stopsBetween(gray(0.5), gray(1), transform)).toBeCloseTo(-1, 3);
  expect(stopsBetween(gray(0), gray(1e-6), transform)).toBeCloseTo(0, 1);
});

test("summaries have the mean and the largest difference with its sign", () => {
  const image = (values: number[]) => ({
    width: values.length,
    height: 1,
    encoded: Uint32Array.from(values, (v) => encodeRgb9e5(v, v, v)),
  });
  const [a, b] = [image([1, 1, 1, 1]), image([1, 1, 4, 2])];
  const summary = summarizeDifference(a, b, transform, "stops");
  expect(summary?.mean).toBeCloseTo(-0.75, 2);
  expect(summary?.maximum).toBeCloseTo(-2, 2);
  expect(summary && differenceText(summary)).toBe("Mean −0.75, largest −2.00");
  expect(summarizeDifference(a, image([1]), transform, "stops")).toBeNull();
  const large = { width: 1000, height: 1000, encoded: new Uint32Array(1e6) };
  expect(summarizeDifference(large, large, transform, "delta_e")).toEqual({ mean: 0, maximum: 0, step: 21 });
});

test("the shader of a plain image has no difference in it", () => {
  const features = {
    toneMap: "agx",
    falseColor: false,
    contrast: false,
    lut: false,
    isMinified: false,
    displayReferred: false,
    transparent: false,
    compare: true,
    transparentReference: false,
    brush: false,
    outline: false,
    solo: false,
    canvasColor: "srgb",
  } as const;
  expect(fragmentShader({ ...features, difference: "off" })).not.toContain("#define DIFFERENCE");
  expect(fragmentShader({ ...features, difference: "delta_e" })).toContain("#define DIFFERENCE_DELTA_E");
});
