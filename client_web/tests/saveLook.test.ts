import { beforeEach, expect, test, vi } from "vitest";
import { saveLook } from "../src/panels/looks/abCompare";
import { soloLight } from "../src/state/visibility/soloSources";
import { look } from "../src/state/look";
import { storeThumbnail } from "../src/state/thumbnails";
import { LOOK } from "./exampleLook";

vi.mock("../src/panels/looks/displayImage", () => ({ renderThumbnail: () => "data:screen" }));
vi.mock("../src/render/renderStage", () => ({ stage: { active: { pixels: null }, imageOf: () => ({ revision: 0 }) } }));

let sent: string[];
let version = 0;

function answer(path: string, init: RequestInit = {}): Response {
  if (init.method !== "PUT") return Response.json([]);
  if (!path.endsWith("/thumbnail")) return Response.json({ created: "1" }, { headers: { etag: `"${++version}"` } });
  sent.push((JSON.parse(init.body as string) as { picture: string }).picture);
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
  soloLight.value = "Key";
  await saveLook();
  expect(sent).toEqual([]);
  storeThumbnail(look.value as typeof LOOK, "data:look");
  await saveLook();
  expect(sent).toEqual(["data:look"]);
});
