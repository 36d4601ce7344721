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
  vi.stubGlobal("fetch", () => Promise.resolve(Response.json({ has_holes: false, arrays: [] })));
});
vi.mock("../src/render/freeCamera/freeCameraRenderer", () => ({
  FreeCameraRenderer: class {
    isReady = true;
    setTables = () => undefined;
    dispose = () => undefined;
    draw = draw;
  },
}));
const showFrame = vi.hoisted(() => vi.fn(() => Promise.resolve()));
vi.mock("../src/session/bakeSwap", () => ({ showFrame }));

test("tables are taken when their picture is drawn, however many more are wanted by then", async () => {
  const { renderIfPossible, isClientRendering, onFrame } = await import("../src/session/clientRendering");
  const session = { send: () => true, hasPendingEdits: false, revision: 0 };
  const hello = { views: [{ name: "front", camera_mode: "free" }] };
  const connection = { bake: "b", hello, session, isRenderingAnnounced: false, cameraSeqs: new Map(), pendingFrames: { isDisplayed: () => true } } as unknown as BakeConnection;
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

test("a disposed renderer shows nothing more, reports no failure, and nobody waits for it", async () => {
  const { ClientRenderer } = await import("../src/session/clientRenderer");
  const failed = vi.fn();
  const gpu = { setTables: () => undefined, draw, dispose: vi.fn() } as never;
  const session = { hasPendingEdits: false, revision: 0 };
  const renderer = new ClientRenderer({ session } as never, gpu, () => Promise.resolve(), () => undefined, failed);
  views.value = ["front", "back"].map((name) => ({ name, width: 1, height: 1, camera: { to_world: [], yfov: 1 } }) as never);
  draw.mockClear();
  showFrame.mockClear();
  const tables = (name: string) => ({ ...onePixel(name, true), header: { ...onePixel(name, true).header, scene_update: { arrays: [] } } }) as unknown as Frame;
  const waiting = [renderer.applyTables(tables("front")), renderer.applyTables(tables("back"))];
  await vi.waitFor(() => expect(draw).toHaveBeenCalledTimes(1));
  finish();
  await vi.waitFor(() => expect(draw).toHaveBeenCalledTimes(2));
  expect(showFrame).toHaveBeenCalledTimes(1);
  renderer.dispose();
  finish();
  await Promise.all(waiting);
  expect(showFrame).toHaveBeenCalledTimes(1);
  expect(failed).not.toHaveBeenCalled();
});
