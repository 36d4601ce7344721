/** What is said where a texture that looks different from every side covers a material. */
import { expect, test, vi } from "vitest";
import type { SceneBody } from "../src/protocol";
import { scene } from "../src/state/scene";
import { shownViews, views } from "../src/state/views";

vi.hoisted(() => vi.stubGlobal("localStorage", { getItem: () => null, setItem: () => undefined }));

const material = (name: string, is_projected: boolean) => ({ name, is_projected, terms: [], shadow_catcher: false, is_glass: false });

test("an object without places in textures is said to take a projection, and a browser that draws to show the mean", async () => {
  const { coverText } = await import("../src/panels/inspector/ZernikeFit");
  const { isClientRendering } = await import("../src/session/clientRendering");
  scene.value = { materials: [material("Bare", true), material("Dressed", false)] } as unknown as SceneBody;
  expect(coverText("Bare")).toContain("no places in textures: it is projected");
  expect(coverText("Dressed")).toBe(null);
  views.value = [{ name: "walk", camera_mode: "free" }] as unknown as typeof views.value;
  shownViews.value = ["walk"];
  isClientRendering.value = true;
  expect(coverText("Dressed")).toBe("While the eye moves: the mean of all texels, as this browser draws.");
  expect(coverText("Bare")).toMatch(/metre for each repeat\. While the eye moves/);
});
