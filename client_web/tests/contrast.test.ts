/** Contrast: the server's numbers, and its place among the steps to display values. */
import { expect, test } from "vitest";
import { withContrast } from "../src/render/color/contrast";
import { srgbEncode, toDisplay } from "../src/render/color/tonemap";
import { displayMatrix } from "../src/render/color/whiteBalance";

// tests/image_io/test_display_transform.py has the same numbers
test.each([
  [1, 0.7, 0.7],
  [2, 0.18, 0.18],
  [2, 0.36, 0.72],
  [0.5, 0.72, 0.36],
  [1.4, 1, 1.985596],
  [0.7, 0.01, 0.0238003],
])("contrast %s makes %s the server's %s", (contrast, radiance, expected) => {
  expect(withContrast(radiance, contrast)).toBeCloseTo(expected, 5);
});

test("contrast is after exposure and before the tone map, and black stays black", () => {
  const transform = { matrix: displayMatrix(1, 6500, 0), contrast: 2, toneMap: "none", lut: null } as const;
  const [r, g, b] = toDisplay([0.18, 0.09, 0], transform);
  expect(r).toBeCloseTo(srgbEncode(0.72), 9);
  expect(g).toBeCloseTo(srgbEncode(0.18), 9);
  expect(b).toBe(0);
});
