import { expect, test } from "vitest";
import { reflectanceOf, withGlass } from "../src/panels/inspector/glass/glass";
import { models } from "../src/state/scene";
import type { MaterialLook, ModelBody } from "../src/protocol";

const parameter = (name: string, minimum: number, maximum: number) => ({ name, minimum, maximum });
models.value = [
  { model: "ggx", parameters: [parameter("roughness", 0.01, 1), parameter("f0", 0, 1)] },
] as unknown as ModelBody[];

const term = (f0: number, roughness: number) => ({
  model: "ggx",
  color: [1, 1, 1] as [number, number, number],
  texture: null,
  params: { f0: [f0, f0, f0] as [number, number, number], roughness },
  curves: {},
});
const glass = { color: [1, 1, 1] as [number, number, number], roughness: 0, ior: 1.5 };
const material = (...terms: MaterialLook["terms"]): MaterialLook => ({ terms, glass });

test("reflections of the same surface follow its index of refraction and roughness", () => {
  const edited = withGlass(material(term(0.04, 0.01)), { ior: 2, roughness: 0.4 });
  expect(edited.glass).toEqual({ ...glass, ior: 2, roughness: 0.4 });
  expect(edited.terms[0]?.params).toEqual({ f0: reflectanceOf(2), roughness: 0.4 });
});

test("reflections that were edited stay as they are", () => {
  const own = term(0.2, 0.3);
  expect(withGlass(material(own), { ior: 2, roughness: 0.4 }).terms[0]).toBe(own);
});

test("a color changes no term", () => {
  const before = material(term(0.04, 0.01));
  const edited = withGlass(before, { color: [0.5, 0.6, 0.7] });
  expect(edited.terms[0]).toBe(before.terms[0]);
  expect(edited.glass?.color).toEqual([0.5, 0.6, 0.7]);
});

test("opaque materials have no glass to edit", () => {
  const opaque: MaterialLook = { terms: [term(0.04, 0.3)] };
  expect(withGlass(opaque, { ior: 2 })).toBe(opaque);
});
