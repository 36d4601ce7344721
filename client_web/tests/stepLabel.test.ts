import { expect, test } from "vitest";
import { stepLabel, splitStepLabel } from "../src/edit/stepLabel";
import type { Look, ModelBody } from "../src/protocol";
import { LOOK } from "./exampleLook";

const models = [{ model: "ward", curves: [{ name: "h", label: "half angle θh" }] }] as unknown as ModelBody[];
const shiny = {
  ...LOOK,
  materials: { "Tea/pot": { terms: [{ model: "ward", color: [1, 1, 1] }] } },
} as unknown as Look;

test("a curve's step names material, curve and deed", () => {
  expect(stepLabel("/materials/Tea~1pot/terms/0/curves/h", "Move point", shiny, models)).toBe(
    "Tea/pot · half angle θh · move point",
  );
});

test("a parameter's step names material and parameter", () => {
  expect(stepLabel("/materials/Tea~1pot/terms/0/params/sigma", "Roughness σ", shiny, models)).toBe(
    "Tea/pot · Roughness σ",
  );
});

test("what belongs to no material keeps its own name; an unknown curve is called as it is", () => {
  expect(stepLabel("/display/exposure", "Exposure", shiny, models)).toBe("Exposure");
  expect(stepLabel("/materials/Tea~1pot/terms/3/curves/x", "Draw curve", shiny, models)).toBe(
    "Tea/pot · x · draw curve",
  );
});

test("a label is read as what was edited and what was done", () => {
  expect(splitStepLabel("Tea/pot · half angle θh · move point")).toEqual({
    subject: "Tea/pot",
    action: "half angle θh · move point",
  });
  expect(splitStepLabel("Opened")).toEqual({ subject: null, action: "Opened" });
});
