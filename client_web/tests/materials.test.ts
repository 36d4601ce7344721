/** What materials of a look make use of, and which faces and texels that means. */
import { expect, test } from "vitest";
import { rectanglesOf, TEXELS_PER_ROW } from "../src/render/freeCamera/dataLayout";
import { groupFaces, layersOfMaterials, readMaterials } from "../src/render/freeCamera/materials";

const NONE = [-1, -1, 0, -1];
const NO = [-1, -1, -1, -1];
const EMISSION = [0, 0, 0, -1];
const NOTHING = [NO, NO, NO];
const diffuse = [[0, -1, 1, -1], NONE, NONE, [-1, -1, 0, -1], EMISSION, ...NOTHING];
const textured = [[1, -1, 1, -1], [2, -1, 1, 0], NONE, [-1, 0, 0, -1], EMISSION, ...NOTHING];
const glossy = [[3, 0, 1, -1], NONE, NONE, [0, -1, 0, -1], EMISSION, [4, -1, -1, 5], NO, NO];
const mirror = [NONE, NONE, [-1, -1, 1, -1], [1, -1, 1, -1], EMISSION, NO, NO, [-1, -1, 6, -1]];
const NEVER = [false, false, false];

const read = (materials: number[][][]) =>
  readMaterials(new Int32Array(materials.flat(2)), (name, material) => (name === "vectors" ? 15 : 30) + material);

test("a material uses what its rows say", () => {
  const [first, second, third, fourth] = read([diffuse, textured, glossy, mirror]);
  const none = { isotropic: NEVER, anisotropic: NEVER };
  const plain = { isotropic: [true, false, false], anisotropic: NEVER };
  expect(first?.points).toEqual({
    functions: 15,
    plain,
    environment: none,
    otherLight: none,
    lobe: false,
    otherFunctions: 0,
    map: false,
  });
  expect(first?.pixels).toEqual({ groups: false, textures: false, lobes: false, catchesShadows: false });
  expect(second?.points).toMatchObject({ functions: 16, plain: { isotropic: [true, true, false] }, map: true });
  expect(second?.pixels).toEqual({ groups: true, textures: true, lobes: false, catchesShadows: false });
  expect(third?.points).toMatchObject({
    functions: 17,
    plain: { anisotropic: [true, false, false] },
    lobe: true,
    otherFunctions: 32,
  });
  expect(third?.points).toMatchObject({
    environment: { isotropic: [true, false, false], anisotropic: NEVER },
    otherLight: { isotropic: NEVER, anisotropic: [true, false, false] },
  });
  expect(third?.tables).toEqual({ plain: [3, 0, -1, -1, -1, -1], highlights: [4, -1, -1, 5, ...NO, ...NO] });
  expect(fourth?.points).toMatchObject({
    functions: 0,
    lobe: true,
    environment: none,
    otherLight: { isotropic: [false, false, true] },
    otherFunctions: 33,
  });
  expect(fourth?.pixels).toEqual({ groups: true, textures: false, lobes: true, catchesShadows: true });
});

test("only layers that somebody needs are drawn", () => {
  expect(layersOfMaterials(read([diffuse]))).toEqual([0]);
  expect(layersOfMaterials(read([diffuse, glossy]))).toEqual([0, 3, 4]);
  expect(layersOfMaterials(read([diffuse, textured, mirror]))).toEqual([0, 1, 2, 3, 4]);
});

test("faces of like materials are drawn together, each once", () => {
  const classes = groupFaces(read([diffuse, glossy, diffuse]), new Uint32Array([2, 1, 0, 1]));
  expect(classes.map(({ corners }) => [...corners])).toEqual([
    [0, 1, 2, 6, 7, 8],
    [3, 4, 5, 9, 10, 11],
  ]);
  expect(classes.map(({ shows }) => shows.lobes)).toEqual([false, true]);
});

test.each([
  [0, 10],
  [5, TEXELS_PER_ROW],
  [TEXELS_PER_ROW - 3, TEXELS_PER_ROW + 4],
  [TEXELS_PER_ROW, 3 * TEXELS_PER_ROW],
  [7, 5 * TEXELS_PER_ROW + 1],
  [2 * TEXELS_PER_ROW + 1, 2 * TEXELS_PER_ROW + 9],
])("texels from %i to %i are covered once by rectangles of rows", (start, end) => {
  const covered = rectanglesOf(start, end).flatMap(([left, top, width, height]) =>
    Array.from(
      { length: width * height },
      (_, k) => (top + Math.floor(k / width)) * TEXELS_PER_ROW + left + (k % width),
    ),
  );
  expect(covered.sort((a, b) => a - b)).toEqual(Array.from({ length: end - start }, (_, k) => start + k));
});
