import { describe, expect, test } from "vitest";
import type { CurveAxes } from "../src/curve/model/axes";
import { readChannels, type DrawnChannels } from "../src/curve/model/channels";
import { applyLayer, layerOf, sampleBands } from "../src/curve/model/edits";
import { MAX_POINTS, BrushStroke } from "../src/curve/model/fit";
import { bendCurve, curveModel, pointsOf } from "../src/curve/model/model";
import { addPoint, movePoint, removePoint } from "../src/curve/model/points";
import {
  bandsWithin,
  drawInterval,
  scaleInterval,
  shiftInterval,
  type EditBase,
} from "../src/curve/model/intervalEdits";
import type { CurveBody, CurveEdits, CurveMessage, Handle, Point } from "../src/protocol";

const BANDS = 256;
const BAND = 90 / BANDS;
const LINEAR: CurveAxes = { stretched: true, log: false, top: 20_000 };
const LOG: CurveAxes = { stretched: true, log: true, top: 1e5 };
const INFO = { name: "theta_h", label: "half angle θh", bands: BANDS } as CurveBody;

/** Sharp metal: band averages fall from 16,000 to nothing within a degree. */
function beckmann(sigma: number): number[] {
  return Array.from({ length: BANDS }, (_, j) => {
    const theta = (((j + 0.5) / BANDS) * Math.PI) / 2;
    const value = Math.exp(-(Math.tan(theta) ** 2) / sigma ** 2) / (sigma ** 2 * Math.cos(theta) ** 4);
    return Number(value.toPrecision(6));
  });
}

function ggx(roughness: number): number[] {
  const a2 = roughness ** 4;
  return Array.from({ length: BANDS }, (_, j) => {
    const cos2 = Math.cos((((j + 0.5) / BANDS) * Math.PI) / 2) ** 2;
    return Number((a2 / (Math.PI * (cos2 * (a2 - 1) + 1) ** 2)).toPrecision(6));
  });
}

const CURVES = { metal: beckmann(0.008), ggx: ggx(0.245), sharp: ggx(0.05) };

function modelOf(generated: number[], edits?: CurveEdits) {
  const shape = { curve: "/c", generated: [generated, generated, generated] } as unknown as CurveMessage;
  return curveModel("/c", INFO, edits, shape);
}

test("bends curves as the server does", () => {
  // the same numbers stand in tests/brdf/test_curve_edits.py
  const drawn: DrawnChannels = {
    factors: [1, 1, 2, 0, 1, 1, 1, 1],
    offsets: [0, 0, 0, 3, 0, 0, 0, 0],
    handles: [
      [0, 8, 12],
      [20, 4, 2],
      [45, 3, 9],
      [90, 0, 0],
    ],
  };
  const ground = [8, 6, 4, 3, 2, 1, 0.5, 0];
  const expected = [
    12, 4.6061477767732395, 7.98575, 8.031796875, 6.723032069970845, 3.425655976676385, 1.1938775510204083, 0,
  ];
  applyLayer(layerOf(drawn, ground), ground).forEach((v, j) => expect(v).toBeCloseTo(expected[j] as number, 12));
});

describe.each(Object.entries(CURVES))("the points of %s", (_, generated) => {
  describe.each([
    ["linear", LINEAR],
    ["log", LOG],
  ])("on %s axes", (_, axes) => {
    const model = modelOf(generated);
    const points = pointsOf(model, 0, axes);

    test("lie on the curve, and taking hold of them changes nothing", () => {
      for (const [x, y] of points) expect(y).toBeCloseTo(Number(sampleBands(generated, x).toPrecision(6)), 12);
      const held = bendCurve(model, 0, points, points);
      expect(modelOf(generated, held).curves[0]).toEqual(generated);
      expect(pointsOf(modelOf(generated, held), 0, LINEAR)).toEqual(points);
    });

    test("a nudge moves nothing by more than its share, and nothing beyond its neighbors", () => {
      points.forEach(([x, y], i) => {
        const after = movePoint(points, i, x, y * 1.001, BAND);
        const curve = modelOf(generated, bendCurve(model, 0, points, after)).curves[0] as number[];
        const [low, high] = [points[i - 1]?.[0] ?? 0, points[i + 1]?.[0] ?? 90];
        const share = y === 0 ? 0 : (after[i] as Point)[1] / y - 1;
        curve.forEach((v, j) => {
          const before = generated[j] as number;
          expect(Math.abs(v - before)).toBeLessThanOrEqual(share * (1 + 1e-9) * before);
          const middle = (j + 0.5) * BAND;
          if (middle < low || middle > high) expect(v).toBe(before);
        });
      });
    });

    test("a point that is put back leaves no trace", () => {
      const [x, y] = points[1] as Point;
      const raised = movePoint(points, 1, x + 3 * BAND, y * 1.7, BAND);
      const away = modelOf(generated, bendCurve(model, 0, points, raised));
      expect(away.curves[0]).not.toEqual(generated);
      const movedPoints = pointsOf(away, 0, axes);
      const back = movePoint(movedPoints, 1, x, y, BAND);
      expect(modelOf(generated, bendCurve(away, 0, movedPoints, back)).curves[0]).toEqual(generated);
    });

    test("points that are added on the curve and removed change nothing", () => {
      const added = addPoint(points, 33, sampleBands(generated, 33), BAND);
      const more = modelOf(generated, bendCurve(model, 0, points, added.points));
      expect(more.curves[0]).toEqual(generated);
      const now = pointsOf(more, 0, axes);
      expect(now).toHaveLength(points.length + 1);
      const fewer = removePoint(now, added.index);
      expect(modelOf(generated, bendCurve(more, 0, now, fewer)).curves[0]).toEqual(generated);
    });
  });
});

