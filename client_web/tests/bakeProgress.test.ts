import { describe, expect, test, vi } from "vitest";
import { cancelBake } from "../src/session/net/api";
import { bakeProgressText, hasProgress, phaseText } from "../src/session/scene/bakeStatus";
import type { BakeStatus } from "../src/state/bakes";

const running: BakeStatus = { id: "b", state: "running", progress: 0, phase: "tracing", seconds_left: null, problem: null };

describe("progress text of a bake", () => {
  test("shows the phase and elapsed time before tracing", () => {
    expect(bakeProgressText({ ...running, phase: "compiling" }, 12.7)).toBe("compiling kernels (first run only), 12 s");
    expect(phaseText({ ...running, phase: "building" })).toBe("building the BVH");
    expect(hasProgress({ ...running, phase: "starting" })).toBe(false);
  });

  test("shows no remaining time without an estimate", () => {
    expect(bakeProgressText({ ...running, progress: 0.034 }, 5)).toBe("baking, 3 %, estimating time…");
    expect(bakeProgressText({ ...running, progress: 0.5, seconds_left: 41.2 }, 5)).toBe("baking, 50 %, about 41 s left");
    expect(hasProgress(running)).toBe(true);
  });

  test("shows the position in the queue", () => {
    const queued: BakeStatus = { ...running, state: "queued", phase: null };
    expect(bakeProgressText({ ...queued, queue_position: 2 }, 0)).toBe("queued after 2 bakes");
    expect(bakeProgressText({ ...queued, queue_position: 1 }, 0)).toBe("queued after 1 bake");
    expect(bakeProgressText(queued, 0)).toBe("queued");
    expect(bakeProgressText({ ...queued, state: "failed" }, 0)).toBe("bake failed");
  });
});

test("cancel ignores a bake that has just ended, and reports other failures", async () => {
  const answers = [409, 503].map((status) => new Response(JSON.stringify({ detail: "no" }), { status }));
  vi.stubGlobal("fetch", () => Promise.resolve(answers.shift()));
  await expect(cancelBake("b")).resolves.toBeUndefined();
  await expect(cancelBake("b")).rejects.toThrow("no");
  vi.unstubAllGlobals();
});
