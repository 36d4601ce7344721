import { beforeEach, expect, test, vi } from "vitest";
import { saveLook } from "../src/looks/compare";
import { soloLight } from "../src/seen/solo";
import { look } from "../src/state/look";
import { giveThumbnail } from "../src/state/thumbnails";
import { LOOK } from "./look";

vi.mock("../src/looks/image", () => ({ thumbnail: () => "data:screen" }));
vi.mock("../src/picture/stage", () => ({ stage: { active: { pixels: null }, of: () => ({ revision: 0 }) } }));

let sent: string[];
let version = 0;

function answer(path: string, init: RequestInit = {}): Response {
  if (init.method !== "PUT") return Response.json([]);
  if (!path.endsWith("/thumbnail")) return Response.json({ created: "1" }, { headers: { etag: `"${++version}"` } });
  sent.push((JSON.parse(String(init.body)) as { picture: string }).picture);
  return new Response(null, { status: 204 });
}

beforeEach(() => {
  sent = [];
  vi.stubGlobal("window", { setTimeout: () => 0 });
  vi.stubGlobal("fetch", (path: string, init?: RequestInit) => Promise.resolve(answer(path, init)));
  soloLight.value = null;
  look.value = { ...LOOK };
});

test("a look that is saved has the picture on the screen", async () => {
  await saveLook();
  expect(sent).toEqual(["data:screen"]);
});

test("one light alone is no picture of a look: it keeps the one it had, or waits for one", async () => {
  soloLight.value = "Lamp";
  await saveLook();
  expect(sent).toEqual([]);
  giveThumbnail(look.value as typeof LOOK, "data:look");
  await saveLook();
  expect(sent).toEqual(["data:look"]);
});
