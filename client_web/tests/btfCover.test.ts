/** What is said where a texture that looks different from every side covers a material, and who draws it. */
import { expect, test, vi } from "vitest";
import type { SceneBody } from "../src/protocol";
import type { Look } from "../src/protocol";
import { look } from "../src/state/look";
import { scene } from "../src/state/scene";

vi.hoisted(() => vi.stubGlobal("localStorage", { getItem: () => null, setItem: () => undefined }));
const { showNote } = vi.hoisted(() => ({ showNote: vi.fn() }));
vi.mock("../src/ui/toasts", async (original) => ({ ...(await original<object>()), showNote }));

const material = (name: string, is_projected: boolean) => ({
  name,
  is_projected,
  terms: [],
  shadow_catcher: false,
  is_glass: false,
  is_textured: false,
  objects: [],
});

test("a note about tri-planar mapping", async () => {
  const { coverText } = await import("../src/panels/inspector/ZernikeFit");
  scene.value = { materials: [material("Bare", true), material("Textured", false)] } as unknown as SceneBody;
  expect(coverText("Bare")).toContain("no UVs: the texture is projected");
  expect(coverText("Textured")).toBe(null);
});

test("the server draws BTFs even if this browser was chosen, and says so once", async () => {
  const { setRenderer, TEXEL_SHADING_NOTE } = await import("../src/session/clientRendering");
  const covered = (model: string) => ({ materials: { Cloth: { terms: [{ model }] } } }) as unknown as Look;
  scene.value = { materials: [material("Cloth", false)] } as unknown as SceneBody;
  setRenderer("client");
  look.value = covered("lambert");
  expect(showNote).not.toHaveBeenCalled();
  look.value = covered("measured_btf");
  look.value = covered("lambert");
  look.value = covered("measured_btf");
  expect(showNote.mock.calls).toEqual([[TEXEL_SHADING_NOTE]]);
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
