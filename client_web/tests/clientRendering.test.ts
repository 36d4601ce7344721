/** Free-camera views that the browser draws: frames of the server are acknowledged during continued input. */
import { expect, test, vi } from "vitest";
import type { Frame } from "../src/session/net/binaryFrame";
import { connections, type BakeConnection } from "../src/session/connections";
import { views } from "../src/state/views";
import { onePixel } from "./exampleFrames";

/** Ends the image that is being drawn. */
let finish: () => void = () => undefined;
const draw = vi.fn(() => new Promise((done) => (finish = () => done({ width: 1, height: 1, encoded: new Uint8Array(4), coverage: null }))));

vi.hoisted(() => {
  vi.stubGlobal("localStorage", { getItem: () => "client", setItem: () => undefined });
  vi.stubGlobal("window", { setTimeout: () => 0 });
  vi.stubGlobal("OffscreenCanvas", class { getContext = () => ({}); });
  vi.stubGlobal("fetch", async () => new Response(JSON.stringify({ has_holes: false, arrays: [] })));
});
vi.mock("../src/render/freeCamera/freeCameraRenderer", () => ({
  FreeCameraRenderer: class {
    isReady = true;
    setTables = () => undefined;
    release = () => undefined;
    draw = draw;
  },
}));
vi.mock("../src/session/bakeSwap", () => ({ showFrame: async () => undefined }));

test("tables are taken when their picture is drawn, however many more are wanted by then", async () => {
  const { renderIfPossible, isClientRendering, onFrame } = await import("../src/session/clientRendering");
  const session = { send: () => true, hasPendingEdits: false, revision: 0 };
  const hello = { views: [{ name: "front", camera_mode: "free" }] };
  const connection = { bake: "b", hello, session, isRenderingAnnounced: false, pendingFrames: { isDisplayed: () => true } } as unknown as BakeConnection;
  connections.shown = connection;
  views.value = [{ name: "front", width: 1, height: 1, camera_mode: "free", camera: { to_world: [], yfov: 1 } } as never];
  await onFrame(connection, onePixel("front", true));
  await vi.waitFor(() => expect(isClientRendering.value).toBe(true));
  const { header } = onePixel("front", true);
  const tables = { header: { ...header, kind: "scene_update", scene_update: { arrays: [] } }, payload: new Uint8Array(0), alpha: null };
  const taken = onFrame(connection, tables as unknown as Frame);
  await vi.waitFor(() => expect(draw).toHaveBeenCalledTimes(1));
  expect(renderIfPossible("front")).toBe(true); // the drag goes on
  finish();
  await taken;
  await vi.waitFor(() => expect(draw).toHaveBeenCalledTimes(2));
});
