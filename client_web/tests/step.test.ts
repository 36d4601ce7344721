import { expect, test } from "vitest";
import { stepName, stepWords } from "../src/edit/step";
import type { Look, ModelBody } from "../src/protocol";
import { LOOK } from "./look";

const models = [{ model: "ward", curves: [{ name: "h", label: "half angle θh" }] }] as unknown as ModelBody[];
const shiny = {
  ...LOOK,
  materials: { "Tea/pot": { terms: [{ model: "ward", color: [1, 1, 1] }] } },
} as unknown as Look;

test("a curve's step names material, curve and deed", () => {
  expect(stepName("/materials/Tea~1pot/terms/0/curves/h", "Move point", shiny, models)).toBe(
    "Tea/pot · half angle θh · move point",
  );
});

test("a parameter's step names material and parameter", () => {
  expect(stepName("/materials/Tea~1pot/terms/0/params/sigma", "Roughness σ", shiny, models)).toBe(
    "Tea/pot · Roughness σ",
  );
});

test("what belongs to no material keeps its own name; an unknown curve is called as it is", () => {
  expect(stepName("/display/exposure", "Exposure", shiny, models)).toBe("Exposure");
  expect(stepName("/materials/Tea~1pot/terms/3/curves/x", "Draw curve", shiny, models)).toBe("Tea/pot · x · draw curve");
});

test("a label is read as what was edited and what was done", () => {
  expect(stepWords("Tea/pot · half angle θh · move point")).toEqual({ of: "Tea/pot", deed: "half angle θh · move point" });
  expect(stepWords("Opened")).toEqual({ of: null, deed: "Opened" });
});
