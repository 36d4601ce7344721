/** Tables of views, between whose nodes go tetrahedra. */
import { expect, test } from "vitest";
import { displayMatrix } from "../src/render/color/whiteBalance";
import { lutSize, sampleDisplayLut, sampleLut, parseLut } from "../src/render/color/lutTable";
import { toDisplay } from "../src/render/color/tonemap";
import { LUT_GAIN, LUT_SIZE, type Rgb } from "../src/protocol";

const LAST = LUT_SIZE - 1;

/** Of a function of the places of red, green and blue in [0, 1], as the server sends it. */
function tableFrom(transform: (rgb: Rgb) => Rgb) {
  const view = new DataView(new ArrayBuffer(2 * 3 * LUT_SIZE ** 3));
  for (let at = 0; at < LUT_SIZE ** 3; at++) {
    const node = [Math.floor(at / LUT_SIZE ** 2), Math.floor(at / LUT_SIZE) % LUT_SIZE, at % LUT_SIZE].map(
      (k) => k / LAST,
    );
    transform(node as Rgb).forEach((v, c) => view.setUint16(2 * (3 * at + c), Math.round(65535 * v), true));
  }
  return parseLut(view.buffer);
}

const nodePosition = (x: number) => Math.min(1, Math.log(1 + LUT_GAIN * Math.sqrt(x)) / (2 * Math.log(1 + LUT_GAIN)));

// on each tetrahedron the order of the channels' parts stays, so that these are linear on it; on cubes they are not
const order = (rgb: Rgb): Rgb => {
  const [minimum, middle, maximum] = [...rgb].sort((a, b) => a - b) as Rgb;
  return [maximum, middle, minimum];
};
const ORDERED = tableFrom(order);
const MIXED = tableFrom(([r, g, b]) => [r, 0.5 * g + 0.5 * b, 1 - b]);

test.each<Rgb>([
  [0, 0, 0],
  [0.18, 0.18, 0.18],
  [1, 0.2, 0.05],
  [0.02, 3, 0.7],
  [0.4, 0.41, 30],
  [5, 129, 500],
])("%s, %s, %s is between its nodes", (...light) => {
  const at = light.map(nodePosition) as Rgb;
  sampleLut(ORDERED, light).forEach((v, c) => expect(v).toBeCloseTo(order(at)[c] as number, 4));
  const [r, g, b] = at;
  sampleLut(MIXED, light).forEach((v, c) => expect(v).toBeCloseTo([r, 0.5 * (g + b), 1 - b][c] as number, 4));
});

test("exposure comes before a view, and what is below nothing is black", () => {
  expect(
    toDisplay([0.5, 0.1, 2], { matrix: displayMatrix(1, 6500, 0), contrast: 1, toneMap: MIXED, lut: null }),
  ).toEqual(sampleLut(MIXED, [1, 0.2, 4]));
  expect(sampleLut(MIXED, [-1, -2, -3])).toEqual(sampleLut(MIXED, [0, 0, 0]));
});

test("a display LUT has its own size, is linear between its nodes, and follows the tone map", () => {
  // red inverted, green as it is, half the blue; red slowest
  const corners = [0, 1].flatMap((r) => [0, 1].flatMap((g) => [0, 1].flatMap((b) => [1 - r, g, b / 2])));
  const table = Float32Array.from(corners);
  expect(lutSize(table)).toBe(2);
  const [r, g, b] = sampleDisplayLut(table, [0.2, 0.7, 0.4]);
  expect([r, g, b].map((v) => Number(v.toFixed(6)))).toEqual([0.8, 0.7, 0.2]);
  expect(sampleDisplayLut(table, [-1, 2, 1])).toEqual([1, 1, 0.5]);
  const transform = { matrix: displayMatrix(0, 6500, 0), contrast: 1, toneMap: "none", lut: null } as const;
  const plain = toDisplay([0.1, 0.2, 0.3], transform);
  toDisplay([0.1, 0.2, 0.3], { ...transform, lut: table }).forEach((v, c) =>
    expect(v).toBeCloseTo([1 - plain[0], plain[1], plain[2] / 2][c] as number, 6),
  );
});
