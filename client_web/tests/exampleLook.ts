/** A small look for tests. */
import { DEFAULTS } from "../src/look.gen";
import { changeValue } from "../src/state/document/jsonPatch";
import type { Look } from "../src/protocol";

export const LOOK: Look = {
  materials: {
    Teapot: {
      terms: [
        { model: "lambert", color: [0.1, 0.02, 0.02], params: {}, curves: {} },
        { model: "cook_torrance", color: [1, 1, 1], params: { sigma: 0.2, ior: 1.5 }, curves: {} },
      ],
    },
    "a/b~c": { terms: [{ model: "lambert", color: [0.5, 0.5, 0.5] }] },
  },
  environment: { map: null, intensity: 1, color: [1, 1, 1], rotation: 0 },
  background: { kind: "map", color: [0.5, 0.5, 0.5], blur: 10 },
  lights: {},
  light_groups: {},
  transport: { show: "all", bounces: 24 },
  display: DEFAULTS.display,
};

/** A look with another value at a pointer. */
export function lookWith(look: Look, path: string, value: unknown): Look {
  return changeValue(look, path, value).after;
}
