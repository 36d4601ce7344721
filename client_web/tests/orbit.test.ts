import { describe, expect, it, vi } from "vitest";
import { nextCameraName } from "../src/viewport/cameras/cameraRequests";
import { TouchGestures } from "../src/viewport/cameras/touchGestures";
import { saveCameraAs } from "../src/viewport/cameras/savedCameras";
import { LatestRequest } from "../src/session/net/latestRequest";
import {
  dollyOrbit,
  interpolateOrbits,
  poseOf,
  isClose,
  levelOrbit,
  orbitOf,
  panOrbit,
  rotateOrbit,
  turnHead,
  walkOrbit,
  withFieldOfView,
  withNearPlane,
  type Orbit,
} from "../src/viewport/cameras/orbit";

const bounds = { lowest: [-1, 0, -1] as const, highest: [1, 2, 1] as const } as never;
const orbit: Orbit = { target: [0, 1, 0], distance: 4, azimuth: 0.4, elevation: 0.3, roll: 0, yfov: 40, near: 0 };
const positionOf = (orbit: Orbit) => [3, 7, 11].map((k) => poseOf(orbit).to_world[k] as number);
const column = (orbit: Orbit, k: number) => [0, 4, 8].map((row) => poseOf(orbit).to_world[row + k] as number);
const dot = (a: number[], b: number[]) => a.reduce((sum, value, k) => sum + value * (b[k] as number), 0);

