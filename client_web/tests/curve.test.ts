import { describe, expect, test } from "vitest";
import { degreesAt, niceTop, valueAt, xFraction, yFraction, type CurveAxes } from "../src/curve/model/axes";
import { joinChannels, readChannels, writeChannels } from "../src/curve/model/channels";
import { bandSamples, fitPoints, knotSamples, MAX_POINTS, BrushStroke } from "../src/curve/model/fit";
import { averageBands, pchip } from "../src/curve/model/pchip";
import { addPoint, movePoint, removePoint } from "../src/curve/model/points";
import { mainInterval, outputShares } from "../src/curve/model/interval";
import type { DrawnCurve, Point } from "../src/protocol";

const LINEAR: CurveAxes = { stretched: false, log: false, top: 5 };
const POINTS: Point[] = [
  [0, 4],
  [5, 3.8],
  [12, 1.5],
  [13, 1.5],
  [40, 2],
  [90, 0],
];

function beckmann(sigma: number, bands = 256): number[] {
  return Array.from({ length: bands }, (_, j) => {
    const theta = (((j + 0.5) / bands) * Math.PI) / 2;
    return Math.exp(-(Math.tan(theta) ** 2) / sigma ** 2) / (sigma ** 2 * Math.cos(theta) ** 4);
  });
}

function expectValid(points: readonly Point[]): void {
  points.forEach(([x, y], i) => {
    expect(x).toBeGreaterThanOrEqual(0);
    expect(x).toBeLessThanOrEqual(90);
    expect(y).toBeGreaterThanOrEqual(0);
    if (i > 0) expect(x).toBeGreaterThan((points[i - 1] as Point)[0]);
  });
}

describe("pchip", () => {
  test("agrees with SciPy's PchipInterpolator", () => {
    const expected = [
      3.9901352042921996, 3.8645408171687987, 2.8278019562285146, 1.5, 1.5833968399126148, 1.9979931920947007,
      1.6703953823953823, 0.07727827609427632,
    ];
    const curve = pchip(POINTS);
    [1, 4, 8, 12.5, 20, 39, 60, 89].forEach((x, i) => expect(curve(x)).toBeCloseTo(expected[i] as number, 10));
  });

  test("goes through its points, is constant outside and does not overshoot", () => {
    const curve = pchip([
      [10, 1],
      [20, 5],
      [30, 5.1],
    ]);
    expect([curve(0), curve(10), curve(20), curve(30), curve(90)]).toEqual([1, 1, 5, 5.1, 5.1]);
    for (let x = 10; x <= 30; x += 0.1) expect(curve(x)).toBeLessThanOrEqual(5.1 + 1e-12);
  });

  test("is averaged over bands", () => {
    const straight: Point[] = [
      [0, 0],
      [90, 9],
    ];
    averageBands(straight, 64).forEach((v, j) => expect(v).toBeCloseTo((9 * (j + 0.5)) / 64, 12));
    const curve = pchip(POINTS);
    const fine = (j: number) => Array.from({ length: 400 }, (_, i) => curve((90 * (j + (i + 0.5) / 400)) / 64));
    averageBands(POINTS, 64).forEach((v, j) => {
      expect(Math.abs(v - fine(j).reduce((a, b) => a + b, 0) / 400)).toBeLessThan(2e-3);
    });
  });

  test("one point and none are constant", () => {
    expect(pchip([[10, 3]])(50)).toBe(3);
    expect(pchip([])(50)).toBe(0);
  });
});

