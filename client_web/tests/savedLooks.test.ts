import { beforeEach, expect, test, vi } from "vitest";
import { history } from "../src/edit/history";
import { cacheThumbnail, thumbnailOf } from "../src/panels/looks/namedThumbnails";
import {
  exchangeSavedLook,
  refreshSavedLooks,
  renameLook,
  savedLooks,
  unusedName,
} from "../src/panels/looks/savedLooks";
import type { SavedLook } from "../src/panels/looks/savedLooks";
import { undo } from "../src/panels/looks/undoRedo";
import { scene } from "../src/state/scene";
import { LOOK } from "./exampleLook";

let requests: string[];

beforeEach(() => {
  requests = [];
  savedLooks.value = [{ name: "Old", etag: '"1"', created: "1", view: null, look: LOOK }];
  vi.stubGlobal("fetch", (path: string, init: RequestInit) => {
    const headers = new Headers(init.headers);
    requests.push(`${init.method} ${path} ${headers.get("if-match") ?? `none ${headers.get("if-none-match")}`}`);
    return Promise.resolve(new Response(init.method === "DELETE" ? null : saved(path), { headers: { etag: '"2"' } }));
  });
});

/** A new look's entry: saved when it says, else now. */
const saved = (path: string) =>
  JSON.stringify({ created: new URL(path, "http://here").searchParams.get("created") ?? "2" });

const old = { name: "Old", look: LOOK, created: "1" };
const names = () => savedLooks.value.map(({ name }) => name);

test("a look is saved only where there is none of its name, and that is undone", async () => {
  const saved = { name: "New", look: LOOK };
  await exchangeSavedLook(null, saved);
  expect(names()).toEqual(["Old", "New"]);
  await exchangeSavedLook(saved, null);
  expect(names()).toEqual(["Old"]);
  expect(requests).toEqual(["PUT ./api/looks/New none *", 'DELETE ./api/looks/New "2"']);
});

test("a look that is saved over must be the one that is known", async () => {
  await exchangeSavedLook(old, { name: "Old", look: { ...LOOK, lights: {} } });
  expect(requests).toEqual(['PUT ./api/looks/Old "1"']);
  expect(savedLooks.value[0]?.etag).toBe('"2"');
});

test("a look that is renamed is written before the old one goes", async () => {
  await exchangeSavedLook(old, { name: "New", look: LOOK });
  expect(requests).toEqual(["PUT ./api/looks/New?created=1 none *", 'DELETE ./api/looks/Old "1"']);
  expect(names()).toEqual(["New"]);
});

test("a look that is renamed, or comes back, stands where it stood", async () => {
  await exchangeSavedLook(null, { name: "Later", look: LOOK });
  await exchangeSavedLook(old, { name: "New", look: LOOK });
  expect(names()).toEqual(["New", "Later"]);
  await exchangeSavedLook({ name: "New", look: LOOK, created: "1" }, null);
  await exchangeSavedLook(null, { name: "New", look: LOOK, created: "1" });
  expect(names()).toEqual(["New", "Later"]);
});

test("a view is saved with a look, goes along when it is renamed, and comes back with it", async () => {
  const view = { view: "left", camera: null };
  await exchangeSavedLook(null, { name: "New", look: LOOK, view });
  expect(savedLooks.value[1]?.view).toEqual(view);
  expect(requests).toEqual(["PUT ./api/looks/New none *", 'PUT ./api/looks/New/view "2"']);
  requests = [];
  await exchangeSavedLook({ name: "New", look: LOOK, view }, { name: "Newer", look: LOOK });
  expect(savedLooks.value.map((saved) => [saved.name, saved.view])).toEqual([
    ["Old", null],
    ["Newer", view],
  ]);
  requests = [];
  const newer = { name: "Newer", look: LOOK, view };
  await exchangeSavedLook(newer, { ...newer, view: null });
  expect(requests).toEqual(['PUT ./api/looks/Newer "2"', 'DELETE ./api/looks/Newer/view "2"']);
  requests = [];
  await exchangeSavedLook({ ...newer, view: null }, { ...newer, view: null });
  expect(requests).toEqual(['PUT ./api/looks/Newer "2"']);
});

