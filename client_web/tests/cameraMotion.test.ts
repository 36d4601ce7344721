/** Damped camera motion. */
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { CameraMotion } from "../src/viewport/cameras/cameraMotion";
import type { Orbit } from "../src/viewport/cameras/orbit";

const FIRST: Orbit = { target: [0, 0, 0], distance: 2, azimuth: 0, elevation: 0, roll: 0, yfov: 170, near: 0 };

let frames: ((now: number) => void)[] = [];

beforeEach(() => {
  frames = [];
  vi.stubGlobal("requestAnimationFrame", (step: (now: number) => void) => frames.push(step));
  vi.stubGlobal("performance", { now: () => 100 });
});

afterEach(() => vi.unstubAllGlobals());

test("a frame that began before the change does not move the camera backwards", () => {
  const shown: Orbit[] = [];
  const motion = new CameraMotion(
    FIRST,
    (orbit) => shown.push(orbit),
    () => false,
  );
  motion.change((orbit) => ({ ...orbit, yfov: 1, near: 3 }));
  for (const now of [97, 99, 120, 160, 500]) frames.shift()?.(now);
  expect(shown.length).toBe(5);
  for (const [index, { yfov, near }] of shown.entries()) {
    expect(yfov).toBeLessThanOrEqual(shown[index - 1]?.yfov ?? FIRST.yfov);
    expect(yfov).toBeGreaterThanOrEqual(1);
    expect(near).toBeGreaterThanOrEqual(shown[index - 1]?.near ?? FIRST.near);
  }
  expect(shown[1]).toEqual(FIRST);
  expect(shown[2]?.yfov).toBeCloseTo(1 + 169 * Math.exp(-20 / 70), 6);
});
