/** Library materials dropped onto an image with a free camera: what is there only the server knows. */
import { expect, it, vi } from "vitest";
import type { ImageCanvas } from "../src/render/canvas";

const put = vi.hoisted(() => vi.fn());
const state = vi.hoisted((): { here: string | null; there: string | null; camera: object | null } => ({ here: null, there: "Cone", camera: {} }));
vi.mock("../src/panels/library/libraryItems", () => ({ DRAG_TYPE: "material", applyEntry: put }));
vi.mock("../src/viewport/cameras/freeCamera", () => ({ freeCameraOf: () => state.camera }));
vi.mock("../src/render/materialPicking", () => ({ pickMaterial: () => ({ px: 3, py: 4, material: state.here }) }));
vi.mock("../src/session/pixelProbe", () => ({ requestPixelProbe: () => Promise.resolve({ material: state.there }) }));

async function dropped(): Promise<boolean> {
  const { acceptMaterialDrops } = await import("../src/panels/library/dropMaterial");
  const canvas = new EventTarget();
  acceptMaterialDrops({ canvas, image: { view: "front", radiance: () => [0, 0, 0] } } as unknown as ImageCanvas);
  const carried = { types: ["material"], getData: () => "cloth" };
  const event = (kind: string) => Object.assign(new Event(kind, { cancelable: true }), { dataTransfer: carried });
  const over = event("dragover");
  put.mockClear();
  canvas.dispatchEvent(over);
  canvas.dispatchEvent(event("drop"));
  await new Promise((done) => setTimeout(done));
  return over.defaultPrevented;
}

it("applies it to the material that the server picks, and to none on the background", async () => {
  for (let k = 0; k < 2; k++) {
    expect(await dropped()).toBe(true);
    expect(put.mock.calls).toEqual([["Cone", "cloth"]]);
  }
  state.there = null;
  expect(await dropped()).toBe(true);
  expect(put).not.toHaveBeenCalled();
});

it("sends no request with a fixed camera", async () => {
  [state.camera, state.here] = [null, "Floor"];
  expect(await dropped()).toBe(true);
  expect(put.mock.calls).toEqual([["Floor", "cloth"]]);
  state.here = null;
  expect(await dropped()).toBe(false);
  expect(put).not.toHaveBeenCalled();
});
