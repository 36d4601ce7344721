import { describe, expect, test } from "vitest";
import { luminance } from "../src/render/color/tonemap";
import { emissionForWatts, LUMENS_PER_WATT, quantitiesOf, wattsOf } from "../src/panels/lights/power";
import { planckian } from "../src/render/color/planckian";
import { withKelvin, kelvinOf, rgbOfKelvin } from "../src/panels/lights/temperature";
import type { Light } from "../src/protocol";
import { parseFactor, stopsOf } from "../src/ui/stops";

const common = { intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1] } as const;
const light = (fields: object) => ({ ...common, ...fields }) as unknown as Light;

/** Power of a spot by adding up directions, with the falloff that images have. */
function addedUp([full, edge]: [number, number], steps = 20_000): number {
  const [cosFull, cosEdge] = [full, edge].map((angle) => Math.cos((angle * Math.PI) / 180)) as [number, number];
  let sum = 0;
  for (let k = 0; k < steps; k += 1) {
    const cos = -1 + (2 * (k + 0.5)) / steps;
    const ramp = Math.min(1, Math.max(0, (cos - cosEdge) / (cosFull - cosEdge)));
    sum += ramp * ramp;
  }
  return (4 * Math.PI * sum) / steps;
}

describe("the power of a light", () => {
  test("is what it sends into all directions", () => {
    expect(wattsOf(light({ kind: "point" }))).toBeCloseTo(4 * Math.PI, 6);
    expect(wattsOf(light({ kind: "rectangle", size: [2, 0.5] }))).toBeCloseTo(Math.PI, 6);
    expect(wattsOf(light({ kind: "disc", radius: 2 }))).toBeCloseTo(4 * Math.PI ** 2, 6);
    expect(wattsOf(light({ kind: "sphere", radius: 2 }))).toBeCloseTo(16 * Math.PI ** 2, 6);
    expect(wattsOf(light({ kind: "tube", radius: 2, length: 3 }))).toBeCloseTo(12 * Math.PI ** 2, 6);
    for (const cone of [
      [20, 30],
      [0, 90],
      [5, 60],
    ] as [number, number][])
      expect(wattsOf(light({ kind: "spot", cone }))).toBeCloseTo(addedUp(cone), 2);
  });

  test("counts intensity and tint, and luminance alone", () => {
    expect(wattsOf(light({ kind: "directional", intensity: 3, color: [0, 1, 0] }))).toBeCloseTo(
      3 * luminance([0, 1, 0]),
      9,
    );
    expect(quantitiesOf(light({ kind: "directional" })).map(({ lumens }) => lumens)).toEqual(["lx"]);
  });

  test("a bulb of 806 lumens has them after they were typed", () => {
    const bulb = light({ kind: "point", emission: [3, 2, 1], intensity: 0.5 });
    const emission = emissionForWatts(bulb, 806 / LUMENS_PER_WATT);
    expect(LUMENS_PER_WATT * wattsOf({ ...bulb, emission } as Light)).toBeCloseTo(806, 2);
    expect((emission?.[0] ?? 0) / (emission?.[2] ?? 1)).toBeCloseTo(3, 4); // the same color
  });

  test("a dark light becomes white, one that is turned down to nothing stays as it is", () => {
    expect(emissionForWatts(light({ kind: "directional", emission: [0, 0, 0] }), 2)).toEqual([2, 2, 2]);
    expect(emissionForWatts(light({ kind: "point", intensity: 0 }), 2)).toBeNull();
  });
});

test("area lights have nits beside lumens, whatever their kind and size", () => {
  for (const fields of [
    { kind: "rectangle", size: [2, 0.5] },
    { kind: "disc", radius: 0.3 },
    { kind: "sphere", radius: 0.3 },
    { kind: "tube", radius: 0.02, length: 1.2 },
  ]) {
    const panel = light({ ...fields, emission: [3, 3, 3], intensity: 2 });
    const [power, luminanceOf] = quantitiesOf(panel);
    expect([power?.lumens, luminanceOf?.lumens]).toEqual(["lm", "cd/m²"]);
    const perWatt = luminanceOf?.perWatt ?? 0;
    expect(LUMENS_PER_WATT * perWatt * wattsOf(panel)).toBeCloseTo(683 * 6, 6);
    const emission = emissionForWatts(panel, 1000 / LUMENS_PER_WATT / perWatt); // 1,000 nits typed
    expect((emission?.[1] ?? 0) * 2 * LUMENS_PER_WATT).toBeCloseTo(1000, 1);
  }
  expect(quantitiesOf(light({ kind: "mesh", material: "Panel" })).map(({ lumens }) => lumens)).toEqual(["cd/m²"]);
});

test("factors are typed in stops", () => {
  expect(["+1 EV", "-2ev", "\u22120.5 EV", "0 EV", "3", "1,5"].map(parseFactor)).toEqual([
    2, 0.25, 0.707107, 1, 3, 1.5,
  ]);
  expect(["EV", "x EV", "", "1 stop"].map(parseFactor)).toEqual([null, null, null, null]);
  expect(stopsOf(8)).toBe(3);
});

describe("the temperature of a light", () => {
  test("has the chromaticities of the tables", () => {
    // illuminant A, and the black body at 6,500 K
    for (const [kelvin, x, y] of [
      [2856, 0.4476, 0.4074],
      [6500, 0.3135, 0.3237],
    ] as const) {
      const [u, v] = planckian(kelvin);
      const scale = 2 * u - 8 * v + 4;
      expect((3 * u) / scale).toBeCloseTo(x, 3);
      expect((2 * v) / scale).toBeCloseTo(y, 3);
    }
  });

  test("of white is that of daylight, and of a glowing body its own", () => {
    expect(Math.abs(kelvinOf([1, 1, 1]).kelvin - 6500)).toBeLessThan(60);
    for (const kelvin of [2000, 2700, 4000, 6500, 10_000, 14_000])
      expect(Math.abs(kelvinOf(rgbOfKelvin(kelvin)).kelvin / kelvin - 1)).toBeLessThan(0.01);
    expect(kelvinOf(rgbOfKelvin(3000)).isColored).toBe(false);
    expect(kelvinOf([0, 1, 0]).isColored).toBe(true);
  });

  test("changes the color of a light, not how bright it is", () => {
    const warm = withKelvin([5, 5, 5], 2700);
    expect(luminance(warm)).toBeCloseTo(5, 4);
    expect(warm[0]).toBeGreaterThan(2 * warm[2]);
  });
});
