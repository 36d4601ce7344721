import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { followMakings, forgetMaking, importImages, isInTheMaking, makings, makingWords, stopMaking } from "../src/library/making";
import type { BtfWorkBody } from "../src/protocol";
import { libraryOpen } from "../src/state/panels";

const work = (id: string, changes: Partial<BtfWorkBody> = {}): BtfWorkBody => ({
  id,
  name: `Felt ${id}`,
  user: "",
  created: "2026-01-01T00:00:00+00:00",
  started: null,
  ended: null,
  geometry: null,
  state: "running",
  progress: 0.5,
  seconds_left: 90,
  material: null,
  problem: null,
  ...changes,
});

/** A server that answers lists one after another, the last one for ever, and notes what is asked of it. */
function serve(...lists: BtfWorkBody[][]): string[] {
  const asked: string[] = [];
  vi.stubGlobal("fetch", (path: string, init: RequestInit = {}) => {
    asked.push(`${init.method ?? "GET"} ${path}`);
    if (init.method === "DELETE") return Promise.resolve(new Response(null, { status: 204 }));
    const list = lists.length > 1 ? lists.shift() : lists[0];
    return Promise.resolve(new Response(JSON.stringify(list)));
  });
  return asked;
}

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal("window", globalThis); // notes go away by its clock
  libraryOpen.value = true;
  makings.value = [];
});

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

it("makes no second texture of a kind while one is made", () => {
  makings.value = [work("a", { geometry: "weave" }), work("b", { geometry: "pebbles", state: "stopped" })];
  expect([isInTheMaking("weave"), isInTheMaking("pebbles")]).toEqual([true, false]);
});

describe("textures in the making", () => {
  it("are followed until they are ready, and what is ready is taken from the list", async () => {
    const asked = serve([work("a"), work("b", { state: "queued" })], [work("a", { state: "ready" }), work("b")], []);
    const arrived = vi.fn(() => Promise.resolve());
    const followed = followMakings(arrived);
    await vi.advanceTimersByTimeAsync(0);
    expect(makings.value.map(({ id }) => id)).toEqual(["a", "b"]);
    expect(arrived).not.toHaveBeenCalled();
    await vi.advanceTimersByTimeAsync(1000);
    expect(arrived).toHaveBeenCalledOnce();
    expect(makings.value.map(({ id }) => id)).toEqual(["b"]);
    expect(asked).toContain("DELETE /api/materials/btf-works/a?forget=true");
    await vi.advanceTimersByTimeAsync(1000);
    await followed;
    expect(makings.value).toEqual([]);
  });

  it("are not asked for any more when the library is closed, nor twice at once", async () => {
    const asked = serve([work("a")]);
    const followed = followMakings(() => Promise.resolve());
    await followMakings(() => Promise.resolve());
    await vi.advanceTimersByTimeAsync(0);
    expect(asked).toHaveLength(1);
    libraryOpen.value = false;
    await vi.advanceTimersByTimeAsync(1000);
    await followed;
    expect(asked).toHaveLength(2);
  });

  it("can be stopped, twice, and removed", async () => {
    const asked = serve([]);
    makings.value = [work("a"), work("b")];
    await stopMaking("a");
    await stopMaking("b");
    expect(makings.value.map(({ state }) => state)).toEqual(["stopped", "stopped"]);
    await forgetMaking("a");
    expect(makings.value.map(({ id }) => id)).toEqual(["b"]);
    expect(asked).toEqual([
      "DELETE /api/materials/btf-works/a",
      "DELETE /api/materials/btf-works/b",
      "DELETE /api/materials/btf-works/a?forget=true",
    ]);
  });

  it("that somebody else has removed go from the list, twice", async () => {
    vi.stubGlobal("fetch", () => Promise.resolve(new Response("{}", { status: 404 })));
    makings.value = [work("a", { state: "failed" }), work("b", { state: "failed" })];
    await forgetMaking("a");
    await forgetMaking("b");
    expect(makings.value).toEqual([]);
  });

  it("that failed are forgotten when their file is sent again", async () => {
    const asked = serve([]);
    class Sent {
      status = 202;
      responseText = JSON.stringify(work("c", { name: "Felt" }));
      upload = {};
      onload = () => undefined;
      open = () => undefined;
      send = () => this.onload();
    }
    vi.stubGlobal("XMLHttpRequest", Sent);
    const failed = { state: "failed", name: "Felt" } as const;
    makings.value = [work("a", failed), work("b", { ...failed, geometry: "mesh" }), work("d", { name: "Felt" })];
    await importImages(new File([], "Felt.zip"));
    expect(makings.value.map(({ id }) => id)).toEqual(["b", "d"]);
    expect(asked).toEqual(["DELETE /api/materials/btf-works/a?forget=true"]);
  });

  it("say how far they are, and why they failed", () => {
    expect(makingWords(work("a"))).toContain("50 %");
    expect(makingWords(work("a", { seconds_left: null }))).toBe("50 %");
    expect(makingWords(work("a", { state: "failed", problem: "It is no zip." }))).toBe("It is no zip.");
  });
});
