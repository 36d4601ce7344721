import { expect, test } from "vitest";
import { texturesOf } from "../src/inspector/terms";
import type { SceneBody } from "../src/protocol";
import { scene } from "../src/state/scene";

test("a material offers the images that its own terms take, in their order", () => {
  const materials = [
    { name: "Tray", terms: [{ model: "ggx", texture: "specular" }, { model: "lambert", texture: "diffuse" }] },
    { name: "Wall", terms: [{ model: "lambert", texture: null }, { model: "phong" }] },
  ];
  scene.value = { materials } as unknown as SceneBody;
  expect(texturesOf("Tray")).toEqual(["diffuse", "specular"]);
  expect(texturesOf("Wall")).toEqual([]);
  expect(texturesOf("Nothing")).toEqual([]);
});
