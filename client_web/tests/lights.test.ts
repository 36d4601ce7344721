import { describe, expect, test } from "vitest";
import { DEFAULT_LIGHTS } from "../src/look.gen";
import { stepLabel } from "../src/edit/stepLabel";
import { projectionCameraOf, project, pushPoint, slidePoint } from "../src/panels/lights/lightProjection";
import { angleFieldsOf, numbersFieldsOf } from "../src/panels/lights/lightFields";
import {
  spotEdgePoint,
  aimLight,
  anchorsOf,
  moveLight,
  lightOutline,
  placeLight,
} from "../src/panels/lights/handleGeometry";
import { offsetCopy, completeLight, nextLightName, createLight, changeKind } from "../src/panels/lights/lightKinds";
import { add, cross, dot, length, subtract, normalize } from "../src/panels/lights/vector";
import type { Light, Triple } from "../src/protocol";
import { pathOverride, fullLookOf, withVisiblePaths } from "../src/state/visibility/lightPaths";
import { visibleLookOf } from "../src/state/visibility/displayState";
import { ENVIRONMENT_SOURCE, soloLight, soloSources } from "../src/state/visibility/soloSources";
import { LOOK } from "./exampleLook";

// at (0, 1, 5), looking along −Z, 90° high, twice as wide as high
const camera = projectionCameraOf({
  name: "front",
  width: 200,
  height: 100,
  camera_mode: "fixed",
  bounds: null,
  interior_camera: null,
  camera: { to_world: [1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1, 5, 0, 0, 0, 1], yfov: Math.PI / 2, near: 0 },
});
const close = (a: readonly number[], b: readonly number[]) =>
  a.forEach((v, i) => expect(v).toBeCloseTo(b[i] as number, 9));
const common = {
  intensity: 1,
  color: [1, 1, 1],
  enabled: true,
  emission: [1, 1, 1],
  link: null,
  shadow_link: null,
} as const;
const spot = {
  kind: "spot",
  ...common,
  position: [0, 2, 0],
  direction: [0, -2, 0],
  cone: [20, 45],
} as unknown as Light;
const sun = { kind: "directional", ...common, direction: [0, -1, 0], angle: 0 } as unknown as Light;

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
    const after = project(camera, slidePoint(camera, point, 0.1, -0.2));
    close([after?.u ?? 0, after?.v ?? 0, after?.depth ?? 0], [(before?.u ?? 0) + 0.1, (before?.v ?? 0) - 0.2, 8]);
    const far = project(camera, pushPoint(camera, point, 1.5));
    close([far?.u ?? 0, far?.v ?? 0, far?.depth ?? 0], [before?.u ?? 0, before?.v ?? 0, 12]);
  });
});

