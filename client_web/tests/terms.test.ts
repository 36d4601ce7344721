import { expect, test } from "vitest";
import { albedoMessage } from "../src/panels/inspector/albedo";
import { btfOf, limitToStored, isWithinStored } from "../src/panels/inspector/measuredInfo";
import { isMirror, lightViewTerm, texturesOf } from "../src/panels/inspector/terms";
import type { ModelBody, ParameterBody, Rgb, SceneBody, Term } from "../src/protocol";
import { models, scene } from "../src/state/scene";

test("a material offers the images that its own terms take, in their order", () => {
  const materials = [
    {
      name: "Tray",
      terms: [
        { model: "ggx", texture: "specular" },
        { model: "lambert", texture: "diffuse" },
      ],
    },
    { name: "Wall", terms: [{ model: "lambert", texture: null }, { model: "phong" }] },
  ];
  scene.value = { materials } as unknown as SceneBody;
  expect(texturesOf("Tray")).toEqual(["diffuse", "specular"]);
  expect(texturesOf("Wall")).toEqual([]);
  expect(texturesOf("Nothing")).toEqual([]);
});

test("LV is diffuse with a curve of each direction, both one", () => {
  expect(lightViewTerm([])).toBeNull();
  const lambert = { model: "lambert", texture: "diffuse", parameters: [] } as unknown as ModelBody;
  const one = {
    points: [
      [0, 1],
      [90, 1],
    ],
  };
  expect(lightViewTerm([lambert])).toMatchObject({ model: "lambert", curves: { theta_i: one, theta_o: one } });
});

test("a smooth, untextured term is a mirror if its facets are not drawn", () => {
  const curves = ["theta_h", "theta_d", "theta_i"].map((name) => ({ name, angle: name }));
  models.value = [
    { model: "ggx", width_parameter: "roughness", specular_below: 0.06, curves },
  ] as unknown as ModelBody[];
  const ggx = (roughness: number | Rgb, fields: Partial<Term> = {}): Term => ({
    model: "ggx",
    color: [1, 1, 1],
    params: { roughness },
    texture: "specular",
    ...fields,
  });
  const drawn = [{ knots: [] }] as unknown as NonNullable<Term["curves"]>[string];
  expect(isMirror(ggx(0.05))).toBe(true);
  expect(isMirror(ggx([0.3, 0.3, 0.05]))).toBe(true);
  expect(isMirror(ggx(0.06))).toBe(false);
  expect(isMirror(ggx(0.05, { texture: "diffuse" }))).toBe(false);
  expect(isMirror(ggx(0.05, { roughness_map: "roughness" }))).toBe(false);
  expect(isMirror(ggx(0.05, { curves: { theta_h: drawn } }))).toBe(false);
  expect(isMirror(ggx(0.05, { curves: { theta_d: drawn } }))).toBe(true);
  expect(isMirror(ggx(0.05, { curves: { theta_i: drawn } }))).toBe(true);
  expect(isMirror(ggx(0.05, { model: "lambert" }))).toBe(false);
  expect(isMirror(ggx(0.02))).toBe(true);
});

test("a warning is shown only if a material reflects more light than it receives", () => {
  expect(albedoMessage({ mean: [0.5, 0.5, 0.5], max: 1.01, max_angle_degrees: 89 })).toBeNull();
  expect(albedoMessage({ mean: [0.7, 0.2, 0.4], max: 1.234, max_angle_degrees: 80.6 })).toBe(
    "Reflects more light than it receives (123 % at 81°, 70 % on average). Not physically possible.",
  );
});

test("the quality of a texture from all sides goes as far as it has components", () => {
  const quality = { name: "components", minimum: 0, maximum: 16, default: 16 } as ParameterBody;
  const [five, unknown, none] = [limitToStored(quality, 5), limitToStored(quality, null), limitToStored(quality, 0)];
  expect([five.maximum, five.default, unknown.maximum, none.maximum]).toEqual([5, 5, 16, 1]);
  expect([isWithinStored(five, 16), isWithinStored(five, 2), isWithinStored(five, undefined)]).toEqual([5, 2, 5]);
  const scale = { name: "scale", maximum: 200, default: 1 } as ParameterBody;
  expect(limitToStored(scale, 5)).toBe(scale);
  expect(isWithinStored(scale, 300)).toBe(300);
  expect([btfOf({ data: "btf:12" } as Term), btfOf({ data: "merl:12" } as Term), btfOf({} as Term)]).toEqual([
    "12",
    null,
    null,
  ]);
});
