import { beforeEach, expect, test, vi } from "vitest";
import { freeCameraOf } from "../src/viewport/cameras/freeCamera";
import { rotateOrbit } from "../src/viewport/cameras/orbit";
import type { ComparisonRequest } from "../src/protocol";
import { bake } from "../src/state/bakes";
import { look } from "../src/state/look";
import { activeViewName, views } from "../src/state/views";
import { beginComparison, comparedState } from "../src/panels/compare/comparison";
import { LOOK } from "./exampleLook";

const FROM = { to_world: [0, 0, 1, 4, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 0, 1], yfov: Math.PI / 6 };
let request: ComparisonRequest | null = null;

beforeEach(() => {
  bake.value = "b".repeat(16);
  look.value = LOOK;
  const info = { width: 4, height: 3, camera: FROM };
  views.value = [
    { ...info, name: "front", camera_mode: "free" },
    { ...info, name: "left", camera_mode: "fixed" },
  ] as unknown as typeof views.value;
  vi.stubGlobal("requestAnimationFrame", () => 1);
  vi.stubGlobal("cancelAnimationFrame", () => undefined);
  vi.stubGlobal("fetch", (_path: string, init?: RequestInit) => {
    if (init?.method === "POST") request = JSON.parse(init.body as string) as ComparisonRequest;
    return Promise.resolve(Response.json({ id: "a", state: "ready" }));
  });
});

async function requestOf(view: string): Promise<ComparisonRequest | null> {
  activeViewName.value = view;
  void beginComparison();
  await vi.waitFor(() => expect(request?.view).toBe(view));
  return request;
}

test("a free-camera view is compared from its current camera, others as baked", async () => {
  freeCameraOf("front")?.resize([60, 90]);
  const { camera, size } = (await requestOf("front")) as ComparisonRequest;
  expect(camera?.to_world).toEqual(FROM.to_world);
  expect(camera?.yfov).toBeCloseTo(30);
  expect(size).toEqual([60, 90]);
  expect(await requestOf("left")).toMatchObject({ camera: null, size: null });
});

test("a comparison is outdated when the camera moves or the image size changes", () => {
  activeViewName.value = "front";
  const compared = comparedState();
  freeCameraOf("front")?.jump((orbit) => rotateOrbit(orbit, 0.3, 0));
  const moved = comparedState();
  expect(moved).not.toBe(compared);
  freeCameraOf("front")?.resize([30, 30]);
  expect(comparedState()).not.toBe(moved);
});
