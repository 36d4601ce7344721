/** A camera that walls stop; the server is a plane, a corner, or does not answer. */
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { Triple } from "../src/protocol";
import {
  dollyOrbit,
  positionOf,
  rotateOrbit,
  translateOrbit,
  turnHead,
  type Orbit,
} from "../src/viewport/cameras/orbit";
import { WallGuard, type Obstacle, type Wall } from "../src/viewport/cameras/wallGuard";

const MARGIN = 0.05;
const bounds = { lowest: [-5, 0, -5], highest: [5, 3, 5] } as never;
const start: Orbit = { target: [0, 1, 0], distance: 2, azimuth: 0, elevation: 0, roll: 0, yfov: 40, near: 0 };
const FREE: Obstacle = { length: null, material: null, normal: null };

/** The first wall on a path; each is a plane at a coordinate. */
function traceWalls(walls: readonly [axis: 0 | 1 | 2, at: number][], points: readonly Triple[]): Obstacle {
  let traveled = 0;
  for (const [k, to] of points.slice(1).entries()) {
    const from = points[k] as Triple;
    const step = Math.hypot(...to.map((value, axis) => value - (from[axis] as number)));
    const crossed = walls
      .map(([axis, at]) => ({ axis, fraction: (at - from[axis]) / (to[axis] - from[axis]) }))
      .filter(({ fraction }) => fraction >= 0 && fraction <= 1)
      .sort((a, b) => a.fraction - b.fraction)[0];
    if (crossed !== undefined) {
      const normal: Triple = [0, 0, 0];
      normal[crossed.axis] = 1;
      return { length: traveled + crossed.fraction * step, material: "Plaster", normal };
    }
    traveled += step;
  }
  return FREE;
}

function makeGuard(trace: (points: Triple[]) => Promise<Obstacle>) {
  const state = { orbit: start, stops: [] as Wall[], requests: [] as Triple[][] };
  const guard = new WallGuard(MARGIN, {
    now: () => state.orbit,
    accept: (orbit) => (state.orbit = orbit),
    stop: (wall) => state.stops.push(wall),
    trace: (points) => {
      state.requests.push(points);
      return trace(points);
    },
  });
  return { guard, state };
}

const withWalls = (...walls: [0 | 1 | 2, number][]) =>
  makeGuard((points) => Promise.resolve(traceWalls(walls, points)));
const settle = () => vi.advanceTimersByTimeAsync(0);

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

describe("a camera and walls", () => {
  it("stops a margin before a wall, whatever the step", async () => {
    for (const factor of [0.9, 0.5, 0.01]) {
      const { guard, state } = withWalls([2, 1]);
      for (let k = 0; k < 30; k++) {
        guard.move(dollyOrbit(guard.goal, factor, bounds));
        await settle();
      }
      expect(positionOf(state.orbit)[2]).toBeCloseTo(1 + MARGIN, 5);
      expect(state.stops.at(-1)).toMatchObject({ material: "Plaster" });
      expect(state.stops.at(-1)?.direction[2]).toBeCloseTo(-1, 9);
    }
  });

  it("stops on an orbit that would go through a wall", async () => {
    const { guard, state } = withWalls([0, 1]);
    guard.move(rotateOrbit(guard.goal, Math.PI / 2, 0)); // in one step
    await settle();
    expect(positionOf(state.orbit)[0]).toBeLessThanOrEqual(1 - MARGIN + 1e-3);
    expect(positionOf(state.orbit)[0]).toBeGreaterThan(0.9);
    expect(state.stops).toHaveLength(1);
    guard.move(rotateOrbit(guard.goal, -0.3, 0)); // the way back is free
    await settle();
    expect(state.stops).toHaveLength(1);
  });

  it("slides along a wall, and stops in a corner", async () => {
    const { guard, state } = withWalls([2, 1], [0, 2]);
    guard.move(translateOrbit(guard.goal, [1, 0, -3]), true);
    await settle();
    const [x, , z] = positionOf(state.orbit);
    expect(z).toBeCloseTo(1 + MARGIN, 5);
    expect(x).toBeCloseTo(1, 5);
    expect(state.stops).toHaveLength(0);
    guard.move(translateOrbit(guard.goal, [5, 0, -5]), true);
    await settle();
    expect(positionOf(state.orbit)[0]).toBeLessThan(2);
    expect(state.stops).toHaveLength(1);
  });

  it("asks nothing to turn the head", async () => {
    const { guard, state } = withWalls([2, 1]);
    guard.move(turnHead(guard.goal, 1, 0.2));
    await settle();
    expect(state.requests).toHaveLength(0);
    expect(state.orbit.azimuth).toBe(1);
    positionOf(state.orbit).forEach((value, k) => expect(value).toBeCloseTo(positionOf(start)[k] as number, 9));
  });

  it("asks one question at a time, of bounded length, and loses no pose", async () => {
    const answers: (() => void)[] = [];
    const { guard, state } = makeGuard((points) => {
      expect(points.length).toBeLessThanOrEqual(64);
      return new Promise((resolve) => answers.push(() => resolve(FREE)));
    });
    for (let k = 0; k < 200; k++) guard.move(translateOrbit(guard.goal, [0.01, 0, 0]));
    expect(state.requests).toHaveLength(1);
    for (let k = 0; k < 10; k++) {
      answers.splice(0).forEach((answer) => answer());
      await settle();
    }
    expect(positionOf(state.orbit)[0]).toBeCloseTo(2, 9);
    expect(state.requests.length).toBeLessThan(8);
  });

  it("moves on without a server, and drops what waits when cancelled", async () => {
    const rejecting = makeGuard(() => Promise.reject(new Error("closed")));
    rejecting.guard.move(translateOrbit(start, [1, 0, 0]));
    await settle();
    expect(positionOf(rejecting.state.orbit)[0]).toBeCloseTo(1, 9);
    const slow = makeGuard(() => new Promise((resolve) => setTimeout(() => resolve(FREE), 500)));
    slow.guard.move(translateOrbit(start, [1, 0, 0]));
    await vi.advanceTimersByTimeAsync(400);
    expect(positionOf(slow.state.orbit)[0]).toBe(0);
    slow.guard.cancel();
    await vi.advanceTimersByTimeAsync(400);
    expect(positionOf(slow.state.orbit)[0]).toBe(0);
  });
});