describe("axes", () => {
  test.each([
    { stretched: false, log: false, top: 4 },
    { stretched: true, log: true, top: 400 },
  ])("there and back: %o", (axes) => {
    for (const x of [0, 0.3, 7, 45, 90]) expect(degreesAt(axes, xFraction(axes, x))).toBeCloseTo(x, 9);
    for (const y of [axes.top, axes.top / 3, axes.top / 100])
      expect(valueAt(axes, yFraction(axes, y))).toBeCloseTo(y, 9);
    expect(valueAt(axes, 0)).toBe(0);
    expect(yFraction(axes, 0)).toBe(0);
  });

  test("the top leaves room above the largest value", () => {
    for (const v of [0.013, 0.9, 1, 4.9, 97, 3999]) {
      expect(niceTop(v, false)).toBeGreaterThan(v);
      expect(niceTop(v, false)).toBeLessThan(2.2 * v);
      expect(Math.log10(niceTop(v, true)) % 1).toBeCloseTo(0, 9);
    }
    expect(niceTop(0, false)).toBe(1);
  });
});

describe("fitPoints", () => {
  test.each([0.05, 0.2, 0.6])("a few points carry a Beckmann lobe of σ = %d", (sigma) => {
    const samples = bandSamples(beckmann(sigma));
    const axes: CurveAxes = { stretched: true, log: false, top: niceTop(Math.max(...beckmann(sigma)), false) };
    const points = fitPoints(samples, axes);
    expectValid(points);
    expect(points.length).toBeLessThanOrEqual(24);
    const curve = pchip(points);
    for (const [x, y] of samples) expect(Math.abs(curve(x) - y) / axes.top).toBeLessThan(0.01);
  });

  test("points may stand on each band's middle, and at the ends", () => {
    expect(knotSamples([3, 2, 1])).toEqual([
      [0, 3],
      [45, 2],
      [90, 1],
    ]);
  });

  test("a constant needs two points", () => {
    expect(fitPoints(bandSamples(Array<number>(64).fill(1)), LINEAR)).toEqual([
      [0, 1],
      [90, 1],
    ]);
  });
});

describe("Stroke", () => {
  test("fills the bands between two events and forgets nothing outside", () => {
    const stroke = new BrushStroke(90, LINEAR);
    stroke.add(10, 0);
    stroke.add(20, 1);
    const heights = stroke.heights(0);
    expect(heights).toHaveLength(11);
    expect(heights[5]).toBeCloseTo(0.5, 9);
    expect(stroke.range()).toEqual([10, 20]);
  });

  test("the newest pass wins", () => {
    const stroke = new BrushStroke(90, LINEAR);
    stroke.add(10, 0.2);
    stroke.add(30, 0.2);
    stroke.add(20, 0.8);
    expect(stroke.heights(0)[10]).toBeCloseTo(0.8, 9);
    expect(stroke.heights(0)[2]).toBeCloseTo(0.2, 9);
  });

  test("smoothing takes the shake out and keeps a straight line", () => {
    const shaky = new BrushStroke(256, LINEAR);
    const straight = new BrushStroke(256, LINEAR);
    for (let j = 0; j <= 128; j++) {
      shaky.add(((j + 0.5) / 256) * 90, 0.5 + (j % 2 ? 0.1 : -0.1));
      straight.add(((j + 0.5) / 256) * 90, j / 256);
    }
    const inner = shaky.heights().slice(6, -6);
    for (const h of inner) expect(Math.abs(h - 0.5)).toBeLessThan(0.005);
    straight.heights().forEach((h, j) => expect(h).toBeCloseTo(j / 256, 9));
  });
});

