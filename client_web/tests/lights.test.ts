import { describe, expect, test } from "vitest";
import { stepName } from "../src/edit/step";
import { cameraOf, project, pushed, slid } from "../src/lights/camera";
import { anglesOf, numbersOf } from "../src/lights/fields";
import { acrossOf, aimed, anchorsOf, moved, outlineOf, placed } from "../src/lights/handleGeometry";
import { beside, completedLight, freeLightName, lightFor, withKind } from "../src/lights/kinds";
import { add, cross, dot, length, subtract, unit } from "../src/lights/vector";
import type { Light, Triple } from "../src/protocol";
import { seenPaths, wholeOf, withSeenPaths } from "../src/seen/paths";
import { seenOf } from "../src/seen/rendered";
import { ENVIRONMENT, soloLight, sourcesAlone } from "../src/seen/solo";
import { LOOK } from "./look";

// at (0, 1, 5), looking along −Z, 90° high, twice as wide as high
const camera = cameraOf({
  name: "front",
  width: 200,
  height: 100,
  eye: "baked",
  bounds: null,
  camera: { to_world: [1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1, 5, 0, 0, 0, 1], yfov: Math.PI / 2 },
});
const close = (a: readonly number[], b: readonly number[]) => a.forEach((v, i) => expect(v).toBeCloseTo(b[i] as number, 9));
const common = { scale: 1, color: [1, 1, 1], on: true, emission: [1, 1, 1] } as const;
const spot = { kind: "spot", ...common, position: [0, 2, 0], direction: [0, -2, 0], cone: [20, 45] } as unknown as Light;
const sun = { kind: "directional", ...common, direction: [0, -1, 0] } as unknown as Light;

describe("a point in the picture", () => {
  test("is where the camera sees it", () => {
    expect(project(camera, [0, 1, 0])).toEqual({ u: 0.5, v: 0.5, depth: 5 });
    const corner = project(camera, [10, 6, 0]);
    close([corner?.u ?? NaN, corner?.v ?? NaN], [1, 0]);
    expect(project(camera, [0, 1, 6])).toBeNull();
  });

  test("follows the hand across the picture, and stays in its line of sight when pushed", () => {
    const point: Triple = [1, 2, -3];
    const before = project(camera, point);
    const after = project(camera, slid(camera, point, 0.1, -0.2));
    close([after?.u ?? 0, after?.v ?? 0, after?.depth ?? 0], [(before?.u ?? 0) + 0.1, (before?.v ?? 0) - 0.2, 8]);
    const far = project(camera, pushed(camera, point, 1.5));
    close([far?.u ?? 0, far?.v ?? 0, far?.depth ?? 0], [before?.u ?? 0, before?.v ?? 0, 12]);
  });
});

describe("handles", () => {
  test("a spot moves without turning, and turns without moving", () => {
    expect(anchorsOf(spot, camera)).toEqual({ at: [0, 2, 0], target: [0, 0, 0] });
    expect(moved(spot, [1, 2.00001, 0], camera, false)).toEqual({ position: [1, 2, 0] });
    expect(aimed(spot, [1, 0, 0])).toEqual({ direction: [1, -2, 0] });
    expect(aimed(spot, [0, 2, 0])).toBeNull();
  });

  test("a spot whose aim is locked goes on aiming at the same point", () => {
    expect(moved(spot, [1, 1, 0], camera, true)).toEqual({ position: [1, 1, 0], direction: [-1, -1, 0] });
    expect(placed(spot, [3, 0, 4], true)).toEqual({ position: [3, 0, 4], direction: [-3, 0, -4] });
    expect(placed(spot, [0, 0, 0], true)).toBeNull(); // there it would aim nowhere
    expect(placed({ ...spot, kind: "point" } as Light, [0, 0, 0], true)).toEqual({ position: [0, 0, 0] });
  });

  test("a sun's handle stands where its light comes from", () => {
    const at = anchorsOf(sun, camera);
    close(unit(subtract(at?.at as Triple, at?.target as Triple)), [0, 1, 0]);
    const to = add(at?.target as Triple, [3, 0, 0]);
    expect(moved(sun, to, camera, true)).toEqual({ direction: [-1, 0, 0] });
    expect(moved(sun, at?.target as Triple, camera, true)).toBeNull();
  });

  test("a rectangle's height lies in the plane of its direction and up, turned by its rotation", () => {
    const [width, height] = acrossOf([0, 0, -3], 0);
    close(height, [0, 1, 0]);
    for (const direction of [[0, -1, 0], [1, -2, 0.5]] as Triple[]) {
      const [w, h] = acrossOf(direction, 30);
      close([dot(w, h), dot(w, direction), dot(h, direction), length(w), length(h)], [0, 0, 0, 1, 1]);
    }
    close(acrossOf([0, 0, -3], 90)[0].map(Math.abs), height.map(Math.abs));
    expect(length(cross(width, height))).toBeCloseTo(1, 9);
  });

  test("outlines are as large as what they stand for", () => {
    const panel = { kind: "rectangle", ...common, position: [0, 1, 0], direction: [0, -1, 0], rotation: 0, size: [2, 1] };
    const [a, b, c] = outlineOf(panel as unknown as Light) as [Triple, Triple, Triple];
    expect([length(subtract(a, b)), length(subtract(b, c))]).toEqual([2, 1]);
    for (const point of outlineOf(spot)) expect(length(point)).toBeCloseTo(2, 9); // 45° from 2 m above
  });
});

