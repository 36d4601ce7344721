/** A material emits an image by a light: its own one, or one that is added and removed with the image. */
import { expect, test } from "vitest";
import { DEFAULT_LIGHTS, MAX_LIGHTS } from "../src/look.gen";
import { emittingLight, lightWithoutImage, meshLightOf } from "../src/panels/inspector/images/emission";
import type { Look } from "../src/protocol";

const POINT = DEFAULT_LIGHTS.point;
const OWN = {
  ...DEFAULT_LIGHTS.mesh,
  material: "Lamp",
  emission: [5, 4, 3] as [number, number, number],
  enabled: false,
};

test("a material without a light gets one with the first free name", () => {
  const lights: Look["lights"] = { Screen: POINT };
  const emitter = emittingLight(lights, "Screen", "image:a");
  expect(emitter).toEqual({
    name: "Screen 2",
    light: { ...DEFAULT_LIGHTS.mesh, material: "Screen", image: "image:a" },
  });
  expect(meshLightOf(lights, "Screen")).toBeNull();
});

test("a light of the scene emits the image, turned on, and its own emission afterwards", () => {
  const lights: Look["lights"] = { Key: POINT, Lamp: OWN };
  const emitter = emittingLight(lights, "Lamp", "image:a");
  expect(emitter).toEqual({ name: "Lamp", light: { ...OWN, image: "image:a", enabled: true } });
  if (emitter !== null) expect(lightWithoutImage(emitter, lights)).toEqual({ ...OWN, image: null, enabled: true });
});

test("a light that came with the image goes with it", () => {
  const emitter = emittingLight({}, "Screen", "image:a");
  expect(emitter && lightWithoutImage(emitter, {})).toBeUndefined();
});

test("a look full of lights takes no image, unless one of them is of the material", () => {
  const full: Look["lights"] = Object.fromEntries(
    Array.from({ length: MAX_LIGHTS - 1 }, (_, k) => [`Light ${k}`, POINT] as const),
  );
  expect(emittingLight({ ...full, Other: POINT }, "Screen", "image:a")).toBeNull();
  expect(emittingLight({ ...full, Lamp: OWN }, "Lamp", "image:a")?.name).toBe("Lamp");
});