test("looks come in the order in which they were saved first, with their thumbnails, whatever was changed last", async () => {
  const entries = [
    {
      name: "Studio",
      etag: '"s"',
      created: "2026-01-02T00:00:00+00:00",
      thumbnail: "/api/looks/Studio/thumbnail.webp?version=s",
    },
    { name: "Night", etag: '"n"', created: "2026-01-01T00:00:00+00:00", thumbnail: null },
  ];
  scene.value = { id: "s", materials: [], lights: [] } as never;
  vi.stubGlobal("fetch", (path: string) =>
    Promise.resolve(
      path === "./api/looks" ? Response.json(entries) : new Response("{}", { headers: { etag: `"${path.at(-1)}"` } }),
    ),
  );
  await refreshSavedLooks();
  expect(names()).toEqual(["Night", "Studio"]);
  expect([thumbnailOf('"s"'), thumbnailOf('"n"')]).toEqual(["/api/looks/Studio/thumbnail.webp?version=s", null]);
});

test("the thumbnail of a look goes along when it is renamed, and is there when it comes back", async () => {
  const sent: string[] = [];
  vi.stubGlobal("fetch", (path: string, init: RequestInit = {}) => {
    if (path.endsWith("/thumbnail")) sent.push(`${path} ${init.body as string}`);
    if (path.includes(".webp")) return Promise.resolve(new Response(new Uint8Array([1, 2, 3])));
    return Promise.resolve(new Response(init.method === "DELETE" ? null : saved(path), { headers: { etag: '"1"' } }));
  });
  cacheThumbnail('"1"', "/api/looks/Old/thumbnail.webp?version=1");
  await exchangeSavedLook(old, { name: "New", look: LOOK });
  const thumbnail = '{"picture":"data:image/webp;base64,AQID"}';
  expect(sent).toEqual([`./api/looks/New/thumbnail ${thumbnail}`]);
  await exchangeSavedLook({ name: "New", look: LOOK, created: "1" }, null);
  await exchangeSavedLook(null, { name: "New", look: LOOK, created: "1" });
  expect(sent).toEqual([`./api/looks/New/thumbnail ${thumbnail}`, `./api/looks/New/thumbnail ${thumbnail}`]);
});

test("a look is called otherwise than those of other scenes, which are not shown", async () => {
  const entries = ["Old", "Look 2", "Look 3"].map((name) => ({ name }));
  vi.stubGlobal("fetch", () => Promise.resolve(new Response(JSON.stringify(entries))));
  expect(await unusedName()).toBe("Look 4");
});

test("a name that is taken is said to be, not that somebody changed it", async () => {
  vi.stubGlobal("fetch", () => Promise.resolve(new Response("{}", { status: 412 })));
  await expect(exchangeSavedLook(old, { name: "Taken", look: LOOK })).rejects.toThrow(
    "A look named “Taken” already exists",
  );
  await expect(exchangeSavedLook(old, { ...old, look: { ...LOOK, lights: {} } })).rejects.toThrow(
    "was changed elsewhere",
  );
});

test("undo, pressed while a look is being renamed, takes the renaming back and not the step before", async () => {
  history.clear();
  let erased = (): void => undefined;
  const answer = vi.fn((path: string, init: RequestInit) => {
    const response = () => new Response(init.method === "DELETE" ? null : saved(path), { headers: { etag: '"2"' } });
    if (init.method !== "DELETE") return Promise.resolve(response());
    return new Promise<Response>((resolve) => (erased = () => resolve(response())));
  });
  vi.stubGlobal("fetch", answer);
  const renaming = renameLook(savedLooks.value[0] as SavedLook, "New");
  await vi.waitFor(() => expect(names()).toEqual(["Old", "New"])); // written, the old one is being deleted
  const undoing = undo();
  erased();
  await renaming;
  expect(names()).toEqual(["New"]);
  await vi.waitFor(() => expect(names()).toEqual(["New", "Old"]));
  erased();
  await undoing;
  await vi.waitFor(() => expect(history.cursor.value).toBe(0));
  expect(names()).toEqual(["Old"]);
});
