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

test("what is said of a term while the camera moves", async () => {
  const { fitMessage } = await import("../src/panels/inspector/ZernikeFit");
  const fit = { functions: 1, available: 36, residual: 0, required_functions: 1, drawn_by: "functions" } as const;
  expect(fitMessage(fit, false)).toBe("While the camera moves: 1 of 36 basis functions, error less than 1 %.");
  const glossy = { ...fit, functions: 36, residual: 0.3, required_functions: null };
  expect(fitMessage({ ...glossy, drawn_by: "lights" }, false)).toMatch(/visible lights; other light .* error 30 %\.$/);
  expect(fitMessage({ ...glossy, drawn_by: "rays" }, false)).toMatch(/ray traced\.$/);
  expect(fitMessage({ ...glossy, drawn_by: "rays" }, true)).toMatch(/environment, blurred/);
  expect(fitMessage({ ...fit, residual: 0.2, required_functions: 15 }, false)).toMatch(/under 5 % needs 15\.$/);
});
