import { beforeEach, expect, test, vi } from "vitest";
import { exchange, shelf } from "../src/looks/shelf";
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
