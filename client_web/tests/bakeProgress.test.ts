import { describe, expect, test, vi } from "vitest";
import { cancelBake } from "../src/session/net/api";
import { bakeProgressText, hasProgress, phaseText } from "../src/session/scene/bakeStatus";
import type { BakeStatus } from "../src/state/bakes";

const running: BakeStatus = { id: "b", state: "running", progress: 0, phase: "tracing", seconds_left: null, problem: null };

describe("words of a bake", () => {
  test("what it does before it traces, and for how long", () => {
    expect(bakeProgressText({ ...running, phase: "compiling" }, 12.7)).toBe("compiling kernels (first run only), 12 s");
    expect(phaseText({ ...running, phase: "building" })).toBe("building the BVH");
    expect(hasProgress({ ...running, phase: "starting" })).toBe(false);
  });

  test("no time left without evidence", () => {
    expect(bakeProgressText({ ...running, progress: 0.034 }, 5)).toBe("baking, 3 %, estimating time…");
    expect(bakeProgressText({ ...running, progress: 0.5, seconds_left: 41.2 }, 5)).toBe("baking, 50 %, about 41 s left");
    expect(hasProgress(running)).toBe(true);
  });

  test("how many it waits for", () => {
    const queued: BakeStatus = { ...running, state: "queued", phase: null };
    expect(bakeProgressText({ ...queued, queue_position: 2 }, 0)).toBe("queued after 2 bakes");
    expect(bakeProgressText({ ...queued, queue_position: 1 }, 0)).toBe("queued after 1 bake");
    expect(bakeProgressText(queued, 0)).toBe("queued");
    expect(bakeProgressText({ ...queued, state: "failed" }, 0)).toBe("bake failed");
  });
});

test("a bake that has ended a moment before needs no cancelling; what else fails is said", async () => {
  const answers = [409, 503].map((status) => new Response(JSON.stringify({ detail: "no" }), { status }));
  vi.stubGlobal("fetch", async () => answers.shift());
  await expect(cancelBake("b")).resolves.toBeUndefined();
  await expect(cancelBake("b")).rejects.toThrow("no");
  vi.unstubAllGlobals();
});
