/** What is said where a texture that looks different from every side covers a material. */
import { expect, test, vi } from "vitest";
import type { SceneBody } from "../src/protocol";
import { scene } from "../src/state/scene";
import { shownViews, views } from "../src/state/views";

vi.hoisted(() => vi.stubGlobal("localStorage", { getItem: () => null, setItem: () => undefined }));

const material = (name: string, is_projected: boolean) => ({
  name,
  is_projected,
  terms: [],
  shadow_catcher: false,
  is_glass: false,
});

test("notes about tri-planar mapping and about average texels in client rendering", async () => {
  const { coverText } = await import("../src/panels/inspector/ZernikeFit");
  const { isClientRendering } = await import("../src/session/clientRendering");
  scene.value = { materials: [material("Bare", true), material("Textured", false)] } as unknown as SceneBody;
  expect(coverText("Bare")).toContain("no UVs: the texture is projected");
  expect(coverText("Textured")).toBe(null);
  views.value = [{ name: "walk", camera_mode: "free" }] as unknown as typeof views.value;
  shownViews.value = ["walk"];
  isClientRendering.value = true;
  expect(coverText("Textured")).toBe("While the camera moves, this browser draws the average of all texels.");
  expect(coverText("Bare")).toMatch(/1 m per repeat\)\. While the camera moves/);
});
