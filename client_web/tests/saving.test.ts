import { beforeEach, expect, test, vi } from "vitest";
import { saveLook } from "../src/looks/compare";
import { soloLight } from "../src/seen/solo";
import { look } from "../src/state/look";
import { giveThumbnail } from "../src/state/thumbnails";
import { LOOK } from "./look";

vi.mock("../src/looks/image", () => ({ thumbnail: () => "of the screen" }));
vi.mock("../src/picture/stage", () => ({ stage: { active: { pixels: null }, of: () => ({ revision: 0 }) } }));

let kept: string[];

beforeEach(() => {
  kept = [];
  vi.stubGlobal("window", { setTimeout: () => 0 });
  vi.stubGlobal("localStorage", { getItem: () => null, setItem: (_key: string, image: string) => kept.push(image) });
  vi.stubGlobal("fetch", () => Promise.resolve(Response.json([])));
  soloLight.value = null;
  look.value = { ...LOOK };
});

test("a look that is saved has the picture on the screen", async () => {
  await saveLook();
  expect(kept).toEqual(["of the screen"]);
});

test("one light alone is no picture of a look: it keeps the one it had, or waits for one", async () => {
  soloLight.value = "Lamp";
  await saveLook();
  expect(kept).toEqual([]);
  giveThumbnail(look.value as typeof LOOK, "of the look");
  await saveLook();
  expect(kept).toEqual(["of the look"]);
});
