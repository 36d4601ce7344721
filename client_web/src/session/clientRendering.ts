/** Free-camera views drawn by this browser: camera motion loads no pictures. The server sends the look's tables (frames of
 * kind "scene_update") and exact images; while its tables are outdated, or if the browser cannot draw, it sends all images. */
import { computed, effect, signal } from "@preact/signals";
import { FreeCameraRenderer } from "../render/freeCamera/freeCameraRenderer";
import { isSoftwareRenderer } from "../render/freeCamera/isSoftwareRenderer";
import { getJson, request } from "./net/api";
import type { Frame } from "./net/binaryFrame";
import { PROBES_LAYOUT, type FreeCameraBody } from "../protocol";
import { usesTexelShading } from "../state/texelShading";
import { showNote } from "../ui/toasts";
import { ClientRenderer } from "./clientRenderer";
import { connections, type BakeConnection } from "./connections";
import { showFrame } from "./bakeSwap";

export type RendererMode = "auto" | "client" | "server";

const RENDERER_KEY = "relume.drawnBy";
const MAX_RENDER_MS = 80;
/** Maximum number of lost contexts per bake before the server takes over. */
const MAX_LOST_CONTEXTS = 3;
/** Array needed only for lobes; larger than all others. */
const LOBE_LIGHTS_ARRAY = "visible_lights";

/** The renderer of free-camera views chosen by the user. */
export const rendererChoice = signal<RendererMode>(loadRendererChoice());
/** True if this browser draws them. */
export const isClientRendering = signal(false);
/** True if the server traces rays along narrow lobes, which this browser cannot draw. */
export const tracesLobes = signal(false);
/** Why the server draws although this browser was chosen. */
export const TEXEL_SHADING_NOTE =
  "The server draws while the camera moves, because this look uses BTFs or tri-planar textures.";
/** True if the server draws: chosen, for textures that this browser cannot draw, or automatic with narrow lobes. */
const isServerRendering = computed(
  () =>
    rendererChoice.value === "server" ||
    usesTexelShading.value ||
    (rendererChoice.value === "auto" && tracesLobes.value),
);

let clientRenderer: ClientRenderer | null = null;
let loadingConnection: BakeConnection | null = null;
let isTexelNoteShown = false;

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

/** Set whether the browser renders a view's camera motion. */
export function setMoving(view: string, isMovingNow: boolean): void {
  clientRenderer?.setMoving(view, isMovingNow);
}

/** True if the browser renders a view's camera motion. */
export const isMoving = (view: string): boolean => clientRenderer?.isMoving(view) ?? false;

/** Draw a view from its current camera; false if the server has to. */
export function renderIfPossible(view: string): boolean {
  if (clientRenderer?.connection !== connections.shown || !isClientRendering.peek() || !clientRenderer.canDraw(view))
    return false;
  void clientRenderer.draw(view);
  return true;
}

/** Handle a frame of the server. */
export async function onFrame(source: BakeConnection, frame: Frame): Promise<void> {
  const { view, kind, camera_seq: cameraSeq, traces_lobes: traces } = frame.header;
  if (source === connections.shown && isFreeCamera(source, view)) tracesLobes.value = traces;
  const renderer = clientRenderer?.connection === source ? clientRenderer : null;
  if (kind === "scene_update") return renderer?.applyTables(frame);
  if (kind === "picture" && renderer !== null) {
    const sentSeq = source.cameraSeqs.get(view) ?? cameraSeq;
    const isLate = renderer.isMoving(view) || (cameraSeq !== null && cameraSeq !== sentSeq);
    if (isLate && isClientRendering.peek()) return;
    renderer.supersede(view);
  }
  await showFrame(source, frame);
  void offerClientRendering(source, view);
}

/** In automatic mode the browser draws only as long as it is fast. */
function checkSpeed(medianMs: number): void {
  if (rendererChoice.peek() === "auto" && medianMs > MAX_RENDER_MS) fallBackToServer(null);
}

function onFailed(error: unknown): void {
  if (clientRenderer?.isLost) onContextLost();
  else fallBackToServer(`${(error as Error).message}. The server draws instead.`);
}

/** The server draws until everything is reloaded, which its next image triggers. */
function onContextLost(): void {
  if (clientRenderer === null) return;
  clientRenderer.connection.numLostContexts += 1;
  if (clientRenderer.connection.numLostContexts > MAX_LOST_CONTEXTS)
    return fallBackToServer("This browser keeps losing its graphics context. The server draws instead.");
  releaseToServer();
}

