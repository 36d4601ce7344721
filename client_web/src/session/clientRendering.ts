/** Free-camera views drawn by this browser: camera motion needs no network. The server sends the look's tables (frames of
 * kind "scene_update") and exact images; while its tables are outdated, or if the browser cannot draw, it sends all images. */
import { computed, effect, signal } from "@preact/signals";
import { FreeCameraRenderer } from "../render/freeCamera/freeCameraRenderer";
import { isSoftwareRenderer } from "../render/freeCamera/isSoftwareRenderer";
import { getJson, request } from "./net/api";
import type { Frame } from "./net/binaryFrame";
import { MAX_CAMERA_PIXELS, PROBES_LAYOUT, type FrameHeader, type FreeCameraBody } from "../protocol";
import { recordClientFrame } from "../state/latency";
import { usesTexelShading } from "../state/look";
import { views } from "../state/views";
import { showNote } from "../ui/toasts";
import { connections, type BakeConnection } from "./connections";
import { showFrame } from "./bakeSwap";

export type RendererMode = "auto" | "client" | "server";

const RENDERER_KEY = "relume.drawnBy";
const MAX_RENDER_MS = 80;
const NUM_TIMINGS = 8;
/** Maximum number of lost contexts per bake before the server takes over. */
const MAX_LOST_CONTEXTS = 3;
/** Array needed only for lobes; larger than all others. */
const LOBE_LIGHTS_ARRAY = "visible_lights";

/** The renderer of free-camera views chosen by the user. */
export const rendererChoice = signal<RendererMode>(loadRendererChoice());
/** True if this browser draws them. */
export const isClientRendering = signal(false);

interface ClientRenderer {
  bakeConnection: BakeConnection;
  renderer: FreeCameraRenderer;
  /** The last tables of each view. */
  headers: Map<string, FrameHeader>;
  /** Resolves when the array for lobes is loaded. */
  lobeLightsLoading: Promise<void> | null;
}

let clientRenderer: ClientRenderer | null = null;
let loadingConnection: BakeConnection | null = null;
/** Bakes that this browser has failed to draw. */
const rejectedConnections = new WeakSet<BakeConnection>();
/** Number of lost graphics contexts per bake. */
const lostContextCounts = new WeakMap<BakeConnection, number>();
/** True if the server draws: chosen, or automatic with features that this browser cannot draw. */
const isServerRendering = computed(() => rendererChoice.value === "server" || (rendererChoice.value === "auto" && usesTexelShading.value));
const cameraSeqs = new Map<string, number>();
const movingViews = new Set<string>();
const staleViews = new Set<string>();
/** Views for which a newer server image came while an older one was being drawn. */
const supersededViews = new Set<string>();
/** Per view: waiters for its next image. Continuous input must not block acknowledgments. */
const renderWaiters = new Map<string, (() => void)[]>();
let renderLoop: Promise<void> | null = null;
let renderDurations: number[] = [];

function loadRendererChoice(): RendererMode {
  try {
    const stored = localStorage.getItem(RENDERER_KEY);
    return stored === "client" || stored === "server" ? stored : "auto";
  } catch {
    return "auto"; // no storage
  }
}

export function setRenderer(choice: RendererMode): void {
  localStorage.setItem(RENDERER_KEY, choice);
  rendererChoice.value = choice;
}

/** Image size of a free-camera view. */
export function limitRenderSize(width: number, height: number): [number, number] {
  const scale = Math.min(1, Math.sqrt(MAX_CAMERA_PIXELS / (width * height)));
  return [Math.floor(width * scale), Math.floor(height * scale)];
}

/** Record the camera sent to the server: images of earlier cameras are outdated. */
export function setCameraSeq(view: string, cameraSeq: number): void {
  cameraSeqs.set(view, cameraSeq);
}

/** Set whether the browser renders a view's camera motion. */
export function setMoving(view: string, isMovingNow: boolean): void {
  if (isMovingNow) movingViews.add(view);
  else movingViews.delete(view);
}

/** True if the browser renders a view's camera motion. */
export const isMoving = (view: string): boolean => movingViews.has(view);

/** Draw a view from its current camera; false if the server has to. */
export function renderIfPossible(view: string): boolean {
  const { shown } = connections;
  if (clientRenderer === null || clientRenderer.bakeConnection !== shown || !clientRenderer.renderer.isReady || !isClientRendering.peek()) return false;
  if (shown.session.hasPendingEdits || clientRenderer.headers.get(view)?.revision !== shown.session.revision) return false;
  void renderView(view);
  return true;
}

