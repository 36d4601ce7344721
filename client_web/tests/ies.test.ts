import { expect, test } from "vitest";
import { DEFAULT_LIGHTS } from "../src/look.gen";
import { withIes } from "../src/panels/lights/iesFiles";
import { angleFieldsOf, numbersFieldsOf } from "../src/panels/lights/lightFields";
import { polarCurve } from "../src/panels/lights/polarPlot";
import { quantitiesOf, wattsOf } from "../src/panels/lights/power";

const profile = "ies:0123456789abcdef";

test("an IES file brings its intensity", () => {
  const light = withIes({ ...DEFAULT_LIGHTS.spot, cone: [10, 20] }, { profile, emission: 2.92825768 });
  expect(light).toEqual({ ...DEFAULT_LIGHTS.spot, cone: [10, 20], profile, emission: [2.92826, 2.92826, 2.92826] });
  expect(quantitiesOf(light)[0]).toMatchObject({ label: "Peak intensity", lumens: "cd" });
  expect(wattsOf({ ...light, intensity: 2 })).toBeCloseTo(2 * 2.92826, 5);
});

test("a plain light has no direction of an IES file", () => {
  const labels = (light: Parameters<typeof numbersFieldsOf>[0]) =>
    [...numbersFieldsOf(light), ...angleFieldsOf(light)].map(({ label }) => label);
  expect(labels(DEFAULT_LIGHTS.point)).toEqual(["Position"]);
  expect(labels({ ...DEFAULT_LIGHTS.point, profile })).toEqual(["Position", "Direction", "Rotation"]);
  expect(labels(DEFAULT_LIGHTS.spot)).toEqual(["Position", "Direction", "Inner cone", "Outer cone"]);
  const gobo = "image:0123456789abcdef";
  expect(labels({ ...DEFAULT_LIGHTS.spot, gobo })).toContain("Rotation");
  expect(quantitiesOf({ ...DEFAULT_LIGHTS.spot, gobo })[0]?.label).toBe("Peak intensity");
  expect(quantitiesOf(DEFAULT_LIGHTS.spot)[0]?.label).toBe("Power");
});

test("a polar curve starts at the nadir, goes up on the right and back on the left", () => {
  expect(polarCurve([1, 0.5, 0.25], [1, 0.5, 0.25])).toBe(
    "M0.0 40.0L20.0 0.0L0.0 -10.0L-0.0 -10.0L-20.0 0.0L0.0 40.0Z",
  );
});
