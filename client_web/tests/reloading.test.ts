/** What the server works on outlives a reload of the page, and a moment in which the server is away. */
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import type { RenderRequest } from "../src/protocol";

const REQUEST = { bake: "b".repeat(16), view: "front", looks: [{}], format: "exr" } as unknown as RenderRequest;
const storage = new Map<string, string>();
let posted: string[], saved: string[];
let answer: () => Response;

beforeEach(() => {
  vi.useFakeTimers();
  vi.resetModules();
  storage.clear();
  [posted, saved] = [[], []];
  vi.stubGlobal("sessionStorage", {
    getItem: (key: string) => storage.get(key) ?? null,
    setItem: (key: string, text: string) => storage.set(key, text),
    removeItem: (key: string) => storage.delete(key),
  });
  vi.stubGlobal("window", globalThis);
  vi.stubGlobal("document", {
    createElement: () => ({
      href: "",
      click() {
        saved.push(this.href);
      },
    }),
  });
  vi.stubGlobal("fetch", (path: string, init?: RequestInit) => {
    if (init?.method === "POST") posted.push(path);
    return new Promise((done) => setTimeout(done, 10)).then(() => answer());
  });
});

afterEach(() => vi.useRealTimers());

const state = (stateName: string) => () =>
  Response.json({
    id: "a",
    bake: REQUEST.bake,
    state: stateName,
    progress: 0.5,
    baking: null,
    seconds_left: 90,
    found: null,
  });
const away = () => {
  throw new TypeError("Failed to fetch");
};
/** The page as it is after a reload. */
const page = async () => {
  vi.resetModules();
  return { ...(await import("../src/panels/looks/renderJob")), ...(await import("../src/panels/compare/comparison")) };
};

test("a second press before the server has answered begins no second export", async () => {
  answer = state("running");
  const { renderAndSave } = await page();
  void renderAndSave("EXR", "frames/0", REQUEST, "");
  void renderAndSave("EXR", "frames/0", REQUEST, "");
  await vi.advanceTimersByTimeAsync(100);
  expect(posted).toEqual(["./api/renders"]);
});

test("a render that waits for a bake says so", async () => {
  answer = () =>
    Response.json({ id: "a", bake: "4k", state: "running", progress: 0, baking: 0.256, seconds_left: null });
  const { exporting, exportText, renderAndSave } = await page();
  void renderAndSave("Render", "archive.zip", REQUEST, "");
  await vi.advanceTimersByTimeAsync(100);
  expect(exporting.value && exportText(exporting.value)).toBe("Render: baking 25 %");
  answer = state("ready");
  await vi.advanceTimersByTimeAsync(1000);
  expect(saved).toEqual(["./api/renders/a/archive.zip"]);
});

test("an export goes on after a reload, and while the server is away; its file is saved once", async () => {
  answer = state("running");
  void (await page()).renderAndSave("turntable", "video.mp4", REQUEST, "");
  await vi.advanceTimersByTimeAsync(100);
  vi.clearAllTimers();
  const { exporting, exportText, resumeRendering } = await page();
  void resumeRendering();
  await vi.advanceTimersByTimeAsync(100);
  expect(exporting.value && exportText(exporting.value)).toBe("turntable 50 %, 2 min left");
  answer = away;
  await vi.advanceTimersByTimeAsync(2000);
  expect(exporting.value?.progress).toBe(0.5);
  answer = state("ready");
  await vi.advanceTimersByTimeAsync(1000);
  expect(exporting.value).toBeNull();
  expect(saved).toEqual(["./api/renders/a/video.mp4"]);
  void (await page()).resumeRendering();
  await vi.advanceTimersByTimeAsync(1000);
  expect(saved).toHaveLength(1);
});

test("an export that was stopped is not gone on with, and another may begin at once", async () => {
  answer = state("running");
  const { exporting, renderAndSave } = await page();
  void renderAndSave("EXR", "frames/0", REQUEST, "");
  await vi.advanceTimersByTimeAsync(100);
  exporting.value?.stop?.();
  expect([exporting.value, storage.size]).toEqual([null, 0]);
  void renderAndSave("EXR", "frames/0", REQUEST, "");
  await vi.advanceTimersByTimeAsync(1000);
  expect(posted).toHaveLength(2);
  expect(exporting.value?.exportName).toBe("EXR");
});

test("a comparison goes on after a reload, and while the server is away", async () => {
  answer = state("running");
  storage.set("relume.comparison", JSON.stringify({ id: "a", look: "of then" }));
  const { loadComparison, activeComparison } = await page();
  void loadComparison(REQUEST.bake);
  await vi.advanceTimersByTimeAsync(100);
  expect(activeComparison.value?.look).toBe("of then");
  answer = away;
  await vi.advanceTimersByTimeAsync(3000);
  answer = state("ready");
  await vi.advanceTimersByTimeAsync(2000);
  expect(activeComparison.value?.body.state).toBe("ready");
});

test("a comparison of a bake that is not shown any more is given up", async () => {
  answer = state("running");
  storage.set("relume.comparison", JSON.stringify({ id: "a", look: "of then" }));
  const { loadComparison, activeComparison } = await page();
  void loadComparison("another");
  await vi.advanceTimersByTimeAsync(100);
  expect([activeComparison.value, storage.size]).toEqual([null, 0]);
});
