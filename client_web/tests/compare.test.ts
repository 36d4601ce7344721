import { beforeEach, expect, test, vi } from "vitest";
import { eyeOf, seenNow } from "../src/cameras/eye";
import { turned } from "../src/cameras/orbit";
import { sideA, swapA } from "../src/looks/compare";
import { bake } from "../src/state/bakes";
import { look } from "../src/state/look";
import { shownViews, viewName, views } from "../src/state/views";
import { LOOK } from "./look";

const FIRST = { to_world: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 4, 0, 0, 0, 1], yfov: Math.PI / 6 };

beforeEach(() => {
  vi.stubGlobal("window", { setTimeout: () => 0 });
  vi.stubGlobal("matchMedia", () => ({ matches: true })); // at once where it goes
  vi.stubGlobal("requestAnimationFrame", (step: (now: number) => void) => (step(0), 0));
  vi.stubGlobal("cancelAnimationFrame", () => undefined);
  bake.value = "b".repeat(16);
  look.value = LOOK;
  views.value = [{ name: "front", width: 4, height: 3, camera: FIRST, eye: "free" }] as unknown as typeof views.value;
  shownViews.value = ["front"];
  viewName.value = "front";
});

test("a swap exchanges where A and the live picture are seen from, too, and twice is as it was", () => {
  const eye = eyeOf("front") as NonNullable<ReturnType<typeof eyeOf>>;
  const before = seenNow();
  sideA.value = { look: LOOK, label: "kept", seen: before };
  eye.change((orbit) => turned(orbit, 0.5, 0.2));
  eye.resize([30, 60]);
  const after = seenNow();
  const near = (wanted: typeof before) => {
    const { eyes, sizes } = seenNow();
    expect(sizes).toEqual(wanted.sizes);
    wanted.eyes.front?.to_world.forEach((value, k) => expect(eyes.front?.to_world[k]).toBeCloseTo(value, 6));
  };
  for (const [live, kept] of [
    [before, after],
    [after, before],
  ]) {
    swapA();
    near(live as typeof before);
    expect(sideA.value?.seen.sizes).toEqual(kept?.sizes);
  }
});
