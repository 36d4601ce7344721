import { expect, test } from "vitest";
import { uvOf, withUv } from "../src/panels/inspector/images/uv";
import type { MaterialLook } from "../src/protocol";

const plain: MaterialLook = { terms: [] };

test("a change keeps the rest of the transform", () => {
  const scaled = withUv(plain, { scale: [2, 3] });
  expect(scaled.uv).toEqual({ scale: [2, 3], rotation: 0, offset: [0, 0] });
  expect(withUv(scaled, { rotation: 30 }).uv).toEqual({ scale: [2, 3], rotation: 30, offset: [0, 0] });
});

test("the identity leaves the material as it was", () => {
  const moved = withUv(plain, { offset: [0.5, 0] });
  expect(withUv(moved, { offset: [0, 0] })).toEqual(plain);
  expect(uvOf(plain)).toEqual({ scale: [1, 1], rotation: 0, offset: [0, 0] });
});
