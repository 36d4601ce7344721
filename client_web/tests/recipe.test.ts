/** Shapes of images: those of cameras, and the usual ones. */
import { expect, test } from "vitest";
import { resizeToAspect, aspectChoicesFor } from "../src/session/scene/recipe";

const labels = (own: number) => aspectChoicesFor(own).shapes.map(({ label }) => label);

test("a camera that has a usual shape has that one, others come first", () => {
  expect(aspectChoicesFor(1.7777).selected.label).toBe("16:9");
  expect(aspectChoicesFor(0.8).selected.label).toBe("4:5");
  expect(labels(4 / 3)).toEqual(["4:3", "16:9", "1:1", "4:5"]);
  expect(aspectChoicesFor(2.39).selected).toEqual({ label: "2.39:1", aspect: 2.39 });
  expect(labels(2.39)[0]).toBe("2.39:1");
  expect(aspectChoicesFor(40).selected.aspect).toBe(8);
});

test("another shape has about as many pixels", () => {
  expect(resizeToAspect([640, 480], 4 / 3)).toEqual([640, 480]);
  const [width, height] = resizeToAspect([640, 480], 16 / 9);
  expect(width / height).toBeCloseTo(16 / 9, 2);
  expect((width * height) / (640 * 480)).toBeCloseTo(1, 2);
});
