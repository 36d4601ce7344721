/** Library materials dropped onto a picture whose eye moves: what is there only the server knows. */
import { expect, it, vi } from "vitest";
import type { Screen } from "../src/picture/screen";

const put = vi.hoisted(() => vi.fn());
const seen = vi.hoisted(() => ({ here: null as string | null, there: "Cone" as string | null, eye: {} as unknown }));
vi.mock("../src/library/library", () => ({ DRAG_TYPE: "material", putOn: put }));
vi.mock("../src/cameras/eye", () => ({ eyeOf: () => seen.eye }));
vi.mock("../src/picture/hit", () => ({ hitAt: () => ({ px: 3, py: 4, material: seen.here }) }));
vi.mock("../src/live/probing", () => ({ askProbe: () => Promise.resolve({ material: seen.there }) }));

async function dropped(): Promise<boolean> {
  const { acceptMaterials } = await import("../src/library/drop");
  const canvas = new EventTarget();
  acceptMaterials({ canvas, picture: { view: "front", radiance: () => [0, 0, 0] } } as unknown as Screen);
  const carried = { types: ["material"], getData: () => "cloth" };
  const event = (kind: string) => Object.assign(new Event(kind, { cancelable: true }), { dataTransfer: carried });
  const over = event("dragover");
  put.mockClear();
  canvas.dispatchEvent(over);
  canvas.dispatchEvent(event("drop"));
  await new Promise((done) => setTimeout(done));
  return over.defaultPrevented;
}

it("puts it on what the server says is there, twice, and on nothing in the background", async () => {
  for (let k = 0; k < 2; k++) {
    expect(await dropped()).toBe(true);
    expect(put.mock.calls).toEqual([["Cone", "cloth"]]);
  }
  seen.there = null;
  expect(await dropped()).toBe(true);
  expect(put).not.toHaveBeenCalled();
});

it("asks nobody where the eye stays", async () => {
  [seen.eye, seen.here] = [null, "Floor"];
  expect(await dropped()).toBe(true);
  expect(put.mock.calls).toEqual([["Floor", "cloth"]]);
  seen.here = null;
  expect(await dropped()).toBe(false);
  expect(put).not.toHaveBeenCalled();
});
