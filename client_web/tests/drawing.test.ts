/** Moving views that the browser draws: what the server sends is acknowledged while a hand goes on moving. */
import { expect, test, vi } from "vitest";
import type { Frame } from "../src/net/binaryFrame";
import { connections, type BakeConnection } from "../src/live/connections";
import { views } from "../src/state/views";
import { onePixel } from "./frames";

/** Ends the picture that is being drawn. */
let finish: () => void = () => undefined;
const draw = vi.fn(() => new Promise((done) => (finish = () => done({ width: 1, height: 1, words: new Uint8Array(4), hides: null }))));

vi.hoisted(() => {
  vi.stubGlobal("localStorage", { getItem: () => "browser", setItem: () => undefined });
  vi.stubGlobal("window", { setTimeout: () => 0 });
  vi.stubGlobal("OffscreenCanvas", class { getContext = () => ({}); });
  vi.stubGlobal("fetch", async () => new Response(JSON.stringify({ has_holes: false, arrays: [] })));
});
vi.mock("../src/evaluator/evaluator", () => ({
  Evaluator: class {
    isReady = true;
    take = () => undefined;
    release = () => undefined;
    draw = draw;
  },
}));
vi.mock("../src/live/swap", () => ({ takeFrame: async () => undefined }));

test("tables are taken when their picture is drawn, however many more are wanted by then", async () => {
  const { drawHere, drawsHere, take } = await import("../src/live/drawing");
  const session = { send: () => true, pending: false, revision: 0 };
  const hello = { views: [{ name: "front", eye: "free" }] };
  const of = { bake: "b", hello, session, toldEvaluator: false, arrivals: { isShown: () => true } } as unknown as BakeConnection;
  connections.shown = of;
  views.value = [{ name: "front", width: 1, height: 1, eye: "free", camera: { to_world: [], yfov: 1 } } as never];
  await take(of, onePixel("front", true));
  await vi.waitFor(() => expect(drawsHere.value).toBe(true));
  const { header } = onePixel("front", true);
  const tables = { header: { ...header, kind: "tables", tables: { arrays: [] } }, payload: new Uint8Array(0), alpha: null };
  const taken = take(of, tables as unknown as Frame);
  await vi.waitFor(() => expect(draw).toHaveBeenCalledTimes(1));
  expect(drawHere("front")).toBe(true); // the hand goes on
  finish();
  await taken;
  await vi.waitFor(() => expect(draw).toHaveBeenCalledTimes(2));
});
