import { describe, expect, test, vi } from "vitest";
import { cancelBake } from "../src/net/api";
import { bakingWords, hasProgress, phaseWords } from "../src/scene/baking";
import type { Baking } from "../src/state/bakes";

const running: Baking = { id: "b", state: "running", progress: 0, phase: "tracing", seconds_left: null, problem: null };

describe("words of a bake", () => {
  test("what it does before it traces, and for how long", () => {
    expect(bakingWords({ ...running, phase: "compiling" }, 12.7)).toBe("compiling kernels, once on this machine, 12 s");
    expect(phaseWords({ ...running, phase: "building" })).toBe("sorting its triangles");
    expect(hasProgress({ ...running, phase: "starting" })).toBe(false);
  });

  test("no time left without evidence", () => {
    expect(bakingWords({ ...running, progress: 0.034 }, 5)).toBe("baking, 3 %, estimating the time…");
    expect(bakingWords({ ...running, progress: 0.5, seconds_left: 41.2 }, 5)).toBe("baking, 50 %, about 41 s left");
    expect(hasProgress(running)).toBe(true);
  });

  test("how many it waits for", () => {
    const queued: Baking = { ...running, state: "queued", phase: null };
    expect(bakingWords({ ...queued, ahead: 2 }, 0)).toBe("waits for 2 bakes before it");
    expect(bakingWords({ ...queued, ahead: 1 }, 0)).toBe("waits for 1 bake before it");
    expect(bakingWords(queued, 0)).toBe("waits for its turn");
    expect(bakingWords({ ...queued, state: "failed" }, 0)).toBe("bake failed");
  });
});

test("a bake that has ended a moment before needs no cancelling; what else fails is said", async () => {
  const answers = [409, 503].map((status) => new Response(JSON.stringify({ detail: "no" }), { status }));
  vi.stubGlobal("fetch", async () => answers.shift());
  await expect(cancelBake("b")).resolves.toBeUndefined();
  await expect(cancelBake("b")).rejects.toThrow("no");
  vi.unstubAllGlobals();
});
