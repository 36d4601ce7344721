/** Paths on the material map: plotted as they are taken, and added to the timeline at constant speed. */
import { beforeEach, expect, test, vi } from "vitest";
import { history } from "../src/edit/history";
import {
  addPathPoint,
  addPathToTimeline,
  mapTable,
  pathDurations,
  pathLine,
  pathPoints,
} from "../src/panels/library/mapPath";
import { highlightAt, mapRange, positionOf } from "../src/panels/library/navigationMap";
import { addKeyframe, interpolation, keyframes, keyTimes, MAX_KEYFRAMES } from "../src/panels/looks/keyframes";
import { look } from "../src/state/look";
import { timelineOpen } from "../src/state/panels";
import { LOOK } from "./exampleLook";

const RANGE = mapRange([
  { f0: 0.04, sigma: 0.02 },
  { f0: 0.81, sigma: 0.5 },
]);
const AT = (x: number, y: number) => highlightAt({ x, y }, RANGE);

beforeEach(() => {
  vi.stubGlobal("window", { setTimeout: () => 0 });
  history.clear();
  [keyframes.value, pathPoints.value, look.value, timelineOpen.value] = [[], [], LOOK, false];
  mapTable.value = "ngan";
});

test("the plotted path passes through its points, straight in reflectance between", () => {
  const points = [AT(0, 0), AT(1, 0.5), AT(1, 1)];
  const line = pathLine(points, RANGE);
  for (const [k, point] of points.entries()) {
    const { x, y } = positionOf(point, RANGE);
    expect(line[12 * k]).toEqual({ x: expect.closeTo(x) as number, y: expect.closeTo(y) as number });
  }
  const middle = positionOf({ f0: 0.425, sigma: AT(0, 0.25).sigma }, RANGE);
  expect(line[6]?.x).toBeCloseTo(middle.x);
  expect(line[6]?.y).toBeCloseTo(middle.y);
});

test("a path moves at constant speed on the plot", () => {
  expect(pathDurations([AT(0, 0), AT(0.75, 0), AT(1, 0)], RANGE)).toEqual([1.5, 0.5]);
  expect(pathDurations([AT(0, 0), AT(0, 0)], RANGE)).toEqual([1]);
});

test("a path becomes keyframes of the material, in one step", async () => {
  const [material] = Object.keys(LOOK.materials);
  const requested: string[] = [];
  vi.stubGlobal("fetch", (url: string) => {
    requested.push(url);
    const terms = [{ model: "lambert", color: [requested.length, 0, 0], texture: "diffuse" }];
    return Promise.resolve(new Response(JSON.stringify(terms)));
  });
  mapTable.value = "low";
  addPathPoint({ x: 0, y: 0 }, RANGE);
  await addPathToTimeline(material ?? "", RANGE);
  expect(keyframes.value).toEqual([]); // one point is no path
  addPathPoint({ x: 0.75, y: 0 }, RANGE);
  addPathPoint({ x: 1, y: 0 }, RANGE);
  await addPathToTimeline(material ?? "", RANGE);
  expect(requested.length).toBe(3);
  expect(requested.every((url) => url.endsWith("table=low"))).toBe(true);
  expect(keyframes.value.map((key) => key.look.materials?.[material ?? ""]?.terms[0])).toMatchObject(
    [1, 2, 3].map((red) => ({ color: [red, 0, 0], texture: null })),
  );
  expect(keyTimes.value).toEqual([0, 0.75, 1]);
  expect([interpolation.value, timelineOpen.value, pathPoints.value]).toEqual(["map_low", true, []]);
  expect(history.steps.value.length).toBe(1);
});

test("a path that the timeline has no room for is kept, and nothing is added", async () => {
  vi.stubGlobal("fetch", () => Promise.resolve(new Response("[]")));
  for (let k = 1; k < MAX_KEYFRAMES; k += 1) addKeyframe({ name: `${k}`, look: LOOK });
  addPathPoint({ x: 0, y: 0 }, RANGE);
  addPathPoint({ x: 1, y: 0 }, RANGE);
  await addPathToTimeline(Object.keys(LOOK.materials)[0] ?? "", RANGE);
  expect(keyframes.value.length).toBe(MAX_KEYFRAMES - 1);
  expect(pathPoints.value.length).toBe(2);
});