describe("a camera that goes round a place", () => {
  it("is a rigid frame that looks at its target and stands upright", () => {
    const [x, y, z] = [0, 1, 2].map((k) => column(orbit, k)) as [number[], number[], number[]];
    for (const axis of [x, y, z]) expect(dot(axis, axis)).toBeCloseTo(1, 12);
    for (const [a, b] of [
      [x, y],
      [y, z],
      [z, x],
    ] as const)
      expect(dot(a, b)).toBeCloseTo(0, 12);
    expect(x[1]).toBe(0);
    expect(y[1]).toBeGreaterThan(0);
    const position = positionOf(orbit);
    orbit.target.forEach((at, k) => expect((position[k] as number) - 4 * (z[k] as number)).toBeCloseTo(at, 12));
    const determinant = dot(x, [
      (y[1] as number) * (z[2] as number) - (y[2] as number) * (z[1] as number),
      (y[2] as number) * (z[0] as number) - (y[0] as number) * (z[2] as number),
      (y[0] as number) * (z[1] as number) - (y[1] as number) * (z[0] as number),
    ]);
    expect(determinant).toBeCloseTo(1, 12);
  });

  it("is found again from its frame", () => {
    const again = orbitOf(poseOf(orbit), bounds);
    poseOf(again).to_world.forEach((value, k) => expect(value).toBeCloseTo(poseOf(orbit).to_world[k] as number, 9));
    expect(again.yfov).toBe(40);
  });

  it("is found again from a tilted frame and from one that looks straight down", () => {
    for (const target of [
      { ...orbit, roll: 0.5 },
      { ...orbit, roll: -3 },
    ]) {
      const again = orbitOf(poseOf(target), bounds);
      expect(again.roll).toBeCloseTo(target.roll, 9);
      poseOf(again).to_world.forEach((value, k) => expect(value).toBeCloseTo(poseOf(target).to_world[k] as number, 9));
      expect(interpolateOrbits(orbit, target, 1)).toEqual(target);
      expect(isClose(orbit, target)).toBe(false);
      expect(poseOf(levelOrbit(again)).to_world[4]).toBe(0); // its right is level
    }
    const [cosine, sine] = [Math.cos(0.7), Math.sin(0.7)];
    const down = { to_world: [cosine, -sine, 0, 0, 0, 0, 1, 5, -sine, -cosine, 0, 0, 0, 0, 0, 1], yfov: 40 };
    poseOf(orbitOf(down, bounds)).to_world.forEach((value, k) =>
      expect(value).toBeCloseTo(down.to_world[k] as number, 1),
    );
  });

  it("turns about what the middle of the picture shows", () => {
    const { target } = orbitOf(poseOf({ ...orbit, distance: 3 }), bounds, orbit.target);
    target.forEach((at, k) => expect(at).toBeCloseTo(orbit.target[k] as number, 9));
  });

  it("turns round its target and never over the top", () => {
    const next = rotateOrbit(orbit, 1, 9);
    expect(next.target).toEqual(orbit.target);
    expect(next.elevation).toBeLessThan(Math.PI / 2);
    expect(column(next, 1)[1]).toBeGreaterThan(0);
  });

  it("slides so that what is at its target's depth follows the hand", () => {
    const next = panOrbit(orbit, 0.25, 0.1);
    const [x, y, z] = [0, 1, 2].map((k) => column(next, k)) as [number[], number[], number[]];
    const towards = orbit.target.map((at, k) => at - (positionOf(next)[k] as number));
    const height = 2 * 4 * Math.tan((20 * Math.PI) / 180);
    expect(dot(towards, x) / height).toBeCloseTo(0.25, 9); // it appears that much farther right
    expect(-dot(towards, y) / height).toBeCloseTo(0.1, 9); // and farther down
    expect(-dot(towards, z)).toBeCloseTo(4, 9);
  });

  it("goes neither through its target nor out of sight", () => {
    expect(dollyOrbit(orbit, 0, bounds).distance).toBeGreaterThan(0);
    expect(dollyOrbit(orbit, 1e9, bounds).distance).toBeLessThan(1e4);
    expect(withFieldOfView(orbit, 0).yfov).toBe(1);
    expect(withFieldOfView(orbit, 500).yfov).toBe(170);
  });

  it("passes its target by bounded steps, and leaves the target before it", () => {
    let now = orbit;
    for (let k = 0; k < 80; k++) now = dollyOrbit(now, 0.86, bounds);
    const [from, to] = [positionOf(orbit), positionOf(now)];
    const forward = orbit.target.map((at, k) => (at - (from[k] as number)) / 4);
    const traveled = dot(to.map((at, k) => at - (from[k] as number)), forward); // prettier-ignore
    expect(traveled).toBeGreaterThan(4);
    expect(now.distance).toBeGreaterThan(0);
    const step = positionOf(dollyOrbit(now, 0, bounds)).map((at, k) => at - (to[k] as number));
    expect(Math.hypot(...step)).toBeLessThan(0.3);
  });

  it("turns where it stands, walks on the level, and flies where it looks", () => {
    const turned = turnHead(orbit, -0.3, 0.1);
    positionOf(turned).forEach((value, k) => expect(value).toBeCloseTo(positionOf(orbit)[k] as number, 9));
    expect(turned.azimuth).toBeCloseTo(orbit.azimuth - 0.3, 12);
    const moved = (level: boolean) =>
      positionOf(walkOrbit(orbit, [0, 0, 2], level)).map((value, k) => value - (positionOf(orbit)[k] as number));
    expect(moved(true)[1]).toBeCloseTo(0, 12);
    expect(Math.hypot(...moved(true))).toBeCloseTo(2, 12);
    expect(moved(false)[1]).toBeCloseTo(-2 * Math.sin(0.3), 12);
  });

  it("keeps its near plane in its frame, and at no place behind it", () => {
    const clipped = withNearPlane(orbit, 1.5);
    expect(orbitOf(poseOf(clipped), bounds).near).toBe(1.5);
    expect(withNearPlane(orbit, -1).near).toBe(0);
    expect(isClose(orbit, clipped)).toBe(false);
    expect(interpolateOrbits(orbit, clipped, 0.5).near).toBeCloseTo(0.75, 12);
  });

  it("comes to where it is sent, the short way round", () => {
    const goal = { ...orbit, azimuth: orbit.azimuth + 2 * Math.PI - 0.2, distance: 1 };
    const half = interpolateOrbits(orbit, goal, 0.5);
    expect(half.azimuth).toBeCloseTo(orbit.azimuth - 0.1, 9);
    expect(half.distance).toBeCloseTo(2, 9);
    expect(isClose(interpolateOrbits(orbit, goal, 1), goal)).toBe(true);
    expect(isClose(orbit, goal)).toBe(false);
  });
});