/** Handle a frame of the server. */
export async function onFrame(source: BakeConnection, frame: Frame): Promise<void> {
  const { view, kind, camera_seq: cameraSeq } = frame.header;
  if (kind === "scene_update") return onTables(source, frame);
  const isRenderedHere = isClientRendering.peek() && clientRenderer?.bakeConnection === source && kind === "picture";
  const isLate = isRenderedHere && (movingViews.has(view) || (cameraSeqs.has(view) && cameraSeq !== null && cameraSeqs.get(view) !== cameraSeq));
  if (isLate) return;
  if (kind === "picture") {
    supersededViews.add(view);
    staleViews.delete(view);
  }
  await showFrame(source, frame);
  void offerClientRendering(source, view);
}

async function onTables(source: BakeConnection, frame: Frame): Promise<void> {
  const { header, payload } = frame;
  if (clientRenderer?.bakeConnection !== source || header.scene_update === null) return;
  clientRenderer.renderer.setTables(header.scene_update, payload);
  clientRenderer.headers.set(header.view, header);
  if (clientRenderer.renderer.lacksVisibleLights) {
    try {
      await (clientRenderer.lobeLightsLoading ??= loadLobeLights(clientRenderer));
    } catch (error) {
      return fallBackToServer(`${(error as Error).message}. The server draws instead.`);
    }
  }
  return renderView(header.view);
}

async function loadLobeLights({ bakeConnection, renderer }: ClientRenderer): Promise<void> {
  renderer.store(LOBE_LIGHTS_ARRAY, await loadArray(bakeConnection, LOBE_LIGHTS_ARRAY));
}

/** Draw one image at a time, each from the newest camera; resolves when the view has been drawn once, or cannot be. */
function renderView(view: string): Promise<void> {
  staleViews.add(view);
  const rendered = new Promise<void>((done) => renderWaiters.set(view, [...(renderWaiters.get(view) ?? []), done]));
  renderLoop ??= renderStaleViews().finally(() => {
    renderLoop = null;
    for (const waiters of renderWaiters.values()) for (const done of waiters) done();
    renderWaiters.clear();
  });
  return rendered;
}


async function renderStaleViews(): Promise<void> {
  for (let view = firstOf(staleViews); view !== undefined && clientRenderer !== null; view = firstOf(staleViews)) {
    staleViews.delete(view);
    supersededViews.delete(view);
    const { bakeConnection } = clientRenderer;
    const start = performance.now();
    const waiters = renderWaiters.get(view) ?? [];
    renderWaiters.delete(view);
    try {
      const frame = await renderFrame(clientRenderer, view);
      if (frame !== null && clientRenderer?.bakeConnection === bakeConnection && !supersededViews.has(view)) await showFrame(bakeConnection, frame);
    } catch (error) {
      if (clientRenderer?.bakeConnection !== bakeConnection) return;
      return clientRenderer.renderer.isLost ? onContextLost() : fallBackToServer(`${(error as Error).message}. The server draws instead.`);
    } finally {
      for (const done of waiters) done();
    }
    recordDuration(performance.now() - start);
  }
}

const firstOf = (items: Set<string>): string | undefined => items.values().next().value;

/** The image as a frame of the server. */
async function renderFrame({ renderer, headers }: ClientRenderer, name: string): Promise<Frame | null> {
  const [view, header] = [views.peek().find((candidate) => candidate.name === name), headers.get(name)];
  if (view === undefined || header === undefined) return null;
  const { width, height, encoded, coverage } = await renderer.draw(view.camera, ...limitRenderSize(view.width, view.height));
  recordClientFrame();
  const fullFrame = { tiles: [[0, 0, width, height]] as FrameHeader["tiles"], format: "rgb9e5" as const, kind: "picture" as const };
  return { header: { ...header, ...fullFrame, width, height, alpha: coverage !== null, scene_update: null }, payload: encoded, alpha: coverage };
}

/** In automatic mode the browser draws only as long as it is fast. */
function recordDuration(ms: number): void {
  renderDurations = [...renderDurations.slice(1 - NUM_TIMINGS), ms];
  const median = [...renderDurations].sort((a, b) => a - b)[NUM_TIMINGS >> 1];
  if (rendererChoice.peek() === "auto" && renderDurations.length === NUM_TIMINGS && (median ?? 0) > MAX_RENDER_MS) fallBackToServer(null);
}

