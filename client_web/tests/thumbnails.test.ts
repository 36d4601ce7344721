/** Pictures of looks that have names: of saved ones, and of variants of a scene's file. */
import { expect, test, vi } from "vitest";
import { shelf, thumbnailOf, variantKey } from "../src/looks/shelf";
import { giveToNamed } from "../src/looks/thumbnails";
import { defaultLook } from "../src/state/look";
import { scene } from "../src/state/scene";
import { LOOK, lookWith } from "./look";

test("a look gives its picture to what it is the look of, once", () => {
  const kept = new Map<string, string>();
  vi.stubGlobal("localStorage", { getItem: (key: string) => kept.get(key) ?? null, setItem: (key: string, text: string) => kept.set(key, text) });
  const bright = lookWith(LOOK, "/display/exposure", 2);
  defaultLook.value = LOOK;
  scene.value = { id: "s", materials: [], variants: [{ name: "Own", look: {} }, { name: "Bright", look: bright }] } as never;
  shelf.value = [{ name: "Bright", etag: "", look: bright }];
  giveToNamed(bright, "bright");
  giveToNamed(bright, "another");
  expect([thumbnailOf("Bright"), thumbnailOf(variantKey("Bright")), thumbnailOf(variantKey("Own"))]).toEqual(["bright", "bright", null]);
  giveToNamed(LOOK, "own");
  expect(thumbnailOf(variantKey("Own"))).toBe("own");
});
