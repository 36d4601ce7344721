import { expect, test } from "vitest";
import type { MaterialLook, ModelBody } from "../src/protocol";
import { look } from "../src/state/look";
import { models } from "../src/state/scene";
import { curvePath, selectedCurve, selectedMaterial, selectedTerm } from "../src/state/selection";
import { LOOK } from "./exampleLook";

test("no curve is open on a ground that only catches shadows, and the same one again on its surface", () => {
  models.value = [{ model: "cook_torrance", curves: [{ name: "theta_h" }] }] as unknown as ModelBody[];
  const withGround = (isCatcher: boolean) => ({
    ...LOOK,
    materials: { ...LOOK.materials, Teapot: { ...(LOOK.materials.Teapot as MaterialLook), shadow_catcher: isCatcher } },
  });
  [selectedMaterial.value, selectedTerm.value, selectedCurve.value] = ["Teapot", 1, "theta_h"];
  look.value = withGround(false);
  expect(curvePath.value).toBe("/materials/Teapot/terms/1/curves/theta_h");
  look.value = withGround(true);
  expect(curvePath.value).toBeNull();
  look.value = withGround(false);
  expect(curvePath.value).not.toBeNull();
});
