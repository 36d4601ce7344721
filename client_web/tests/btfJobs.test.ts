import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import {
  trackJobs,
  deleteJob,
  importImages,
  isBeingMade,
  btfJobs,
  jobText,
  stopJob,
} from "../src/panels/library/btfJobs";
import type { BtfJobBody } from "../src/protocol";
import { libraryOpen } from "../src/state/panels";

const work = (id: string, changes: Partial<BtfJobBody> = {}): BtfJobBody => ({
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
function serve(...lists: BtfJobBody[][]): string[] {
  const requests: string[] = [];
  vi.stubGlobal("fetch", (path: string, init: RequestInit = {}) => {
    requests.push(`${init.method ?? "GET"} ${path}`);
    if (init.method === "DELETE") return Promise.resolve(new Response(null, { status: 204 }));
    const list = lists.length > 1 ? lists.shift() : lists[0];
    return Promise.resolve(new Response(JSON.stringify(list)));
  });
  return requests;
}

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal("window", globalThis); // notes go away by its clock
  libraryOpen.value = true;
  btfJobs.value = [];
});

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

it("makes no second texture of a kind while one is made", () => {
  btfJobs.value = [work("a", { geometry: "weave" }), work("b", { geometry: "pebbles", state: "canceled" })];
  expect([isBeingMade("weave"), isBeingMade("pebbles")]).toEqual([true, false]);
});

describe("textures in the making", () => {
  it("are followed until they are ready, and what is ready is taken from the list", async () => {
    const requests = serve([work("a"), work("b", { state: "queued" })], [work("a", { state: "ready" }), work("b")], []);
    const finished = vi.fn(() => Promise.resolve());
    const followed = trackJobs(finished);
    await vi.advanceTimersByTimeAsync(0);
    expect(btfJobs.value.map(({ id }) => id)).toEqual(["a", "b"]);
    expect(finished).not.toHaveBeenCalled();
    await vi.advanceTimersByTimeAsync(1000);
    expect(finished).toHaveBeenCalledOnce();
    expect(btfJobs.value.map(({ id }) => id)).toEqual(["b"]);
    expect(requests).toContain("DELETE ./api/materials/btf/jobs/a?delete_files=true");
    await vi.advanceTimersByTimeAsync(1000);
    await followed;
    expect(btfJobs.value).toEqual([]);
  });

  it("are not asked for any more when the library is closed, nor twice at once", async () => {
    const requests = serve([work("a")]);
    const followed = trackJobs(() => Promise.resolve());
    await trackJobs(() => Promise.resolve());
    await vi.advanceTimersByTimeAsync(0);
    expect(requests).toHaveLength(1);
    libraryOpen.value = false;
    await vi.advanceTimersByTimeAsync(1000);
    await followed;
    expect(requests).toHaveLength(2);
  });

  it("can be stopped, twice, and removed", async () => {
    const requests = serve([]);
    btfJobs.value = [work("a"), work("b")];
    await stopJob("a");
    await stopJob("b");
    expect(btfJobs.value.map(({ state }) => state)).toEqual(["canceled", "canceled"]);
    await deleteJob("a");
    expect(btfJobs.value.map(({ id }) => id)).toEqual(["b"]);
    expect(requests).toEqual([
      "DELETE ./api/materials/btf/jobs/a",
      "DELETE ./api/materials/btf/jobs/b",
      "DELETE ./api/materials/btf/jobs/a?delete_files=true",
    ]);
  });

  it("that somebody else has removed go from the list, twice", async () => {
    vi.stubGlobal("fetch", () => Promise.resolve(new Response("{}", { status: 404 })));
    btfJobs.value = [work("a", { state: "failed" }), work("b", { state: "failed" })];
    await deleteJob("a");
    await deleteJob("b");
    expect(btfJobs.value).toEqual([]);
  });

  it("that failed are forgotten when their file is sent again", async () => {
    const requests = serve([]);
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
    btfJobs.value = [work("a", failed), work("b", { ...failed, geometry: "mesh" }), work("d", { name: "Felt" })];
    await importImages(new File([], "Felt.zip"));
    expect(btfJobs.value.map(({ id }) => id)).toEqual(["b", "d"]);
    expect(requests).toEqual(["DELETE ./api/materials/btf/jobs/a?delete_files=true"]);
  });

  it("say how far they are, and why they failed", () => {
    expect(jobText(work("a"))).toContain("50 %");
    expect(jobText(work("a", { seconds_left: null }))).toBe("50 %");
    expect(jobText(work("a", { state: "failed", problem: "It is no zip." }))).toBe("It is no zip.");
  });
});
