import { beforeEach, expect, test, vi } from "vitest";
import { freeCameraOf, currentCameras } from "../src/viewport/cameras/freeCamera";
import { rotateOrbit } from "../src/viewport/cameras/orbit";
import { sideA, swapWithA } from "../src/panels/looks/abCompare";
import { bake } from "../src/state/bakes";
import { look } from "../src/state/look";
import { shownViews, activeViewName, views } from "../src/state/views";
import { LOOK } from "./exampleLook";

const FIRST = { to_world: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 4, 0, 0, 0, 1], yfov: Math.PI / 6 };

beforeEach(() => {
  vi.stubGlobal("window", { setTimeout: () => 0 });
  vi.stubGlobal("matchMedia", () => ({ matches: true })); // at once where it goes
  vi.stubGlobal("requestAnimationFrame", (step: (now: number) => void) => (step(0), 0));
  vi.stubGlobal("cancelAnimationFrame", () => undefined);
  bake.value = "b".repeat(16);
  look.value = LOOK;
  views.value = [{ name: "front", width: 4, height: 3, camera: FIRST, camera_mode: "free" }] as unknown as typeof views.value;
  shownViews.value = ["front"];
  activeViewName.value = "front";
});

test("a swap also exchanges the cameras, and a second swap restores everything", () => {
  const freeCamera = freeCameraOf("front") as NonNullable<ReturnType<typeof freeCameraOf>>;
  const before = currentCameras();
  sideA.value = { look: LOOK, label: "kept", cameras: before };
  freeCamera.change((orbit) => rotateOrbit(orbit, 0.5, 0.2));
  freeCamera.resize([30, 60]);
  const after = currentCameras();
  const near = (expected: typeof before) => {
    const { poses, sizes } = currentCameras();
    expect(sizes).toEqual(expected.sizes);
    expected.poses.front?.to_world.forEach((value, k) => expect(poses.front?.to_world[k]).toBeCloseTo(value, 6));
  };
  for (const [live, stored] of [
    [before, after],
    [after, before],
  ] as const) {
    swapWithA();
    near(live);
    expect(sideA.value.cameras.sizes).toEqual(stored.sizes);
  }
});
