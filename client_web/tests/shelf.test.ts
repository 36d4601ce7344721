import { beforeEach, expect, test, vi } from "vitest";
import { history } from "../src/edit/history";
import { showThumbnail, thumbnailOf } from "../src/looks/namedThumbnails";
import { exchange, refreshShelf, renameLook, shelf, unusedName } from "../src/looks/shelf";
import type { SavedLook } from "../src/looks/shelf";
import { undo } from "../src/looks/undo";
import { scene } from "../src/state/scene";
import { LOOK } from "./look";

let asked: string[];

beforeEach(() => {
  asked = [];
  shelf.value = [{ name: "Old", etag: '"1"', created: "1", look: LOOK }];
  vi.stubGlobal("fetch", (path: string, init: RequestInit) => {
    const headers = new Headers(init.headers);
    asked.push(`${init.method} ${path} ${headers.get("if-match") ?? `none ${headers.get("if-none-match")}`}`);
    return Promise.resolve(new Response(init.method === "DELETE" ? null : saved(path), { headers: { etag: '"2"' } }));
  });
});

/** A new look's entry: saved when it says, else now. */
const saved = (path: string) => JSON.stringify({ created: new URL(path, "http://here").searchParams.get("created") ?? "2" });

const old = { name: "Old", look: LOOK, created: "1" };
const names = () => shelf.value.map(({ name }) => name);

test("a look is saved only where there is none of its name, and that is undone", async () => {
  const saved = { name: "New", look: LOOK };
  await exchange(null, saved);
  expect(names()).toEqual(["Old", "New"]);
  await exchange(saved, null);
  expect(names()).toEqual(["Old"]);
  expect(asked).toEqual(["PUT /api/looks/New none *", 'DELETE /api/looks/New "2"']);
});

test("a look that is saved over must be the one that is known", async () => {
  await exchange(old, { name: "Old", look: { ...LOOK, lights: {} } });
  expect(asked).toEqual(['PUT /api/looks/Old "1"']);
  expect(shelf.value[0]?.etag).toBe('"2"');
});

test("a look that is renamed is written before the old one goes", async () => {
  await exchange(old, { name: "New", look: LOOK });
  expect(asked).toEqual(["PUT /api/looks/New?created=1 none *", 'DELETE /api/looks/Old "1"']);
  expect(names()).toEqual(["New"]);
});

test("a look that is renamed, or comes back, stands where it stood", async () => {
  await exchange(null, { name: "Later", look: LOOK });
  await exchange(old, { name: "New", look: LOOK });
  expect(names()).toEqual(["New", "Later"]);
  await exchange({ name: "New", look: LOOK, created: "1" }, null);
  await exchange(null, { name: "New", look: LOOK, created: "1" });
  expect(names()).toEqual(["New", "Later"]);
});

test("looks come in the order in which they were saved first, with their thumbnails, whatever was changed last", async () => {
  const entries = [
    { name: "Studio", etag: '"s"', created: "2026-01-02T00:00:00+00:00", thumbnail: "/api/looks/Studio/thumbnail.webp?version=s" },
    { name: "Night", etag: '"n"', created: "2026-01-01T00:00:00+00:00", thumbnail: null },
  ];
  scene.value = { id: "s", materials: [], lights: [] } as never;
  vi.stubGlobal("fetch", (path: string) =>
    Promise.resolve(path === "/api/looks" ? Response.json(entries) : new Response("{}", { headers: { etag: `"${path.at(-1)}"` } })),
  );
  await refreshShelf();
  expect(names()).toEqual(["Night", "Studio"]);
  expect([thumbnailOf('"s"'), thumbnailOf('"n"')]).toEqual(["/api/looks/Studio/thumbnail.webp?version=s", null]);
});

test("the thumbnail of a look goes along when it is renamed, and is there when it comes back", async () => {
  const sent: string[] = [];
  vi.stubGlobal("fetch", (path: string, init: RequestInit = {}) => {
    if (path.endsWith("/thumbnail")) sent.push(`${path} ${String(init.body)}`);
    if (path.includes(".webp")) return Promise.resolve(new Response(new Uint8Array([1, 2, 3])));
    return Promise.resolve(new Response(init.method === "DELETE" ? null : saved(path), { headers: { etag: '"1"' } }));
  });
  showThumbnail('"1"', "/api/looks/Old/thumbnail.webp?version=1");
  await exchange(old, { name: "New", look: LOOK });
  const picture = '{"picture":"data:image/webp;base64,AQID"}';
  expect(sent).toEqual([`/api/looks/New/thumbnail ${picture}`]);
  await exchange({ name: "New", look: LOOK, created: "1" }, null);
  await exchange(null, { name: "New", look: LOOK, created: "1" });
  expect(sent).toEqual([`/api/looks/New/thumbnail ${picture}`, `/api/looks/New/thumbnail ${picture}`]);
});

test("a look is called otherwise than those of other scenes, which are not shown", async () => {
  const entries = ["Old", "Look 2", "Look 3"].map((name) => ({ name }));
  vi.stubGlobal("fetch", () => Promise.resolve(new Response(JSON.stringify(entries))));
  expect(await unusedName()).toBe("Look 4");
});

test("a name that is taken is said to be, not that somebody changed it", async () => {
  vi.stubGlobal("fetch", () => Promise.resolve(new Response("{}", { status: 412 })));
  await expect(exchange(old, { name: "Taken", look: LOOK })).rejects.toThrow("There is a look called “Taken” already");
  await expect(exchange(old, { ...old, look: { ...LOOK, lights: {} } })).rejects.toThrow("was changed elsewhere");
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
  const renaming = renameLook(shelf.value[0] as SavedLook, "New");
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
