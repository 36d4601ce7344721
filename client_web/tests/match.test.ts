import { beforeEach, describe, expect, test, vi } from "vitest";
import { history } from "../src/edit/history";
import {
  beginStroke,
  changesMaterials,
  cancelMatch,
  endStroke,
  extendStroke,
  gesture,
  matchStatus,
  resultText,
  strokeKind,
  toggleMatch,
} from "../src/panels/lights/match/match";
import { isMatchOpen, lockedPointers, toggleLock } from "../src/state/match";
import type { SolveBody, SolveRequest } from "../src/protocol";
import { stage } from "../src/render/renderStage";
import { bake } from "../src/state/bakes";
import { look } from "../src/state/look";
import { LOOK } from "./exampleLook";

const solveLook = vi.hoisted(() => vi.fn<(body: SolveRequest) => Promise<SolveBody>>());
vi.mock("../src/session/net/api", async (original) => ({ ...(await original<object>()), solveLook }));

vi.stubGlobal("window", {}); // no event runs
const requests: SolveRequest[] = [];
const settle = () => new Promise((resolve) => setTimeout(resolve, 0));
const answer = (intensity: number): SolveBody => ({
  patch: [{ op: "replace", path: "/environment/intensity", value: intensity }],
  look: {},
  residual: 0.034,
  residual_before: 0.5,
  changes: [{ pointer: "/environment", stops: 1 }],
  materials: [],
  shortfalls: [],
});

beforeEach(() => {
  requests.length = 0;
  solveLook.mockImplementation((body) => {
    requests.push(body);
    return Promise.resolve(answer(1 + (body.strokes?.[0]?.points?.length ?? 0)));
  });
  look.value = LOOK;
  bake.value = "0123456789abcdef";
  history.clear();
  isMatchOpen.value = true;
  lockedPointers.value = new Set();
  strokeKind.value = "brighter";
  cancelMatch();
  isMatchOpen.value = true;
});

describe("a stroke", () => {
  test("previews the lights while it is painted, and is one step when it ends", async () => {
    beginStroke("front", [10, 10], 4);
    await settle();
    expect(look.value?.environment.intensity).toBe(2);
    expect(history.steps.value).toHaveLength(0);
    extendStroke([20, 10]);
    extendStroke([20.5, 10]); // too close to the last point
    await settle();
    endStroke();
    await settle();
    expect(look.value?.environment.intensity).toBe(3);
    expect(history.steps.value.map(({ label }) => label)).toEqual(["Match · Brighter"]);
    expect(requests.at(-1)?.strokes?.[0]).toMatchObject({ kind: "brighter", radius: 4, stops: 1 });
    expect(gesture.value).toBeNull();
  });

  test("changes the materials painted on when it ends, if asked", async () => {
    changesMaterials.value = true;
    vi.spyOn(stage.imageOf("front"), "material").mockImplementation((x) => (x < 15 ? "Paper" : null));
    beginStroke("front", [10, 10], 4);
    await settle();
    expect(requests.at(-1)?.materials).toEqual([]);
    extendStroke([20, 10]);
    endStroke();
    await settle();
    await settle();
    changesMaterials.value = false;
    expect(requests.at(-1)?.materials).toEqual(["Paper"]);
    expect(history.steps.value).toHaveLength(1);
    expect(gesture.value).toBeNull();
  });

  test("is relative to the look when it began", async () => {
    beginStroke("front", [10, 10], 4);
    await settle();
    extendStroke([20, 10]);
    await settle();
    expect(requests.at(-1)?.look?.["environment"]).toEqual(LOOK.environment);
  });

  test("stays if the next one begins, or the tool closes, before its last answer", async () => {
    beginStroke("front", [10, 10], 4);
    await settle();
    endStroke();
    beginStroke("front", [40, 10], 4);
    expect(history.steps.value).toHaveLength(1);
    extendStroke([60, 10]);
    await settle();
    endStroke();
    toggleMatch();
    await settle();
    expect(history.steps.value).toHaveLength(2);
    expect(look.value?.environment.intensity).toBe(3);
  });

  test("is canceled by Escape, which closes the tool if there is none", async () => {
    beginStroke("front", [10, 10], 4);
    await settle();
    cancelMatch();
    expect(look.value).toEqual(LOOK);
    expect(matchStatus.value).toBe("Canceled. The lights are as before.");
    expect(history.steps.value).toHaveLength(0);
    cancelMatch();
    expect(isMatchOpen.value).toBe(false);
  });

  test("returns to the look before it if the server refuses it, and says why", async () => {
    beginStroke("front", [10, 10], 4);
    await settle();
    solveLook.mockRejectedValue(new Error("turn the shadow catcher off"));
    extendStroke([20, 10]);
    await settle();
    expect(look.value).toEqual(LOOK);
    expect(matchStatus.value).toBe("turn the shadow catcher off");
  });

  test("names the locked lights that the look has", async () => {
    toggleLock("/environment");
    toggleLock("/lights/Gone");
    beginStroke("front", [10, 10], 4);
    await settle();
    expect(requests.at(-1)?.locked).toEqual(["/environment"]);
  });
});

describe("the result as text", () => {
  test("has the residual", () => {
    expect(resultText(answer(2))).toBe("1 light changed. Residual 3.4 %.");
  });

  test("says what cannot be reached, and why", () => {
    const shortfall = { stroke: 0, residual: 0.5, cause: "locked", asked_stops: 1, reached_stops: -0.25 } as const;
    expect(resultText({ ...answer(2), changes: [], shortfalls: [shortfall] })).toBe(
      "No lights changed. Residual 3.4 %. Cannot be reached (asked +1.0 EV, reached −0.3 EV): the lights there are locked.",
    );
  });
});
