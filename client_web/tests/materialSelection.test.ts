/** Several selected materials: shared edits, copy and paste. */
import { beforeEach, expect, test, vi } from "vitest";
import { editValue } from "../src/edit/edit";
import { history } from "../src/edit/history";
import { sharedPaths } from "../src/edit/sharedPaths";
import { copiedMaterial, copyMaterial, pasteMaterial, pasteOn } from "../src/panels/scene/copyMaterial";
import type { Look, MaterialLook } from "../src/protocol";
import { look } from "../src/state/look";
import { scene } from "../src/state/scene";
import {
  selectedMaterial,
  selectedMaterials,
  selectMaterial,
  selectMaterials,
  selectMaterialsTo,
  toggleMaterial,
} from "../src/state/selection";
import { LOOK } from "./exampleLook";

vi.stubGlobal("window", { setTimeout: () => 0 });

const lambert = { model: "lambert", color: [0.5, 0.5, 0.5] as [number, number, number] };
const ggx = (roughness: number) => ({
  model: "ggx",
  color: [1, 1, 1] as [number, number, number],
  params: { roughness },
});
const MATERIALS: Look["materials"] = {
  A: { terms: [lambert, ggx(0.1), ggx(0.2)] },
  B: { terms: [ggx(0.3), lambert] },
  C: { terms: [lambert] },
};
const NAMES = Object.keys(MATERIALS);

beforeEach(() => {
  history.clear();
  look.value = { ...LOOK, materials: MATERIALS };
  selectMaterial(null);
});

test("Ctrl adds and removes, Shift selects a range; a plain selection ends it", () => {
  selectMaterial("B");
  toggleMaterial("A");
  expect(selectedMaterials.value).toEqual(["B", "A"]);
  toggleMaterial("B");
  expect([selectedMaterial.value, selectedMaterials.value]).toEqual(["A", ["A"]]);
  selectMaterialsTo("C", NAMES);
  expect(selectedMaterials.value).toEqual(["A", "B", "C"]);
  selectMaterial("C");
  selectMaterialsTo("A", NAMES);
  expect(selectedMaterials.value).toEqual(["C", "B", "A"]);
  selectMaterial("C");
  expect(selectedMaterials.value).toEqual(["C"]);
});

test("a parameter is shared by the terms of the same model", () => {
  const look_ = look.value as Look;
  expect(sharedPaths(look_, "/materials/A/terms/1/params/roughness", NAMES)).toEqual([
    "/materials/B/terms/0/params/roughness",
  ]);
  expect(sharedPaths(look_, "/materials/A/terms/2/params/roughness", NAMES)).toEqual([]);
  expect(sharedPaths(look_, "/materials/A/terms/0/color", NAMES)).toEqual([
    "/materials/B/terms/1/color",
    "/materials/C/terms/0/color",
  ]);
  expect(sharedPaths(look_, "/materials/A/terms/0/texture", NAMES)).toEqual([]);
  expect(sharedPaths(look_, "/materials/A/terms/1/params/roughness", ["B", "C"])).toEqual([]);
  expect(sharedPaths(look_, "/environment/color", NAMES)).toEqual([]);
});

test("an edit of several materials is one step, also as a drag", () => {
  selectMaterials(NAMES);
  for (const roughness of [0.5, 0.6]) editValue("Roughness", "/materials/A/terms/1/params/roughness", roughness);
  expect(look.value?.materials["B"]?.terms[0]?.params).toEqual({ roughness: 0.6 });
  expect(look.value?.materials["A"]?.terms[2]?.params).toEqual({ roughness: 0.2 });
  const [step, ...more] = history.steps.value;
  expect(more).toEqual([]);
  expect(step?.label).toBe("A · Roughness (2 materials)");
  expect(step?.kind === "look" && step.before.materials).toEqual(MATERIALS);
});

test("a copied material is pasted on all selected ones, as one step", () => {
  selectMaterial("A");
  copyMaterial();
  expect(copiedMaterial.value?.name).toBe("A");
  selectMaterials(["B", "C"]);
  pasteMaterial();
  for (const name of ["B", "C"])
    expect(look.value?.materials[name]?.terms).toEqual(
      MATERIALS["A"]?.terms.map((term) => ({ ...term, texture: null })),
    );
  expect(history.steps.value.map(({ label }) => label)).toEqual(["2 materials · Paste “A”"]);
});

test("textures of the scene stay where they are, uploaded images and glass are pasted", () => {
  scene.value = { materials: [{ name: "B", terms: [{ ...lambert, texture: "diffuse" }] }] } as never;
  const glass = { color: [1, 0, 0] as [number, number, number], roughness: 0.2, ior: 1.4 };
  const copied = {
    terms: [
      { ...lambert, texture: "diffuse" },
      { ...ggx(0.1), texture: "image:1", roughness_map: "roughness" },
    ],
    normal_map: { image: "image:2", scale: 1 },
    glass,
  } as MaterialLook;
  const own = { ...glass, absorption: [1, 2, 3] as [number, number, number], ior: 1.8 };
  const onB = pasteOn("B", { terms: [], shadow_catcher: false, glass: own }, copied);
  expect(onB.terms.map(({ texture }) => texture)).toEqual(["diffuse", "image:1"]);
  expect(onB.terms[1]).not.toHaveProperty("roughness_map");
  expect(onB).toMatchObject({ normal_map: { image: "image:2" }, shadow_catcher: false, glass: { ...own, ...glass } });
  const onC = pasteOn("C", { terms: [], normal_map: { image: "image:3", scale: 1 } }, { terms: copied.terms });
  expect(onC.terms[0]?.texture).toBeNull();
  expect(onC).not.toHaveProperty("normal_map");
  expect(onC).not.toHaveProperty("glass");
});
