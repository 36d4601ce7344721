import { beforeEach, expect, test, vi } from "vitest";
import { history } from "../src/edit/history";
import { exchange, renameLook, shelf, unusedName } from "../src/looks/shelf";
import type { SavedLook } from "../src/looks/shelf";
import { undo } from "../src/looks/undo";
import { LOOK } from "./look";

let asked: string[];

beforeEach(() => {
  asked = [];
  shelf.value = [{ name: "Old", etag: '"1"', look: LOOK }];
  vi.stubGlobal("localStorage", { getItem: () => null, setItem: () => undefined });
  vi.stubGlobal("fetch", (path: string, init: RequestInit) => {
    const headers = new Headers(init.headers);
    asked.push(`${init.method} ${path} ${headers.get("if-match") ?? `none ${headers.get("if-none-match")}`}`);
    return Promise.resolve(new Response(init.method === "DELETE" ? null : "{}", { headers: { etag: '"2"' } }));
  });
});

const old = { name: "Old", look: LOOK };
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
  expect(asked).toEqual(["PUT /api/looks/New none *", 'DELETE /api/looks/Old "1"']);
  expect(names()).toEqual(["New"]);
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
  const answer = vi.fn((_: string, init: RequestInit) => {
    const response = () => new Response(init.method === "DELETE" ? null : "{}", { headers: { etag: '"2"' } });
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
