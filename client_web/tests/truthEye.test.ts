import { beforeEach, expect, test, vi } from "vitest";
import { eyeOf } from "../src/cameras/eye";
import { turned } from "../src/cameras/orbit";
import type { TruthRequest } from "../src/protocol";
import { bake } from "../src/state/bakes";
import { look } from "../src/state/look";
import { viewName, views } from "../src/state/views";
import { askTruth, judged } from "../src/truth/truth";
import { LOOK } from "./look";

const FROM = { to_world: [0, 0, 1, 4, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 0, 1], yfov: Math.PI / 6 };
let asked: TruthRequest | null = null;

beforeEach(() => {
  bake.value = "b".repeat(16);
  look.value = LOOK;
  const seen = { width: 4, height: 3, camera: FROM };
  views.value = [{ ...seen, name: "front", eye: "free" }, { ...seen, name: "left", eye: "baked" }] as unknown as typeof views.value;
  vi.stubGlobal("requestAnimationFrame", () => 1);
  vi.stubGlobal("cancelAnimationFrame", () => undefined);
  vi.stubGlobal("fetch", (_path: string, init?: RequestInit) => {
    if (init?.method === "POST") asked = JSON.parse(init.body as string) as TruthRequest;
    return Promise.resolve(Response.json({ id: "a", state: "ready" }));
  });
});

async function askedOf(view: string): Promise<TruthRequest | null> {
  viewName.value = view;
  void askTruth();
  await vi.waitFor(() => expect(asked?.view).toBe(view));
  return asked;
}

test("a view whose eye moves is compared from where the eye is, any other as it was baked", async () => {
  eyeOf("front")?.resize([60, 90]);
  const { camera, size } = (await askedOf("front")) as TruthRequest;
  expect(camera?.to_world).toEqual(FROM.to_world);
  expect(camera?.yfov).toBeCloseTo(30);
  expect(size).toEqual([60, 90]);
  expect(await askedOf("left")).toMatchObject({ camera: null, size: null });
});

test("a comparison is of another picture once the eye has moved on, or the picture is of another size", () => {
  viewName.value = "front";
  const compared = judged();
  eyeOf("front")?.change((orbit) => turned(orbit, 0.3, 0));
  const moved = judged();
  expect(moved).not.toBe(compared);
  eyeOf("front")?.resize([30, 30]);
  expect(judged()).not.toBe(moved);
});