test("a point goes where it is put, also out of nothing", () => {
  const generated = CURVES.metal;
  const model = modelOf(generated);
  const points = pointsOf(model, 0, LINEAR);
  const put = addPoint(points, 30.0586, 400, BAND);
  const now = modelOf(generated, bendCurve(model, 0, points, put.points));
  expect(sampleBands(now.curves[0] as number[], 30.0586)).toBeCloseTo(400, 1);
  expect(pointsOf(now, 0, LINEAR)[put.index]).toEqual([30.059, 400]);
});

test("a parameter that moves the curve keeps the edit in proportion", () => {
  const [before, after] = [ggx(0.3), ggx(0.4)];
  const model = modelOf(before);
  const points = pointsOf(model, 0, LINEAR);
  const doubled = bendCurve(model, 0, points, movePoint(points, 0, 0, 2 * (points[0] as Point)[1], BAND));
  const later = modelOf(after, doubled);
  const [x, y] = pointsOf(later, 0, LINEAR)[0] as Point;
  expect(x).toBe(0);
  expect(y / (after[0] as number)).toBeCloseTo(2, 4);
  // the others hold nothing, so they follow
  const last = pointsOf(later, 0, LINEAR).at(-1) as Point;
  expect(last[1]).toBeCloseTo(after.at(-1) as number, 9);
});

test("points that a person wrote stay, and are bent from where they are", () => {
  const points: Point[] = [
    [0, 4],
    [5, 3.8],
    [12, 1.5],
    [40, 2],
    [90, 0],
  ];
  const model = modelOf(CURVES.ggx, { points });
  const shown = pointsOf(model, 1, LINEAR);
  expect(shown).toBe(points);
  const next = bendCurve(model, 1, shown, movePoint(shown, 2, 12, 3, BAND));
  expect(next.points).toBe(points);
  expect(next.handles?.filter(([, was, becomes]) => was !== becomes)).toEqual([[12, 1.5, 3]]);
  const now = modelOf(CURVES.ggx, next);
  expect(pointsOf(now, 1, LINEAR)[2]).toEqual([12, 3]);
  const outside = (bands: number[]) => bands.filter((_, j) => (j + 0.5) * BAND < 5 || (j + 0.5) * BAND > 40);
  expect(outside(now.curves[1] as number[])).toEqual(outside(model.curves[1] as number[]));
});

