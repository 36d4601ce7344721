/** Materials of objects: made, extended and removed, each as one step. */
import { beforeEach, expect, test, vi } from "vitest";
import { editValue } from "../src/edit/edit";
import { history } from "../src/edit/history";
import { copyMaterial, pasteMaterial } from "../src/panels/scene/copyMaterial";
import { undo } from "../src/panels/looks/undoRedo";
import { addObject, makeUnique, rejoin, sharedObjects } from "../src/panels/inspector/objectMaterials";
import type { MaterialLook, SceneBody } from "../src/protocol";
import { look } from "../src/state/look";
import { materialOf, scene, shownMaterialNames } from "../src/state/scene";
import { selectedMaterial, selectMaterial } from "../src/state/selection";
import { LOOK } from "./exampleLook";

vi.stubGlobal("window", { setTimeout: () => 0 });

const material = (model: string): MaterialLook => ({ terms: [{ model, color: [0.5, 0.5, 0.5] }] });
const sceneMaterial = (name: string, objects: string[]) => ({
  name,
  terms: [],
  shadow_catcher: false,
  is_projected: false,
  is_glass: false,
  is_textured: false,
  objects,
});

beforeEach(() => {
  history.clear();
  scene.value = {
    materials: [sceneMaterial("Gold", ["bowl", "cup", "vase"]), sceneMaterial("Wall", ["wall"])],
  } as unknown as SceneBody;
  look.value = { ...LOOK, materials: { Gold: material("ggx"), Wall: material("lambert") } };
  selectMaterial("Gold");
});

const materials = () => look.value?.materials ?? {};

test("an object gets a copy of its material, which is selected", () => {
  makeUnique("Gold", "vase");
  expect(materials()["Gold (vase)"]).toEqual({ ...material("ggx"), base: "Gold", objects: ["vase"] });
  expect(selectedMaterial.value).toBe("Gold (vase)");
  expect(shownMaterialNames.value).toEqual(["Gold", "Gold (vase)", "Wall"]);
  expect(sharedObjects(materials(), "Gold")).toEqual(["bowl", "cup"]);
  expect(materialOf("Gold (vase)")?.name).toBe("Gold");
});

test("edits of the copy and of the shared material are separate", () => {
  makeUnique("Gold", "vase");
  editValue("Color", "/materials/Gold (vase)/terms/0/color", [1, 0, 0]);
  expect(materials()["Gold"]?.terms[0]?.color).toEqual([0.5, 0.5, 0.5]);
  expect(materials()["Gold (vase)"]?.terms[0]?.color).toEqual([1, 0, 0]);
});

test("another object joins the copy", () => {
  makeUnique("Gold", "vase");
  addObject("Gold (vase)", "bowl");
  expect(materials()["Gold (vase)"]?.objects).toEqual(["bowl", "vase"]);
  expect(sharedObjects(materials(), "Gold")).toEqual(["cup"]);
});

test("objects use the shared material again, and undo returns each step", async () => {
  makeUnique("Gold", "vase");
  const unique = materials();
  rejoin("Gold (vase)", unique["Gold (vase)"] as MaterialLook);
  expect(Object.keys(materials())).toEqual(["Gold", "Wall"]);
  await undo();
  expect(materials()).toEqual(unique);
  await undo();
  expect(Object.keys(materials())).toEqual(["Gold", "Wall"]);
});

test("a copied material is pasted on the object alone", () => {
  selectMaterial("Wall");
  copyMaterial();
  makeUnique("Gold", "vase");
  pasteMaterial();
  expect(materials()["Gold (vase)"]?.terms[0]?.model).toBe("lambert");
  expect(materials()["Gold (vase)"]).toMatchObject({ base: "Gold", objects: ["vase"] });
  expect(materials()["Gold"]?.terms[0]?.model).toBe("ggx");
});
