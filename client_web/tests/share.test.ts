import { beforeEach, expect, test, vi } from "vitest";
import { freeCameraOf } from "../src/viewport/cameras/freeCamera";
import { openShare, copyShareLink } from "../src/panels/looks/shareLink";
import type { ShareBody, ShareRequest } from "../src/protocol";
import { pathOverride } from "../src/state/visibility/lightPaths";
import { bake } from "../src/state/bakes";
import { look } from "../src/state/look";
import { shownViews, activeViewName, views } from "../src/state/views";
import { LOOK } from "./exampleLook";

vi.mock("../src/session/scene/openScene", () => ({
  openScene: (_scene: string, _place: unknown, _choice: unknown, onOpen: () => void) => {
    onOpen();
    return Promise.resolve();
  },
}));

const OF_THE_SERVER = { id: "a", created: "", scene: "s", missing: [] };
const PATHS = { show: "first_bounce", bounces: 24 } as const;
let saved: ShareRequest;

beforeEach(() => {
  bake.value = "b".repeat(16);
  look.value = LOOK;
  shownViews.value = ["front"];
  activeViewName.value = "front";
  vi.stubGlobal("window", { setTimeout: () => 0 });
  vi.stubGlobal("location", { href: "http://relume.example/" });
  vi.stubGlobal("navigator", { clipboard: { writeText: () => Promise.resolve() } });
  vi.stubGlobal("fetch", (_path: string, init?: RequestInit) => {
    if (init?.method !== "POST") {
      const body: ShareBody = {
        solo: null,
        solo_light: null,
        paths: null,
        cameras: {},
        sizes: {},
        ...saved,
        ...OF_THE_SERVER,
        look: LOOK,
      };
      return Promise.resolve(Response.json(body));
    }
    saved = JSON.parse(init.body as string) as ShareRequest;
    return Promise.resolve(Response.json({ id: "a", url: "/?share=a" }, { status: 201 }));
  });
});

test("a link carries what is looked at, and a visitor's own gives way to it", async () => {
  for (const [sent, visitors] of [
    [PATHS, null],
    [null, PATHS],
  ]) {
    pathOverride.value = sent ?? null;
    await copyShareLink();
    pathOverride.value = visitors ?? null;
    await openShare("a", { room: null, watch: null });
    expect(pathOverride.value).toEqual(sent);
  }
});

test("a link carries the cameras of free-camera views", async () => {
  const turned = { to_world: [0, 0, 1, 4, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 0, 1], yfov: Math.PI / 6 };
  const info = { name: "front", width: 4, height: 3, camera: turned };
  views.value = [
    { ...info, camera_mode: "free" },
    { ...info, name: "left", camera_mode: "fixed" },
  ] as unknown as typeof views.value;
  shownViews.value = ["front", "left"];
  await copyShareLink();
  expect(Object.keys(saved.cameras ?? {})).toEqual(["front"]);
  expect(saved.cameras?.front?.to_world).toEqual(turned.to_world);
  expect(saved.cameras?.front?.yfov).toBeCloseTo(30);
  expect(saved.sizes).toEqual({});
  vi.stubGlobal("requestAnimationFrame", () => 1);
  vi.stubGlobal("cancelAnimationFrame", () => undefined);
  freeCameraOf("front")?.resize([60, 90]);
  await copyShareLink();
  expect(saved.sizes).toEqual({ front: [60, 90] });
  freeCameraOf("front")?.resize(null);
  await openShare("a", { room: null, watch: null });
  await vi.waitFor(() => expect(freeCameraOf("front")?.customSize).toEqual([60, 90]));
});