describe("stretches", () => {
  function clothOf(generated: number[], edits?: CurveEdits, axes = LINEAR): EditBase {
    const model = modelOf(generated, edits);
    return { curve: model.channels[0], baseline: generated, points: pointsOf(model, 0, axes), axes };
  }
  const valuesOf = ({ baseline }: EditBase, drawn: DrawnChannels | null) =>
    applyLayer(layerOf(drawn, baseline), baseline);

  function stroke(from: number, to: number, height: (x: number) => number): BrushStroke {
    const made = new BrushStroke(BANDS, LINEAR);
    for (let x = from; x <= to; x += BAND / 2) made.add(x, height(x));
    return made;
  }
  /** A curve with one point raised, so that there is something to lose. */
  function bentCloth(generated: number[]): EditBase {
    const model = modelOf(generated);
    const points = pointsOf(model, 0, LINEAR);
    const [x, y] = points[1] as Point;
    return clothOf(generated, bendCurve(model, 0, points, movePoint(points, 1, x, y + 500, BAND)));
  }

  test.each([
    ["plain", clothOf],
    ["bent", bentCloth],
  ])("of a %s curve change nothing outside", (kind, make) => {
    const base = make(CURVES.sharp);
    const before = valuesOf(base, base.curve);
    const edits: [string, DrawnChannels | null, number, number][] = [
      [
        "draw",
        drawInterval(
          base,
          stroke(10, 20, () => 0.3),
        ),
        10,
        20,
      ],
      ["scale", scaleInterval(base, 10, 20, 1.5), 10, 20],
      ["shift", shiftInterval(base, 10, 20, 5), 10, 25],
      ["shift back", shiftInterval(base, 10, 20, -7), 3, 20],
    ];
    for (const [label, drawn, from, to] of edits) {
      const after = valuesOf(base, drawn);
      const [first, last] = [Math.floor(from / BAND), Math.floor(to / BAND)];
      after.forEach((v, j) => {
        if (j >= first && j <= last) return;
        if (kind === "plain") expect(v, `${label} ${j}`).toBe(before[j]);
        else expect(Math.abs(v - (before[j] as number)), `${label} ${j}`).toBeLessThanOrEqual(1e-8 * v);
      });
      expect(after.slice(first, last + 1)).not.toEqual(before.slice(first, last + 1));
      expect(drawn?.handles?.length).toBeGreaterThanOrEqual(2);
    }
  });

  test("a stroke is what was drawn, and its points lie on it", () => {
    const base = clothOf(CURVES.metal);
    const drawn = drawInterval(
      base,
      stroke(30, 60, (x) => x / 90),
    ) as DrawnChannels;
    const values = valuesOf(base, drawn);
    expect(sampleBands(values, 45)).toBeCloseTo(0.5 * LINEAR.top, -2);
    const within = drawn.handles?.filter(([x]) => x >= 30 && x <= 60) ?? [];
    expect(within.length).toBeGreaterThanOrEqual(2);
    for (const [x, was, becomes] of within)
      expect([was, becomes]).toEqual([was, Number(sampleBands(values, x).toPrecision(6))]);
  });

  test("scaling multiplies, and back again is where it was", () => {
    const base = clothOf(CURVES.ggx);
    const twice = scaleInterval(base, 15, 35, 2);
    const [first, last] = bandsWithin(15, 35, BANDS);
    valuesOf(base, twice).forEach((v, j) =>
      expect(v).toBe((j < first || j > last ? 1 : 2) * (CURVES.ggx[j] as number)),
    );
    const back = scaleInterval({ ...base, curve: twice }, 15, 35, 0.5);
    expect(valuesOf(base, back)).toEqual(CURVES.ggx);
    expect(back.factors).toBeUndefined();
  });

  test("shifting moves the stretch with its points and stays on the plot", () => {
    const ramp = Array.from({ length: BANDS }, (_, j) => 300 - j);
    const base = clothOf(ramp);
    const moved = valuesOf(base, shiftInterval(base, 10, 14, 10));
    expect(sampleBands(moved, 22)).toBeCloseTo(sampleBands(ramp, 12), 2);
    expect(sampleBands(moved, 15)).toBeCloseTo(sampleBands(ramp, 10), 2);
    const fences = shiftInterval(base, 10, 14, 10).handles?.map(([x]) => x);
    expect(fences).toEqual(expect.arrayContaining([20, 24]));
  });

  test("many of them stay bounded and valid", () => {
    let base = clothOf(CURVES.sharp);
    for (let pass = 0; pass < 30; pass++) {
      const made = drawInterval(
        base,
        stroke((pass * 7) % 50, 60 + (pass % 25), (x) => 0.4 + 0.3 * Math.sin(x / 2 + pass)),
      );
      const drawn = pass % 3 ? made : shiftInterval({ ...base, curve: made }, 5, 30, 11);
      const handles = drawn?.handles as Handle[];
      expect(handles.length).toBeLessThanOrEqual(MAX_POINTS);
      handles.forEach(([x], i) => expect(x).toBeGreaterThan(handles[i - 1]?.[0] ?? -1));
      for (const numbers of [drawn?.factors, drawn?.offsets] as number[][]) {
        for (const v of numbers) expect(v >= 0 && v <= 1e6).toBe(true);
      }
      base = clothOf(CURVES.sharp, { ...drawn });
      expect(readChannels({ ...drawn }, BANDS)[0]).toEqual(drawn);
    }
  });
});
