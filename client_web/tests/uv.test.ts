import { expect, test } from "vitest";
import { hasImages, uvOf, withUv } from "../src/panels/inspector/images/uv";
import type { MaterialLook, Term } from "../src/protocol";

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

test("only materials with images can be placed", () => {
  const withTerm = (fields: Partial<Term>): MaterialLook => ({ terms: [{ model: "lambert", ...fields } as Term] });
  const own = { name: "", terms: [], shadow_catcher: false, is_projected: false, is_glass: false, objects: [] };
  expect(hasImages(withTerm({ texture: null, roughness_map: null }))).toBe(false);
  expect(hasImages(withTerm({ texture: "diffuse" }), { ...own, is_textured: false })).toBe(false);
  expect(hasImages(plain, { ...own, is_textured: true })).toBe(true);
  expect(hasImages(withTerm({ texture: "image:0123456789abcdef" }))).toBe(true);
  expect(hasImages(withTerm({ roughness_map: "roughness" }))).toBe(true);
  expect(hasImages({ ...plain, normal_map: { image: "image:0123456789abcdef" } })).toBe(true);
  expect(hasImages(withUv(plain, { rotation: 30 }))).toBe(true);
});
