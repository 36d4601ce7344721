import { expect, test } from "vitest";
import { detectMap } from "../src/panels/inspector/images/mapNames";
import {
  roughTermIndices,
  roughnessImage,
  withMap,
  withoutRoughnessImage,
  withRoughnessImage,
} from "../src/panels/inspector/images/roughness";
import type { ImageBody, ModelBody, Term } from "../src/protocol";
import { models } from "../src/state/scene";

const image = { texture: "image:0123456789abcdef", roughness: 0.6 } as ImageBody;
const width = (name: string, power: number, minimum = 0.01, maximum = 1) => ({
  texture: "specular",
  width_parameter: name,
  width_power: power,
  parameters: [{ name, minimum, maximum, default: 0.4 }],
});
models.value = [
  { model: "lambert", texture: "diffuse", width_parameter: null, width_power: null, parameters: [] },
  { model: "ggx", ...width("roughness", 1) },
  { model: "ward", ...width("alpha", 2) },
  { model: "phong", ...width("exponent", -4, 1, 1000) },
] as unknown as ModelBody[];

const term = (model: string, params: Term["params"] = {}, roughness_map?: Term["roughness_map"]): Term =>
  ({ model, params, texture: null, ...(roughness_map === undefined ? {} : { roughness_map }) }) as Term;

test("an image is for the terms that follow the scene's map, else for all that have a width", () => {
  expect(roughTermIndices([term("lambert"), term("ggx", {}, "roughness"), term("ggx")])).toEqual([1]);
  expect(roughTermIndices([term("lambert"), term("ggx"), term("ward")])).toEqual([1, 2]);
  expect(roughTermIndices([term("lambert")])).toEqual([]);
});

test("sliders show the mean of the image, in their own measure where that is a power of it", () => {
  const given = [
    term("lambert"),
    term("ggx", { roughness: 0.2 }),
    term("ward", { alpha: 0.1 }),
    term("phong", { exponent: 30 }),
  ];
  expect(withRoughnessImage(given, [1, 2, 3], image)).toEqual([
    term("lambert"),
    term("ggx", { roughness: 0.6 }, image.texture),
    term("ward", { alpha: 0.36 }, image.texture),
    term("phong", { exponent: 30 }, image.texture),
  ]);
});

test("terms of a material follow one map", () => {
  const otherTerm = "image:fedcba9876543210";
  const given = [term("ggx", {}, "roughness"), term("ggx", {}, null), term("ggx", {}, "roughness")];
  const made = withMap(given, 0, otherTerm);
  expect(made).toEqual([term("ggx", {}, otherTerm), term("ggx", {}, null), term("ggx", {}, otherTerm)]);
  expect(roughnessImage(made)).toBe(otherTerm);
  expect(withMap(made, 2, "roughness")).toEqual(given);
  expect(withMap(made, 0, null)).toEqual([term("ggx", {}, null), term("ggx", {}, null), term("ggx", {}, otherTerm)]);
  expect(withMap(given, 0, null)).toEqual([term("ggx", {}, null), term("ggx", {}, null), term("ggx", {}, "roughness")]);
});

test("without it the scene's own map and slider are back", () => {
  const own = [term("lambert"), term("ggx", { roughness: 0.2 }, "roughness"), term("ward", { alpha: 0.1 })];
  expect(withoutRoughnessImage(withRoughnessImage(own, [1, 2], image), own)).toEqual(own);
});

test("maps of gloss are none of roughness", () => {
  expect(detectMap("oak_gloss_2k.jpg")).toBe("gloss");
});
