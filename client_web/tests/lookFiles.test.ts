import { beforeEach, expect, test } from "vitest";
import { readLookFile, withLightMix } from "../src/panels/looks/lookFiles";
import type { Look } from "../src/protocol";
import { defaultLook } from "../src/state/look";
import { LOOK } from "./exampleLook";

const BASE = { intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1] };
const CURRENT = {
  ...LOOK,
  lights: {
    Key: { kind: "point", position: [1, 2, 3], ...BASE },
    Sun: { kind: "directional", direction: [0, -1, 0], ...BASE },
  },
} as unknown as Look;
const VALUES = { intensity: 0.3, color: [1, 0.5, 0.25], enabled: false, emission: [3, 2, 1] };
const MIX = {
  format: "relume light mix",
  version: 1,
  kinds: { Key: "point", Sun: "spot", Fill: "spot" },
  lights: { Key: VALUES, Sun: VALUES, Fill: VALUES },
  environment: { intensity: 2, color: [1, 1, 0.5], rotation: 90, map: "studio" },
};

beforeEach(() => {
  defaultLook.value = LOOK;
});

test("a light mix sets lights by name, leaves materials and positions alone, and says what is missing", () => {
  const { look, notes } = readLookFile(CURRENT, JSON.stringify(MIX));
  expect(look.materials).toBe(CURRENT.materials);
  expect(look.lights["Key"]).toEqual({ kind: "point", position: [1, 2, 3], ...VALUES });
  expect(look.lights["Sun"]).toEqual({ ...CURRENT.lights["Sun"], ...VALUES, emission: [1, 1, 1] });
  expect(Object.keys(look.lights)).toEqual(["Key", "Sun"]);
  expect(look.environment).toEqual(MIX.environment);
  expect(notes).toEqual([
    "This look has no lights “Fill”; the others are set.",
    "Lights of another kind keep their emission: “Sun”.",
  ]);
});

test("a light named as a part of objects is not there", () => {
  const { look, notes } = withLightMix(CURRENT, { ...MIX, lights: { toString: VALUES } });
  expect(look.lights).toEqual(CURRENT.lights);
  expect(notes).toEqual(["This look has no lights “toString”; the others are set."]);
});

test("a partial look is completed by the scene's own", () => {
  const { look } = readLookFile(CURRENT, JSON.stringify({ display: { exposure: 2 } }));
  expect(look).toEqual({ ...LOOK, display: { ...LOOK.display, exposure: 2 } });
});

test.each([
  ["{", "not JSON"],
  ["[]", "neither a look nor a light mix"],
  ["null", "neither a look nor a light mix"],
  ['{"nodes": {}}', "neither a look nor a light mix"],
  ['{"lights": 3}', "neither a look nor a light mix"],
  [JSON.stringify({ ...MIX, version: 2 }), "another version"],
])("%s is rejected", (text, reason) => {
  expect(() => readLookFile(CURRENT, text)).toThrow(reason);
});