describe("a new light", () => {
  const clicked = { position: [0, 0, 0], normal: [0, 1, 0], distance: 5, radiance: 0.5 } as const;
  const on = (kind: Parameters<typeof lightFor>[0]) =>
    lightFor(kind, { ...clicked, position: [...clicked.position], normal: [...clicked.normal] });

  test("stands off the surface and shines on it", () => {
    for (const kind of ["spot", "rectangle"] as const) {
      expect(on(kind)).toMatchObject({ kind, position: [0, 1, 0], direction: [0, -1, 0], on: true });
    }
    expect(on("point")).toMatchObject({ position: [0, 1, 0], emission: [3, 3, 3] });
    expect(on("directional")).toMatchObject({ direction: [0, -1, 0] });
  });

  test("a panel beside a low object stands no lower than what was clicked, and one under a ceiling hangs", () => {
    const panel = (normal: Triple) => lightFor("rectangle", { position: [0, 0.03, 0], normal, distance: 5, radiance: 0.5 });
    const lowest = (light: Light) => Math.min(...outlineOf(light).map(([, y]) => y));
    expect(lowest(panel([0, 0, 1]))).toBeGreaterThan(0.02);
    expect(lowest(panel([0.6, 0, 0.8]))).toBeGreaterThan(0.02);
    expect(panel([0, -1, 0])).toMatchObject({ position: [0, -0.97, 0] });
  });

  test("gives the same irradiance whatever its kind", () => {
    const panel = on("rectangle") as Extract<Light, { kind: "rectangle" }>;
    expect(panel.emission[0] * panel.size[0] * panel.size[1]).toBeCloseTo(3, 1);
  });

  test("has a name of its own", () => {
    expect(freeLightName("Spot", [])).toBe("Spot");
    expect(freeLightName("Spot", ["Spot", "Spot 2"])).toBe("Spot 3");
    expect(freeLightName("Key 2", ["Key 2"])).toBe("Key 3");
    expect(freeLightName("Key 2", ["Key", "Key 2", "Key 3"])).toBe("Key 4");
  });

  test("that is a copy stands beside what it copies and is the same otherwise", () => {
    expect(beside(spot)).toEqual({ ...spot, position: [0.5, 2, 0] });
    expect(beside(sun)).toEqual(sun);
  });

  test("keeps as another kind what both have", () => {
    expect(withKind(spot, "point")).toEqual({ kind: "point", ...common, position: [0, 2, 0] });
    expect(withKind(sun, "spot")).toMatchObject({ direction: [0, -1, 0], cone: [20, 30], position: [0, 1, 0] });
  });
});

describe("the inspector's fields", () => {
  const labels = (light: Light) => [...numbersOf(light), ...anglesOf(light)].map(({ label }) => label);

  test("are those that the kind has", () => {
    expect(labels(spot)).toEqual(["Position", "Direction", "Cone, full light", "Cone, edge"]);
    expect(labels(sun)).toEqual(["Direction"]);
  });

  test("of a cone push each other, so that the edge never lies within", () => {
    const [inner, edge] = anglesOf(spot);
    expect(inner?.changed(spot, 60)).toEqual([60, 60]);
    expect(edge?.changed(spot, 10)).toEqual([10, 10]);
    expect([inner?.read(spot), edge?.read(spot)]).toEqual([20, 45]);
  });

  test("refuse a direction without length", () => {
    const direction = numbersOf(sun)[0];
    expect([direction?.allows?.([0, 0, 0]), direction?.allows?.([0, 0, 1])]).toEqual([false, true]);
  });
});

test("a saved look may say only what it changes of a light", () => {
  expect(completedLight({ scale: 2 }, spot)).toEqual({ ...spot, scale: 2 });
  expect(completedLight({ kind: "point" }, spot)).toEqual({ kind: "point", ...common, position: [0, 1, 0] });
});

describe("one light alone", () => {
  const lit = { ...LOOK, lights: { Spot: { ...spot, on: false }, Sun: sun } };

  test("shines, the others and the environment do not", () => {
    soloLight.value = "Spot";
    const alone = seenOf(lit);
    expect([alone.lights["Spot"]?.on, alone.lights["Sun"]?.on, alone.environment.scale]).toEqual([true, false, 0]);
    expect(sourcesAlone(lit)).toEqual(["Spot"]);
    soloLight.value = ENVIRONMENT;
    expect(seenOf(lit).environment).toBe(lit.environment);
    expect(sourcesAlone(lit)).toEqual(["environment"]);
  });

  test("is no other look where there is no such light", () => {
    soloLight.value = "gone";
    expect(seenOf(lit)).toBe(lit);
    expect(sourcesAlone(lit)).toBeNull();
    soloLight.value = null;
    expect(seenOf(lit)).toBe(lit);
  });

  test("is seen by some light paths, which the look does not take up", () => {
    seenPaths.value = { show: "direct", bounces: 3 };
    const seen = withSeenPaths(lit);
    expect(seen.transport).toEqual({ show: "direct", bounces: 3 });
    expect(seen.lights).toBe(lit.lights);
    expect(wholeOf(seen)).toBe(lit);
    seenPaths.value = null;
  });
});

test("a light's step names the light", () => {
  expect(stepName("/lights/Desk ~1 lamp/position", "Move", LOOK, [])).toBe("Desk / lamp · Move");
});
