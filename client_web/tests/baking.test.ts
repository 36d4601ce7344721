import { describe, expect, test } from "vitest";
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
