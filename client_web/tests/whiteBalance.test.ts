/** White balance: the server's numbers, and grays that become gray. */
import { describe, expect, test } from "vitest";
import { balanceForGray, displayMatrix, transformColor } from "../src/render/color/whiteBalance";
import type { Rgb } from "../src/protocol";

describe("the matrix", () => {
  // tests/image_io/test_display_transform.py has the same numbers
  test.each<[number, number, Rgb]>([
    [6500, 0, [1, 1, 1]],
    [3200, 0, [0.394544, 1.100249, 2.796253]],
    [10000, 0, [1.176391, 0.985282, 0.715479]],
    [5000, 30, [0.938235, 0.972567, 1.585053]],
  ])("at %s K with tint %s is the server's", (kelvin, tint, expected) => {
    const white = transformColor(displayMatrix(1, kelvin, tint), [1, 1, 1]);
    white.forEach((v, c) => expect(v / 2).toBeCloseTo(expected[c] as number, 4));
  });
});

describe("a gray that is picked", () => {
  test.each<Rgb>([
    [0.5, 0.5, 0.5],
    [0.9, 0.7, 0.5],
    [0.2, 0.25, 0.3],
    [3, 3.4, 2.9],
  ])("%s, %s, %s becomes gray", (...color) => {
    const { temperature, tint } = balanceForGray(color) ?? { temperature: 0, tint: 0 };
    const [r, g, b] = transformColor(displayMatrix(0, temperature, tint), color);
    expect(r / g).toBeCloseTo(1, 2);
    expect(b / g).toBeCloseTo(1, 2);
  });

  test("is neutral if it is gray already, and black has no balance", () => {
    const neutral = balanceForGray([1, 1, 1]);
    expect(neutral?.temperature).toBeCloseTo(6500, -1);
    expect(neutral?.tint).toBeCloseTo(0, 1);
    expect(balanceForGray([0, 0, 0])).toBeNull();
  });
});
