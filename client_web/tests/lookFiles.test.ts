import { beforeEach, expect, test, vi } from "vitest";
import { history } from "../src/edit/history";
import { applyLookFile, readLookFile } from "../src/panels/looks/lookFiles";
import { bake } from "../src/state/bakes";
import { defaultLook, look } from "../src/state/look";
import { LOOK } from "./exampleLook";

const MIX = { format: "relume light mix", version: 1, lights: { Key: { intensity: 0.3 } } };

beforeEach(() => {
  vi.stubGlobal("window", globalThis);
  history.clear();
  defaultLook.value = LOOK;
  look.value = LOOK;
  bake.value = "b";
});

test("the server applies a light mix to the current look, in one step", async () => {
  const mixed = { ...LOOK, environment: { ...LOOK.environment, intensity: 0.375 } };
  const sent: [string, unknown][] = [];
  vi.stubGlobal("fetch", (path: string, init: RequestInit) => {
    sent.push([path, JSON.parse(init.body as string)]);
    return Promise.resolve(Response.json({ look: mixed, warnings: ["No light “Key”."] }));
  });
  await applyLookFile(new File([JSON.stringify(MIX)], "dim.json"));
  expect(sent).toEqual([["./api/bakes/b/light-mix", { look: LOOK, mix: MIX }]]);
  expect(look.value).toEqual(mixed);
  expect(history.steps.value.map(({ label }) => label)).toEqual(["dim"]);
});

test("a partial look is completed by the scene's own", async () => {
  await applyLookFile(new File([JSON.stringify({ display: { exposure: 2 } })], "bright.json"));
  expect(look.value).toEqual({ ...LOOK, display: { ...LOOK.display, exposure: 2 } });
});

test.each([
  ["{", "not JSON"],
  ["[]", "neither a look nor a light mix"],
  ["null", "neither a look nor a light mix"],
  ['{"nodes": {}}', "neither a look nor a light mix"],
  ['{"lights": 3}', "neither a look nor a light mix"],
])("%s is rejected", (text, reason) => {
  expect(() => readLookFile(text)).toThrow(reason);
});