/** Let the server draw until the user chooses otherwise. */
function fallBackToServer(reason: string | null): void {
  if (clientRenderer === null) return;
  clientRenderer.connection.isRenderingRejected = true;
  releaseToServer();
  if (reason !== null) showNote(reason);
}

function releaseToServer(): void {
  if (clientRenderer === null) return;
  const { connection } = clientRenderer;
  clientRenderer.dispose();
  clientRenderer = null;
  isClientRendering.value = false;
  connection.session.send({ type: "renderer", renderer: "server" });
  connection.isRenderingAnnounced = false;
}

const isFreeCamera = (source: BakeConnection, view: string): boolean =>
  source.hello?.views.find(({ name }) => name === view)?.camera_mode === "free";

/** Called when a view's image is shown: from now on this browser may draw it. */
async function offerClientRendering(bakeConnection: BakeConnection, view: string): Promise<void> {
  if (
    !isFreeCamera(bakeConnection, view) ||
    bakeConnection !== connections.shown ||
    isServerRendering.peek() ||
    bakeConnection.isRenderingRejected
  )
    return;
  if (clientRenderer?.connection === bakeConnection) return announceClientRendering(clientRenderer);
  if (loadingConnection === bakeConnection) return;
  loadingConnection = bakeConnection;
  try {
    const newRenderer = await loadClientRenderer(bakeConnection);
    if (newRenderer === null) return;
    if (bakeConnection !== connections.shown || isServerRendering.peek()) return newRenderer.dispose();
    clientRenderer?.dispose();
    clientRenderer = newRenderer;
    announceClientRendering(newRenderer);
  } catch (error) {
    bakeConnection.isRenderingRejected = true;
    if (rendererChoice.peek() === "client") showNote(`${(error as Error).message}. The server draws instead.`);
  } finally {
    loadingConnection = null;
  }
}

/** A new connection: the server does not know yet which views the browser draws. */
function announceClientRendering(renderer: ClientRenderer): void {
  const { connection } = renderer;
  if (connection.isRenderingAnnounced) return;
  renderer.clearTables();
  connection.isRenderingAnnounced = connection.session.send({ type: "renderer", renderer: "client" });
  isClientRendering.value = connection.isRenderingAnnounced;
}

/** Load the constant data of a bake; null if this browser would render on the CPU. */
async function loadClientRenderer(bakeConnection: BakeConnection): Promise<ClientRenderer | null> {
  const gl = new OffscreenCanvas(1, 1).getContext("webgl2", { antialias: false });
  if (gl === null) throw new Error("This browser has no WebGL2");
  if (rendererChoice.peek() === "auto" && isSoftwareRenderer(gl)) {
    bakeConnection.isRenderingRejected = true;
    return null;
  }
  const surface = await getJson<FreeCameraBody>(arrayUrl(bakeConnection));
  if (surface.has_alpha_test) throw new Error("This browser cannot draw glass or alpha-tested surfaces");
  const names = surface.arrays.filter((name) => name !== LOBE_LIGHTS_ARRAY);
  const arrays = await Promise.all(names.map(async (name) => [name, await loadArray(bakeConnection, name)] as const));
  const gpu = new FreeCameraRenderer(gl, surface, new Map(arrays));
  const loadLobeLights = async () => gpu.store(LOBE_LIGHTS_ARRAY, await loadArray(bakeConnection, LOBE_LIGHTS_ARRAY));
  return new ClientRenderer(bakeConnection, gpu, loadLobeLights, checkSpeed, onFailed);
}

async function loadArray(bakeConnection: BakeConnection, name: string): Promise<Uint8Array> {
  return new Uint8Array(await (await request(arrayUrl(bakeConnection, `/${encodeURIComponent(name)}`))).arrayBuffer());
}

const arrayUrl = ({ bake }: BakeConnection, array = ""): string =>
  `/api/bakes/${encodeURIComponent(bake)}/probes${array}?layout=${PROBES_LAYOUT}`;

effect(() => {
  if (isTexelNoteShown || rendererChoice.value !== "client" || !usesTexelShading.value) return;
  isTexelNoteShown = true;
  showNote(TEXEL_SHADING_NOTE);
});

effect(() => {
  const choice = rendererChoice.value;
  const { shown } = connections;
  if (isServerRendering.value || (choice === "auto" && clientRenderer?.isSoftware)) fallBackToServer(null);
  if (shown === null) return;
  if (choice !== "server") shown.isRenderingRejected = false;
  for (const view of shown.hello?.views ?? [])
    if (shown.pendingFrames.isDisplayed(view.name)) void offerClientRendering(shown, view.name);
});
