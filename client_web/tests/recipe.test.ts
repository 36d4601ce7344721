/** Shapes of pictures: those of cameras, and the usual ones. */
import { expect, test } from "vitest";
import { reshaped, shapesFor } from "../src/scene/recipe";

const labels = (own: number) => shapesFor(own).shapes.map(({ label }) => label);

test("a camera that has a usual shape has that one, others come first", () => {
  expect(shapesFor(1.7777).chosen.label).toBe("16:9");
  expect(shapesFor(0.8).chosen.label).toBe("4:5");
  expect(labels(4 / 3)).toEqual(["4:3", "16:9", "1:1", "4:5"]);
  expect(shapesFor(2.39).chosen).toEqual({ label: "2.39:1", aspect: 2.39 });
  expect(labels(2.39)[0]).toBe("2.39:1");
  expect(shapesFor(40).chosen.aspect).toBe(8);
});

test("another shape has about as many pixels", () => {
  expect(reshaped([640, 480], 4 / 3)).toEqual([640, 480]);
  const [width, height] = reshaped([640, 480], 16 / 9);
  expect(width / height).toBeCloseTo(16 / 9, 2);
  expect((width * height) / (640 * 480)).toBeCloseTo(1, 2);
});
