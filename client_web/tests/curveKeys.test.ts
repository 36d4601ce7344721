/** Keys on a curve's points, and names of keys. */
import { expect, test } from "vitest";
import { steppedValue } from "../src/curve/PointHandles";
import { keyName } from "../src/ui/chord";

test("a key moves a point by a share of its value, in the tail as at the peak, and back", () => {
  for (const value of [2500, 0.7, 0.00003]) {
    const up = steppedValue(value, 1.02, 3000);
    expect(up / value).toBeCloseTo(1.02, 4);
    expect(steppedValue(up, 1 / 1.02, 3000) / value).toBeCloseTo(1, 4);
  }
});

test("a point at zero comes off it upwards, and what is next to nothing is zero", () => {
  expect(steppedValue(0, 1.02, 3000)).toBe(3);
  expect(steppedValue(0, 1 / 1.02, 3000)).toBe(0);
  expect(steppedValue(3e-7, 1 / 25, 3000)).toBe(0);
});

test("tooltips and the shortcut list format keys alike", () => {
  expect(["p", "Ctrl+z", "Ctrl+Shift+z", "+", "\\", "1", "Enter"].map(keyName)).toEqual([
    "P",
    "Ctrl+Z",
    "Ctrl+Shift+Z",
    "+",
    "\\",
    "1",
    "Enter",
  ]);
});
