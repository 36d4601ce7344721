import { expect, test } from "vitest";
import { withNormals, withoutNormals } from "../src/panels/inspector/images/normals";
import type { MaterialLook, ModelBody, Term } from "../src/protocol";
import { models } from "../src/state/scene";

const IMAGE = "image:0123456789abcdef";
models.value = [
  { model: "lambert", width: null, parameters: [] },
  { model: "ggx", width_parameter: "roughness", specular_below: 0.06, parameters: [] },
  { model: "ward", width: "alpha", parameters: [] },
] as unknown as ModelBody[];

const color: Term["color"] = [1, 1, 1];
const lambert: Term = { model: "lambert", color };
const ggx = (roughness: number, follows?: Term["roughness_map"]): Term =>
  ({ model: "ggx", color, params: { roughness }, ...(follows === undefined ? {} : { roughness_map: follows }) });
const own: MaterialLook = { terms: [lambert, ggx(0.3), ggx(0.01), { model: "ward", color, params: { alpha: 0.2 } }] };

test("bumps widen highlights that are no mirrors, as of files that have a normal map", () => {
  const [first, second, ...otherTerms] = own.terms as [Term, Term, Term, Term];
  const terms = [first, { ...second, roughness_map: "roughness" }, ...otherTerms];
  expect(withNormals(own, IMAGE)).toEqual({ terms, normal_map: { image: IMAGE, scale: 1 } });
});

test("another image is as strong as the one before it", () => {
  expect(withNormals({ ...own, normal_map: { image: "image:other", scale: 0.4 } }, IMAGE).normal_map).toEqual({ image: IMAGE, scale: 0.4 });
});

test("without it terms follow what they did", () => {
  expect(withoutNormals(withNormals(own, IMAGE), own)).toEqual(own);
  const mapped = { terms: [ggx(0.3, "roughness"), ggx(0.3, "image:rough"), ggx(0.3, null)] };
  expect(withoutNormals(withNormals(mapped, IMAGE), mapped)).toEqual(mapped);
});