/** The server draws until everything is reloaded, which its next image triggers. */
function onContextLost(): void {
  if (clientRenderer === null) return;
  const { bakeConnection } = clientRenderer;
  const times = 1 + (lostContextCounts.get(bakeConnection) ?? 0);
  lostContextCounts.set(bakeConnection, times);
  if (times > MAX_LOST_CONTEXTS) return fallBackToServer("This browser keeps losing its graphics context. The server draws instead.");
  releaseToServer();
}

/** Let the server draw until the user chooses otherwise. */
function fallBackToServer(reason: string | null): void {
  if (clientRenderer === null) return;
  rejectedConnections.add(clientRenderer.bakeConnection);
  releaseToServer();
  if (reason !== null) showNote(reason);
}

function releaseToServer(): void {
  if (clientRenderer === null) return;
  const { bakeConnection, renderer } = clientRenderer;
  clientRenderer = null;
  isClientRendering.value = false;
  staleViews.clear();
  movingViews.clear();
  renderer.release();
  bakeConnection.session.send({ type: "renderer", renderer: "server" });
  bakeConnection.isRenderingAnnounced = false;
}

/** Called when a view's image is shown: from now on this browser may draw it. */
async function offerClientRendering(bakeConnection: BakeConnection, view: string): Promise<void> {
  const isFree = bakeConnection.hello?.views.find(({ name }) => name === view)?.camera_mode === "free";
  if (!isFree || bakeConnection !== connections.shown || isServerRendering.peek() || rejectedConnections.has(bakeConnection)) return;
  if (clientRenderer?.bakeConnection === bakeConnection) return announceClientRendering(clientRenderer);
  if (loadingConnection === bakeConnection) return;
  loadingConnection = bakeConnection;
  try {
    const newRenderer = await loadClientRenderer(bakeConnection);
    if (newRenderer === null) return;
    if (bakeConnection !== connections.shown || isServerRendering.peek()) return newRenderer.renderer.release();
    clientRenderer?.renderer.release();
    clientRenderer = newRenderer;
    renderDurations = [];
    announceClientRendering(newRenderer);
  } catch (error) {
    rejectedConnections.add(bakeConnection);
    if (rendererChoice.peek() === "client") showNote(`${(error as Error).message}. The server draws instead.`);
  } finally {
    loadingConnection = null;
  }
}

/** A new connection: the server does not know yet which views the browser draws. */
function announceClientRendering({ bakeConnection, headers }: ClientRenderer): void {
  if (bakeConnection.isRenderingAnnounced) return;
  headers.clear();
  bakeConnection.isRenderingAnnounced = bakeConnection.session.send({ type: "renderer", renderer: "client" });
  isClientRendering.value = bakeConnection.isRenderingAnnounced;
}

/** Load the constant data of a bake; null if this browser would render on the CPU. */
async function loadClientRenderer(bakeConnection: BakeConnection): Promise<ClientRenderer | null> {
  const gl = new OffscreenCanvas(1, 1).getContext("webgl2", { antialias: false });
  if (gl === null) throw new Error("This browser has no WebGL2");
  if (rendererChoice.peek() === "auto" && isSoftwareRenderer(gl)) {
    rejectedConnections.add(bakeConnection);
    return null;
  }
  const surface = await getJson<FreeCameraBody>(arrayUrl(bakeConnection));
  if (surface.has_alpha_test) throw new Error("This browser cannot draw glass or alpha-tested surfaces");
  const names = surface.arrays.filter((name) => name !== LOBE_LIGHTS_ARRAY);
  const arrays = await Promise.all(names.map(async (name) => [name, await loadArray(bakeConnection, name)] as const));
  return { bakeConnection, renderer: new FreeCameraRenderer(gl, surface, new Map(arrays)), headers: new Map(), lobeLightsLoading: null };
}

async function loadArray(bakeConnection: BakeConnection, name: string): Promise<Uint8Array> {
  return new Uint8Array(await (await request(arrayUrl(bakeConnection, `/${encodeURIComponent(name)}`))).arrayBuffer());
}

const arrayUrl = ({ bake }: BakeConnection, array = ""): string =>
  `/api/bakes/${encodeURIComponent(bake)}/probes${array}?layout=${PROBES_LAYOUT}`;

effect(() => {
  const choice = rendererChoice.value;
  const { shown } = connections;
  if (isServerRendering.value || (choice === "auto" && clientRenderer?.renderer.isSoftware === true)) fallBackToServer(null);
  if (shown === null) return;
  if (choice !== "server") rejectedConnections.delete(shown);
  for (const view of shown.hello?.views ?? []) if (shown.pendingFrames.isDisplayed(view.name)) void offerClientRendering(shown, view.name);
});