describe("points", () => {
  const BAND = 90 / 256;

  test("are added in order, and twice in one place is a change of value", () => {
    const { points, index } = addPoint(POINTS, 20, 3, BAND);
    expect(index).toBe(4);
    expectValid(points);
    const again = addPoint(points, 20.2, 5, BAND);
    expect(again.points).toHaveLength(points.length);
    expect(again.points[4]).toEqual([20, 5]);
    expect(addPoint(POINTS, 0.1, 7, BAND).points[0]).toEqual([0, 7]);
  });

  test("are stopped by their neighbors and by the plot", () => {
    const moved = movePoint(POINTS, 2, 60, -3, BAND);
    expectValid(moved);
    expect(moved[2]?.[0]).toBeCloseTo(13 - 0.9 * BAND, 3);
    expect(moved[2]?.[1]).toBe(0);
    expect(movePoint(POINTS, 5, 200, 1, BAND)[5]).toEqual([90, 1]);
    expect(POINTS[2]).toEqual([12, 1.5]);
  });

  test("that stand closer than a band can still be raised, and moved apart", () => {
    const close: Point[] = [
      [0, 1],
      [20, 2],
      [20.1, 3],
      [90, 0],
    ];
    expect(movePoint(close, 1, 20, 5, BAND)[1]).toEqual([20, 5]);
    expect(movePoint(close, 1, 20.05, 5, BAND)[1]).toEqual([20, 5]);
    expect(movePoint(close, 1, 15, 5, BAND)[1]).toEqual([15, 5]);
  });

  test("others stay the objects they were", () => {
    const { points } = addPoint(POINTS, 20, 3, BAND);
    for (const stored of POINTS) expect(points).toContain(stored);
    expect(movePoint(POINTS, 2, 11, 1, BAND).filter((p) => POINTS.includes(p))).toHaveLength(POINTS.length - 1);
  });

  test("two always stay", () => {
    const two: Point[] = [
      [0, 1],
      [90, 0],
    ];
    expect(removePoint(two, 0)).toEqual(two);
    expect(removePoint(POINTS, 1)).toHaveLength(POINTS.length - 1);
  });

  test("no more than the bound are taken", () => {
    const many = Array.from({ length: MAX_POINTS }, (_, i): Point => [i, 1]);
    expect(addPoint(many, 80.5, 1, BAND)).toEqual({ points: many, index: -1 });
  });
});

describe("channels", () => {
  const red: DrawnCurve = {
    points: [
      [0, 1],
      [90, 0],
    ],
  };
  const rest: DrawnCurve = {
    handles: [
      [0, 2, 2],
      [90, 1, 3],
    ],
    factors: [1, 0.5],
  };

  test("equal channels share one object, and reading gives back what was written", () => {
    expect(writeChannels([rest, rest, { ...rest }])).toEqual({ ...rest, channels: "rgb" });
    expect(writeChannels([null, null, null])).toBeUndefined();
    const mixed = [red, null, rest] as const;
    expect(writeChannels(mixed)).toEqual([
      { ...red, channels: "r" },
      { ...rest, channels: "b" },
    ]);
    expect(readChannels(writeChannels(mixed), 2)).toEqual(mixed);
    expect(joinChannels(readChannels(red, 2))).toBe(true);
    expect(joinChannels(mixed)).toBe(false);
  });

  test("rows of bands are flat, per channel, or for one channel", () => {
    const ramp = Array.from({ length: 64 }, (_, j) => 64 - j);
    const flat = readChannels({ bands: [...ramp, ...ramp.map((v) => 2 * v), ...ramp] }, 64);
    expect(flat.map((drawn) => (drawn?.bands as number[])[1])).toEqual([63, 126, 63]);
    expect(readChannels({ factors: [ramp, ramp, ramp] }, 64)[2]).toEqual({ factors: ramp });
    expect(readChannels({ offsets: ramp, channels: "g" }, 64)).toEqual([null, { offsets: ramp }, null]);
  });
});

test("a pixel's share through a curve, and nothing where only rounding is left", () => {
  expect(
    outputShares(
      [
        [0.1, 0.1],
        [0.05, 0.05],
        [0, 0],
      ],
      [0.4, 0.2, 0],
    ),
  ).toBeCloseTo(0.5, 12);
  expect(
    outputShares(
      [
        [1e-12, -1e-12],
        [0, 0],
        [0, 0],
      ],
      [0.4, 0.2, 0],
    ),
  ).toBe(0);
  expect(outputShares([[1], [1], [1]], [0, 0, 0])).toBe(0);
});

test("mainStretch finds the narrowest run that carries the light", () => {
  const bands = Array<number>(90).fill(0.01);
  bands.fill(10, 3, 7);
  expect(mainInterval([bands, bands, bands])).toEqual([3, 7]);
  expect(
    mainInterval([
      [0, 0],
      [0, 0],
      [0, 0],
    ]),
  ).toBeNull();
});
