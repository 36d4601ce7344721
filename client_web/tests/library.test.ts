import { describe, expect, it } from "vitest";
import { placeOf, pointOf, rangeOf } from "../src/library/map";

const POINTS = [
  { f0: 0.04, sigma: 0.02 },
  { f0: 0.81, sigma: 0.5 },
  { f0: 0.25, sigma: 0.1 },
];
const RANGE = rangeOf(POINTS);

describe("the map of materials", () => {
  it("has its corners at the smoothest darkest and the roughest brightest", () => {
    expect(placeOf({ f0: 0.04, sigma: 0.02 }, RANGE)).toEqual({ x: 0, y: 0 });
    const { x, y } = placeOf({ f0: 0.81, sigma: 0.5 }, RANGE);
    expect([x, y]).toEqual([expect.closeTo(1), expect.closeTo(1)]);
  });

  it("finds the way back from any place", () => {
    for (const point of POINTS) {
      const again = pointOf(placeOf(point, RANGE), RANGE);
      expect(again.f0).toBeCloseTo(point.f0);
      expect(again.sigma).toBeCloseTo(point.sigma);
    }
  });

  it("keeps places outside on the edge", () => {
    expect(pointOf({ x: -3, y: 0 }, RANGE).f0).toBeCloseTo(0.04);
    expect(pointOf({ x: 0, y: 9 }, RANGE).sigma).toBeCloseTo(0.5);
  });
});
