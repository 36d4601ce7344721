import { expect, test } from "vitest";
import { canBeMetal, metalnessOf, withoutMetalness } from "../src/panels/inspector/images/metalness";
import type { ImageBody, ModelBody, Term } from "../src/protocol";
import { models } from "../src/state/scene";

const METAL = "image:0123456789abcdef";
const COLOR = "image:00000000000000cc";
const [SCATTERS, SHINES] = ["image:00000000000000d1", "image:00000000000000d2"];
models.value = [
  { model: "lambert", texture: "diffuse", parameters: [] },
  { model: "ggx", texture: "specular", parameters: [{ name: "f0" }] },
  { model: "phong", texture: "specular", parameters: [] },
] as unknown as ModelBody[];

const lambert = (texture: string | null, color: Term["color"] = [0.5, 0.2, 0.1]): Term => ({
  model: "lambert",
  texture,
  color,
});
const ggx = (texture: string | null, f0: number | Term["color"] = 0.04): Term => ({
  model: "ggx",
  texture,
  color: [1, 1, 1],
  params: { f0 },
});
const imageNamed = (base: string | null) => (texture: string) =>
  (texture === COLOR ? { texture, metalness: null, base: null } : { texture, metalness: METAL, base }) as ImageBody;
const made = [lambert(SCATTERS), ggx(SHINES, [0.5, 0.3, 0.2])];

test("the image of metalness is what the others were made of", () => {
  expect(metalnessOf(made, imageNamed(null))).toBe(METAL);
  expect(metalnessOf([lambert(COLOR), ggx(null)], imageNamed(null))).toBeNull();
  expect(metalnessOf([lambert("diffuse"), ggx("specular")], imageNamed(null))).toBeNull();
  expect(metalnessOf(made, () => undefined)).toBeNull();
});

test("only what scatters light and has a reflectance may be metal", () => {
  expect(canBeMetal(made)).toBe(true);
  expect(canBeMetal([lambert(null), { ...ggx(null), model: "phong" }])).toBe(false);
  expect(canBeMetal([ggx(null)])).toBe(false);
});

test("without it the base color that was under it is back, and the scene's own highlights", () => {
  const own = [lambert("diffuse", [1, 1, 1]), ggx(null)];
  expect(withoutMetalness(made, own, imageNamed(COLOR))).toEqual([lambert(COLOR), ggx(null)]);
  expect(withoutMetalness(made, own, imageNamed("diffuse"))).toEqual([lambert("diffuse"), ggx(null)]);
  expect(withoutMetalness(made, [lambert(null, [1, 1, 1]), ggx(null)], imageNamed(null))).toEqual([
    lambert(null),
    ggx(null),
  ]);
});

test("what the file shared out between both is back as it was", () => {
  const own = [lambert("diffuse", [0.9, 0.9, 0.9]), ggx("specular", 0.6)];
  expect(withoutMetalness(made, own, imageNamed("scene"))).toEqual(own);
  const metal = [lambert(null, [0, 0, 0]), ggx(null, 0.9)];
  expect(withoutMetalness(made, metal, imageNamed(null))).toEqual(metal);
});
