/** Free-camera views that this browser draws itself: a moving camera needs no network. The server sends
 * what a look makes (frames of kind "scene_update"), and sends exact images as ever; where it has not caught up, or the
 * browser cannot draw, it sends all images. */
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
/** Of a bake; a browser that loses more of them is left alone. */
const MAX_LOST_CONTEXTS = 3;
/** What lobes alone ask for; it is more than everything else. */
const LOBE_LIGHTS_ARRAY = "seen_lights";

/** Who draws free-camera views, as the user wants it. */
export const rendererChoice = signal<RendererMode>(loadRendererChoice());
/** Whether this browser does. */
export const isClientRendering = signal(false);

interface ClientRenderer {
  bakeConnection: BakeConnection;
  renderer: FreeCameraRenderer;
  /** The last tables of each view. */
  headers: Map<string, FrameHeader>;
  /** Resolves when what lobes ask for is there. */
  lobeLightsLoading: Promise<void> | null;
}

let clientRenderer: ClientRenderer | null = null;
let loadingConnection: BakeConnection | null = null;
/** Bakes that this browser has failed to draw. */
const rejectedConnections = new WeakSet<BakeConnection>();
/** How many graphics contexts were lost while they were drawn. */
const lostContextCounts = new WeakMap<BakeConnection, number>();
/** Whether the server draws: it was chosen, or the choice is left to us and it shows what this browser cannot. */
const isServerRendering = computed(() => rendererChoice.value === "server" || (rendererChoice.value === "auto" && usesTexelShading.value));
const cameraSeqs = new Map<string, number>();
const movingViews = new Set<string>();
const staleViews = new Set<string>();
/** Views of which the server sent an image that is wanted while one was being drawn here, older than it. */
const supersededViews = new Set<string>();
/** Of each view: the waiters for its next image. Continued input must not keep frames from being acknowledged. */
const renderWaiters = new Map<string, (() => void)[]>();
let renderLoop: Promise<void> | null = null;
let renderDurations: number[] = [];

function loadRendererChoice(): RendererMode {
  try {
    const stored = localStorage.getItem(RENDERER_KEY);
    return stored === "client" || stored === "server" ? stored : "auto";
  } catch {
    return "auto"; // a browser without storage
  }
}

export function setRenderer(choice: RendererMode): void {
  localStorage.setItem(RENDERER_KEY, choice);
  rendererChoice.value = choice;
}

/** The size of a free-camera view's images. */
export function limitRenderSize(width: number, height: number): [number, number] {
  const scale = Math.min(1, Math.sqrt(MAX_CAMERA_PIXELS / (width * height)));
  return [Math.floor(width * scale), Math.floor(height * scale)];
}

/** Record the camera that the server has: images of others are late. */
export function setCameraSeq(view: string, cameraSeq: number): void {
  cameraSeqs.set(view, cameraSeq);
}

/** Set whether a view's camera moves without the server. */
export function setMoving(view: string, isMovingNow: boolean): void {
  if (isMovingNow) movingViews.add(view);
  else movingViews.delete(view);
}

/** Whether a view's camera moves without the server. */
export const isMoving = (view: string): boolean => movingViews.has(view);

/** Draw a view from where its camera is now; false where the server has to. */
export function renderIfPossible(view: string): boolean {
  const { shown } = connections;
  if (clientRenderer === null || clientRenderer.bakeConnection !== shown || !clientRenderer.renderer.isReady || !isClientRendering.peek()) return false;
  if (shown.session.hasPendingEdits || clientRenderer.headers.get(view)?.revision !== shown.session.revision) return false;
  void renderView(view);
  return true;
}

/** Take a frame of a server. */
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
      return fallBackToServer(`${(error as Error).message}; the server draws instead.`);
    }
  }
  return renderView(header.view);
}

async function loadLobeLights({ bakeConnection, renderer }: ClientRenderer): Promise<void> {
  renderer.store(LOBE_LIGHTS_ARRAY, await loadArray(bakeConnection, LOBE_LIGHTS_ARRAY));
}

/** One image at a time, each from the newest camera; resolves when the view has been drawn once, or will not be. */
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
      return clientRenderer.renderer.isLost ? onContextLost() : fallBackToServer(`${(error as Error).message}; the server draws instead.`);
    } finally {
      for (const done of waiters) done();
    }
    recordDuration(performance.now() - start);
  }
}

const firstOf = (items: Set<string>): string | undefined => items.values().next().value;

/** A frame as the server would have sent it. */
async function renderFrame({ renderer, headers }: ClientRenderer, name: string): Promise<Frame | null> {
  const [view, header] = [views.peek().find((candidate) => candidate.name === name), headers.get(name)];
  if (view === undefined || header === undefined) return null;
  const { width, height, encoded, coverage } = await renderer.draw(view.camera, ...limitRenderSize(view.width, view.height));
  recordClientFrame();
  const fullFrame = { tiles: [[0, 0, width, height]] as FrameHeader["tiles"], format: "rgb9e5" as const, kind: "picture" as const };
  return { header: { ...header, ...fullFrame, width, height, alpha: coverage !== null, scene_update: null }, payload: encoded, alpha: coverage };
}

/** Where it was not asked for, drawing here goes on only as long as it is quick. */
function recordDuration(ms: number): void {
  renderDurations = [...renderDurations.slice(1 - NUM_TIMINGS), ms];
  const median = [...renderDurations].sort((a, b) => a - b)[NUM_TIMINGS >> 1];
  if (rendererChoice.peek() === "auto" && renderDurations.length === NUM_TIMINGS && (median ?? 0) > MAX_RENDER_MS) fallBackToServer(null);
}

/** The server draws until all is loaded anew, which its next image begins. */
function onContextLost(): void {
  if (clientRenderer === null) return;
  const { bakeConnection } = clientRenderer;
  const times = 1 + (lostContextCounts.get(bakeConnection) ?? 0);
  lostContextCounts.set(bakeConnection, times);
  if (times > MAX_LOST_CONTEXTS) return fallBackToServer("This browser keeps losing its graphics context; the server draws instead.");
  releaseToServer();
}

/** The server draws from now on, until somebody wishes otherwise. */
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

/** An image of a view is shown: from now on this browser may draw it. */
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
    if (rendererChoice.peek() === "client") showNote(`${(error as Error).message}; the server draws instead.`);
  } finally {
    loadingConnection = null;
  }
}

/** The server that greets knows nothing of who draws. */
function announceClientRendering({ bakeConnection, headers }: ClientRenderer): void {
  if (bakeConnection.isRenderingAnnounced) return;
  headers.clear();
  bakeConnection.isRenderingAnnounced = bakeConnection.session.send({ type: "renderer", renderer: "client" });
  isClientRendering.value = bakeConnection.isRenderingAnnounced;
}

/** Everything of a bake that never changes; null where this browser would draw with its processor. */
async function loadClientRenderer(bakeConnection: BakeConnection): Promise<ClientRenderer | null> {
  const gl = new OffscreenCanvas(1, 1).getContext("webgl2", { antialias: false });
  if (gl === null) throw new Error("This browser offers no WebGL2");
  if (rendererChoice.peek() === "auto" && isSoftwareRenderer(gl)) {
    rejectedConnections.add(bakeConnection);
    return null;
  }
  const surface = await getJson<FreeCameraBody>(arrayUrl(bakeConnection));
  if (surface.has_alpha_test) throw new Error("This browser cannot draw glass or surfaces with holes");
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
