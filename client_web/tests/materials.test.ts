/** What materials of a look make use of, and which faces and texels that means. */
import { expect, test } from "vitest";
import { rectanglesOf, WIDTH } from "../src/evaluator/common";
import { classesOf, layersOf, readMaterials } from "../src/evaluator/materials";

const NONE = [-1, -1, 0, -1];
const EMISSION = [0, 0, 0, -1];
const diffuse = [[0, -1, 1, -1], NONE, NONE, [-1, -1, 0, -1], EMISSION];
const textured = [[1, -1, 1, -1], [2, -1, 1, 0], NONE, [-1, 0, 0, -1], EMISSION];
const glossy = [[3, 0, 1, -1], NONE, NONE, [0, -1, 0, -1], EMISSION];
const mirror = [NONE, NONE, [-1, -1, 1, -1], [1, -1, 1, -1], EMISSION];
const ROWS = 2;
/** Two lobes of two rows: the first is told by the in-basis. */
const lobes = new Float32Array(2 * ROWS * 4 * 4);
lobes[4 * 3 + 2] = 1;

const read = (materials: number[][][]) =>
  readMaterials(new Int32Array(materials.flat(2)), lobes, ROWS, (name, material) => (name === "vectors" ? 15 : 30) + material);

test("a material uses what its rows say", () => {
  const [first, second, third, fourth] = read([diffuse, textured, glossy, mirror]);
  expect(first?.points).toEqual({ functions: 15, even: [true, false, false], uneven: [false, false, false], lobe: "none", others: 0, map: false });
  expect(first?.pixels).toEqual({ groups: false, textures: false, lobes: false, catches: false });
  expect(second?.points).toMatchObject({ functions: 16, even: [true, true, false], map: true });
  expect(second?.pixels).toEqual({ groups: true, textures: true, lobes: false, catches: false });
  expect(third?.points).toMatchObject({ functions: 17, uneven: [true, false, false], lobe: "told", others: 0 });
  expect(third?.tables).toEqual([3, 0, -1, -1, -1, -1]);
  expect(fourth?.points).toMatchObject({ functions: 0, lobe: "narrow", others: 33 });
  expect(fourth?.pixels).toEqual({ groups: true, textures: false, lobes: true, catches: true });
});

test("only layers that somebody needs are drawn", () => {
  expect(layersOf(read([diffuse]))).toEqual([0]);
  expect(layersOf(read([diffuse, glossy]))).toEqual([0, 3]);
  expect(layersOf(read([diffuse, textured, mirror]))).toEqual([0, 1, 2, 3]);
});

test("faces of like materials are drawn together, each once", () => {
  const classes = classesOf(read([diffuse, glossy, diffuse]), new Uint32Array([2, 1, 0, 1]));
  expect(classes.map(({ corners }) => [...corners])).toEqual([
    [0, 1, 2, 6, 7, 8],
    [3, 4, 5, 9, 10, 11],
  ]);
  expect(classes.map(({ shows }) => shows.lobes)).toEqual([false, true]);
});

test.each([
  [0, 10],
  [5, WIDTH],
  [WIDTH - 3, WIDTH + 4],
  [WIDTH, 3 * WIDTH],
  [7, 5 * WIDTH + 1],
  [2 * WIDTH + 1, 2 * WIDTH + 9],
])("texels from %i to %i are covered once by rectangles of rows", (start, end) => {
  const covered = rectanglesOf(start, end).flatMap(([left, top, width, height]) =>
    Array.from({ length: width * height }, (_, k) => (top + Math.floor(k / width)) * WIDTH + left + (k % width)),
  );
  expect(covered.sort((a, b) => a - b)).toEqual(Array.from({ length: end - start }, (_, k) => start + k));
});