describe("requests of a changing value", () => {
  it("are asked for one at a time, then the newest; what fails does not end it", async () => {
    const requests: number[] = [];
    const drawn: unknown[] = [];
    const failed: unknown[] = [];
    const answers: ((picture: Blob | null) => void)[] = [];
    const images = new LatestRequest(
      (width: number) =>
        new Promise<Blob>((resolve, reject) => {
          requests.push(width);
          answers.push((picture) => (picture === null ? reject(new Error("gone")) : resolve(picture)));
        }),
      (picture) => Promise.resolve(void drawn.push(picture)),
      (error) => failed.push(error),
    );
    const settle = () => new Promise((resolve) => setTimeout(resolve));
    for (const width of [1, 2, 3]) images.send(width);
    expect(requests).toEqual([1]);
    answers[0]?.(null);
    await settle();
    expect(requests).toEqual([1, 3]);
    expect(failed).toHaveLength(1);
    answers[1]?.(new Blob());
    await settle();
    expect(drawn).toHaveLength(1);
    images.send(4);
    images.close();
    answers[2]?.(new Blob());
    await settle();
    expect(drawn).toHaveLength(1);
  });
});

describe("names of new cameras", () => {
  it("are the first that is free", () => {
    expect(nextCameraName([])).toBe("View 1");
    expect(nextCameraName(["front", "View 1", "View 3"])).toBe("View 2");
  });
});

describe("fingers", () => {
  const at = (pointerId: number, clientX: number, clientY: number) => ({ pointerId, clientX, clientY });

  it("pull what they hold, and two of them spread it", () => {
    const fingers = new TouchGestures();
    expect(fingers.move(at(1, 0, 0))).toBeNull();
    fingers.press(at(1, 0, 0));
    expect(fingers.move(at(1, 10, 4))).toMatchObject({ count: 1, across: 10, down: 4, spread: 1 });
    fingers.press(at(2, 30, 4));
    expect(fingers.move(at(2, 50, 4))).toMatchObject({
      count: 2,
      across: 10,
      down: 0,
      spread: 2,
      center: { x: 30, y: 4 },
    });
    expect(fingers.only).toBeNull();
    expect(fingers.lift(at(1, 0, 0))).toBe(true);
    expect(fingers.lift(at(1, 0, 0))).toBe(false);
    expect(fingers.only).toEqual({ x: 50, y: 4 });
  });
});

describe("cameras that are kept", () => {
  const calls: string[] = [];
  const frame = poseOf(orbit);
  vi.stubGlobal("fetch", (path: string, { method = "GET" } = {}) => {
    calls.push(`${method} ${path.split("/").at(-1)}`);
    const cameras = [
      { name: "A", is_placed: true },
      { name: "B", is_placed: true },
      { name: "Own", is_placed: false },
    ];
    return Promise.resolve(method === "DELETE" ? new Response(null, { status: 204 }) : Response.json(cameras));
  });

  it("leave their old name behind, and take nobody else's", async () => {
    await saveCameraAs("s", "C", frame, "A");
    expect(calls.splice(0)).toEqual(["GET cameras", "PUT C", "DELETE A"]);
    await saveCameraAs("s", "A", frame, "A");
    expect(calls.splice(0)).toEqual(["PUT A"]);
    await expect(saveCameraAs("s", "B", frame, "A")).rejects.toThrow("A camera named “B” already exists");
    expect(calls.splice(0)).toEqual(["GET cameras"]);
    await expect(saveCameraAs("s", "Own", frame, "A")).rejects.toThrow("a camera of the scene file");
    expect(calls.splice(0)).toEqual(["GET cameras"]);
    await expect(saveCameraAs("s", "a/b", frame, "A")).rejects.toThrow("slashes");
    expect(calls.splice(0)).toEqual([]);
  });
});