describe("handles", () => {
  test("a spot moves without turning, and turns without moving", () => {
    expect(anchorsOf(spot, camera)).toEqual({ position: [0, 2, 0], target: [0, 0, 0] });
    expect(moveLight(spot, [1, 2.00001, 0], camera, false)).toEqual({ position: [1, 2, 0] });
    expect(aimLight(spot, [1, 0, 0])).toEqual({ direction: [1, -2, 0] });
    expect(aimLight(spot, [0, 2, 0])).toBeNull();
  });

  test("a spot whose aim is locked goes on aiming at the same point", () => {
    expect(moveLight(spot, [1, 1, 0], camera, true)).toEqual({ position: [1, 1, 0], direction: [-1, -1, 0] });
    expect(placeLight(spot, [3, 0, 4], true)).toEqual({ position: [3, 0, 4], direction: [-3, 0, -4] });
    expect(placeLight(spot, [0, 0, 0], true)).toBeNull(); // there it would aim nowhere
    expect(placeLight({ ...spot, kind: "point" } as Light, [0, 0, 0], true)).toEqual({ position: [0, 0, 0] });
  });

  test("a sun's handle stands where its light comes from", () => {
    const at = anchorsOf(sun, camera);
    close(normalize(subtract(at?.position as Triple, at?.target as Triple)), [0, 1, 0]);
    const to = add(at?.target as Triple, [3, 0, 0]);
    expect(moveLight(sun, to, camera, true)).toEqual({ direction: [-1, 0, 0] });
    expect(moveLight(sun, at?.target as Triple, camera, true)).toBeNull();
  });

  test("a rectangle's height lies in the plane of its direction and up, turned by its rotation", () => {
    const [width, height] = spotEdgePoint([0, 0, -3], 0);
    close(height, [0, 1, 0]);
    for (const direction of [
      [0, -1, 0],
      [1, -2, 0.5],
    ] as Triple[]) {
      const [w, h] = spotEdgePoint(direction, 30);
      close([dot(w, h), dot(w, direction), dot(h, direction), length(w), length(h)], [0, 0, 0, 1, 1]);
    }
    close(spotEdgePoint([0, 0, -3], 90)[0].map(Math.abs), height.map(Math.abs));
    expect(length(cross(width, height))).toBeCloseTo(1, 9);
  });

  test("outlines are as large as what they stand for", () => {
    const panel = {
      kind: "rectangle",
      ...common,
      position: [0, 1, 0],
      direction: [0, -1, 0],
      rotation: 0,
      size: [2, 1],
    };
    const [a, b, c] = lightOutline(panel as unknown as Light) as [Triple, Triple, Triple];
    expect([length(subtract(a, b)), length(subtract(b, c))]).toEqual([2, 1]);
    for (const point of lightOutline(spot)) expect(length(point)).toBeCloseTo(2, 9); // 45° from 2 m above
    const shape = (fields: object) => lightOutline({ ...common, position: [1, 2, 3], ...fields } as unknown as Light);
    const away = (points: Triple[]) => points.map((point) => length(subtract(point, [1, 2, 3])));
    for (const distance of away(shape({ kind: "disc", direction: [0, -2, 0], radius: 0.5 })))
      expect(distance).toBeCloseTo(0.5, 9);
    for (const distance of away(shape({ kind: "sphere", radius: 0.5 }))) expect(distance).toBeCloseTo(0.5, 9);
    const tube = shape({ kind: "tube", direction: [3, 0, 0], radius: 0.3, length: 0.8 });
    for (const distance of away(tube)) expect(distance).toBeCloseTo(0.5, 9); // 0.3, 0.4, 0.5
    expect(Math.max(...tube.map(([x]) => x)) - Math.min(...tube.map(([x]) => x))).toBeCloseTo(0.8, 9);
  });
});

describe("a new light", () => {
  const clicked = { position: [0, 0, 0], normal: [0, 1, 0], distance: 5, radiance: 0.5 } as const;
  const on = (kind: Parameters<typeof createLight>[0]) =>
    createLight(kind, { ...clicked, position: [...clicked.position], normal: [...clicked.normal] });

  test("stands off the surface and shines on it", () => {
    for (const kind of ["spot", "rectangle"] as const) {
      expect(on(kind)).toMatchObject({ kind, position: [0, 1, 0], direction: [0, -1, 0], enabled: true });
    }
    expect(on("point")).toMatchObject({ position: [0, 1, 0], emission: [3, 3, 3] });
    expect(on("directional")).toMatchObject({ direction: [0, -1, 0] });
  });

  test("a panel beside a low object stands no lower than what was clicked, and one under a ceiling hangs", () => {
    const panel = (normal: Triple) =>
      createLight("rectangle", { position: [0, 0.03, 0], normal, distance: 5, radiance: 0.5 });
    const lowest = (light: Light) => Math.min(...lightOutline(light).map(([, y]) => y));
    expect(lowest(panel([0, 0, 1]))).toBeGreaterThan(0.02);
    expect(lowest(panel([0.6, 0, 0.8]))).toBeGreaterThan(0.02);
    expect(panel([0, -1, 0])).toMatchObject({ position: [0, -0.97, 0] });
  });

  test("gives the same irradiance whatever its kind", () => {
    const panel = on("rectangle") as Extract<Light, { kind: "rectangle" }>;
    expect(panel.emission[0] * panel.size[0] * panel.size[1]).toBeCloseTo(3, 1);
    const disc = on("disc") as Extract<Light, { kind: "disc" }>;
    expect(disc.emission[0] * Math.PI * disc.radius ** 2).toBeCloseTo(3, 1);
    const sphere = on("sphere") as Extract<Light, { kind: "sphere" }>;
    expect(sphere.emission[0] * Math.PI * sphere.radius ** 2).toBeCloseTo(3, 1);
    const tube = on("tube") as Extract<Light, { kind: "tube" }>;
    expect(tube.emission[0] * 2 * tube.radius * tube.length).toBeCloseTo(3, 1);
  });

  test("has a name of its own", () => {
    expect(nextLightName("Spot", [])).toBe("Spot");
    expect(nextLightName("Spot", ["Spot", "Spot 2"])).toBe("Spot 3");
    expect(nextLightName("Key 2", ["Key 2"])).toBe("Key 3");
    expect(nextLightName("Key 2", ["Key", "Key 2", "Key 3"])).toBe("Key 4");
  });

  test("that is a copy stands beside what it copies and is the same otherwise", () => {
    expect(offsetCopy(spot)).toEqual({ ...spot, position: [0.5, 2, 0] });
    expect(offsetCopy(sun)).toEqual(sun);
  });

  test("keeps as another kind what both have", () => {
    const direction: Triple = [0, -2, 0];
    expect(changeKind(spot, "point")).toEqual({ ...DEFAULT_LIGHTS.point, ...common, position: [0, 2, 0], direction });
    expect(changeKind(sun, "spot")).toMatchObject({ direction: [0, -1, 0], cone: [20, 30], position: [0, 1, 0] });
  });
});

describe("the inspector's fields", () => {
  const labels = (light: Light) => [...numbersFieldsOf(light), ...angleFieldsOf(light)].map(({ label }) => label);

  test("are those that the kind has", () => {
    expect(labels(spot)).toEqual(["Position", "Direction", "Inner cone", "Outer cone"]);
    expect(labels(sun)).toEqual(["Direction", "Azimuth", "Elevation", "Angle"]);
    const tube = { kind: "tube", ...common, position: [0, 1, 0], direction: [1, 0, 0], radius: 0.1, length: 1 };
    expect(labels(tube as unknown as Light)).toEqual(["Position", "Direction", "Radius", "Length"]);
  });

  test("of a cone push each other, so that the edge never lies within", () => {
    const [inner, edge] = angleFieldsOf(spot);
    expect(inner?.changeFor(spot, 60)).toEqual([60, 60]);
    expect(edge?.changeFor(spot, 10)).toEqual([10, 10]);
    expect([inner?.valueOf(spot), edge?.valueOf(spot)]).toEqual([20, 45]);
  });

  test("of a sun are its azimuth from −Z over +X and its elevation", () => {
    const fromEast = { ...sun, direction: [-2, -2, 0] } as unknown as Light;
    const [azimuth, elevation] = angleFieldsOf(fromEast);
    expect(azimuth?.valueOf(fromEast)).toBeCloseTo(90, 9);
    expect(elevation?.valueOf(fromEast)).toBeCloseTo(45, 9);
    const north = azimuth?.changeFor(fromEast, 0) as Triple;
    close(north, [0, -Math.SQRT1_2, Math.SQRT1_2]);
    close(elevation?.changeFor(fromEast, 0) as Triple, [-1, 0, 0]);
  });

  test("refuse a direction without length", () => {
    const direction = numbersFieldsOf(sun)[0];
    expect([direction?.allows?.([0, 0, 0]), direction?.allows?.([0, 0, 1])]).toEqual([false, true]);
  });
});

test("a saved look may say only what it changes of a light", () => {
  expect(completeLight({ intensity: 2 }, spot)).toEqual({ ...spot, intensity: 2 });
  expect(completeLight({ kind: "point" }, spot)).toEqual(DEFAULT_LIGHTS.point);
});

describe("one light alone", () => {
  const lit = { ...LOOK, lights: { Spot: { ...spot, enabled: false }, Sun: sun } };

  test("shines, the others and the environment do not", () => {
    soloLight.value = "Spot";
    const alone = visibleLookOf(lit);
    expect([alone.lights["Spot"]?.enabled, alone.lights["Sun"]?.enabled, alone.environment.intensity]).toEqual([
      true,
      false,
      0,
    ]);
    expect(soloSources(lit)).toEqual(["Spot"]);
    soloLight.value = ENVIRONMENT_SOURCE;
    expect(visibleLookOf(lit).environment).toBe(lit.environment);
    expect(soloSources(lit)).toEqual(["environment"]);
  });

  test("is no other look where there is no such light", () => {
    soloLight.value = "gone";
    expect(visibleLookOf(lit)).toBe(lit);
    expect(soloSources(lit)).toBeNull();
    soloLight.value = null;
    expect(visibleLookOf(lit)).toBe(lit);
  });

  test("works with a light-path filter, which is not part of the look", () => {
    pathOverride.value = { show: "direct", bounces: 3 };
    const visibleLook = withVisiblePaths(lit);
    expect(visibleLook.transport).toEqual({ show: "direct", bounces: 3 });
    expect(visibleLook.lights).toBe(lit.lights);
    expect(fullLookOf(visibleLook)).toBe(lit);
    pathOverride.value = null;
  });
});

test("a light's step names the light", () => {
  expect(stepLabel("/lights/Desk ~1 light/position", "Move", LOOK, [])).toBe("Desk / light · Move");
});
