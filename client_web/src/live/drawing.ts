/** Moving views that this browser draws itself: nothing goes over the network for an eye that moves. The server says
 * what a look makes (frames of kind "tables"), and sends exact pictures as ever; where it has not caught up, or the
 * browser cannot draw, it sends all pictures. */
import { computed, effect, signal } from "@preact/signals";
import { Evaluator } from "../evaluator/evaluator";
import { isSoftware } from "../evaluator/software";
import { getJson, request } from "../net/api";
import type { Frame } from "../net/binaryFrame";
import { MAX_EYE_PIXELS, SURFACE_LAYOUT, type FrameHeader, type SurfaceBody } from "../protocol";
import { noteDrawnHere } from "../state/latency";
import { hasTexels } from "../state/look";
import { views } from "../state/views";
import { note } from "../ui/toasts";
import { connections, type BakeConnection } from "./connections";
import { takeFrame } from "./swap";

export type Draws = "auto" | "browser" | "server";

const KEY = "relume.drawnBy";
const SLOW_MS = 80;
const TRIALS = 8;
/** Of a bake; a browser that loses more of them is left alone. */
const MOST_LOST_CONTEXTS = 3;
/** What lobes alone ask for; it is more than everything else. */
const OF_LOBES = "seen_lights";

/** Who draws moving views, as the user wants it. */
export const drawnBy = signal<Draws>(readChoice());
/** Whether this browser does. */
export const drawsHere = signal(false);

interface Here {
  of: BakeConnection;
  evaluator: Evaluator;
  /** The last tables of each view. */
  headers: Map<string, FrameHeader>;
  /** Resolves when what lobes ask for is there. */
  ofLobes: Promise<void> | null;
}

let here: Here | null = null;
let loading: BakeConnection | null = null;
/** Bakes that this browser has failed to draw. */
const refused = new WeakSet<BakeConnection>();
/** How many graphics contexts were lost while they were drawn. */
const lost = new WeakMap<BakeConnection, number>();
/** Whether the server draws: it was chosen, or the choice is left to us and it shows what this browser cannot. */
const isServers = computed(() => drawnBy.value === "server" || (drawnBy.value === "auto" && hasTexels.value));
const eyes = new Map<string, number>();
const away = new Set<string>();
const dirty = new Set<string>();
/** Views of which the server sent a picture that is wanted while one was being drawn here, older than it. */
const overtaken = new Set<string>();
/** Of each view: who waits for its next picture. A hand that goes on moving must not keep frames from being acknowledged. */
const waiting = new Map<string, (() => void)[]>();
let running: Promise<void> | null = null;
let durations: number[] = [];

function readChoice(): Draws {
  try {
    const kept = localStorage.getItem(KEY);
    return kept === "browser" || kept === "server" ? kept : "auto";
  } catch {
    return "auto"; // a browser that keeps nothing
  }
}

export function chooseDrawnBy(choice: Draws): void {
  localStorage.setItem(KEY, choice);
  drawnBy.value = choice;
}

/** The size of a moving view's pictures. */
export function eyeSize(width: number, height: number): [number, number] {
  const scale = Math.min(1, Math.sqrt(MAX_EYE_PIXELS / (width * height)));
  return [Math.floor(width * scale), Math.floor(height * scale)];
}

/** The server was told of this eye: pictures of others are late. */
export function told(view: string, eye: number): void {
  eyes.set(view, eye);
}

/** A view's eye is, or is no longer, on its way without the server. */
export function leave(view: string, isAway: boolean): void {
  if (isAway) away.add(view);
  else away.delete(view);
}

/** Whether a view's eye is on its way without the server. */
export const isAway = (view: string): boolean => away.has(view);

/** Draw a view from where its eye is now; false where the server has to. */
export function drawHere(view: string): boolean {
  const { shown } = connections;
  if (here === null || here.of !== shown || !here.evaluator.isReady || !drawsHere.peek()) return false;
  if (shown.session.pending || here.headers.get(view)?.revision !== shown.session.revision) return false;
  void redraw(view);
  return true;
}

/** Take a frame of a server. */
export async function take(from: BakeConnection, frame: Frame): Promise<void> {
  const { view, kind, eye } = frame.header;
  if (kind === "tables") return takeTables(from, frame);
  const isDrawn = drawsHere.peek() && here?.of === from && kind === "picture";
  const isLate = isDrawn && (away.has(view) || (eyes.has(view) && eye !== null && eyes.get(view) !== eye));
  if (isLate) return;
  if (kind === "picture") {
    overtaken.add(view);
    dirty.delete(view);
  }
  await takeFrame(from, frame);
  void offer(from, view);
}

async function takeTables(from: BakeConnection, frame: Frame): Promise<void> {
  const { header, payload } = frame;
  if (here?.of !== from || header.tables === null) return;
  here.evaluator.take(header.tables, payload);
  here.headers.set(header.view, header);
  if (here.evaluator.lacksSeenLights) {
    try {
      await (here.ofLobes ??= loadOfLobes(here));
    } catch (error) {
      return giveUp(`${(error as Error).message}; the server draws instead.`);
    }
  }
  return redraw(header.view);
}

async function loadOfLobes({ of, evaluator }: Here): Promise<void> {
  evaluator.keep(OF_LOBES, await loadArray(of, OF_LOBES));
}

/** One picture at a time, each from the newest eye; resolves when the view has been drawn once, or will not be. */
function redraw(view: string): Promise<void> {
  dirty.add(view);
  const isDrawn = new Promise<void>((done) => waiting.set(view, [...(waiting.get(view) ?? []), done]));
  running ??= drawAll().finally(() => {
    running = null;
    for (const asked of waiting.values()) for (const done of asked) done();
    waiting.clear();
  });
  return isDrawn;
}


async function drawAll(): Promise<void> {
  for (let view = first(dirty); view !== undefined && here !== null; view = first(dirty)) {
    dirty.delete(view);
    overtaken.delete(view);
    const { of } = here;
    const start = performance.now();
    const asked = waiting.get(view) ?? [];
    waiting.delete(view);
    try {
      const frame = await drawn(here, view);
      if (frame !== null && here?.of === of && !overtaken.has(view)) await takeFrame(of, frame);
    } catch (error) {
      if (here?.of !== of) return;
      return here.evaluator.isLost ? loseContext() : giveUp(`${(error as Error).message}; the server draws instead.`);
    } finally {
      for (const done of asked) done();
    }
    judge(performance.now() - start);
  }
}

const first = (of: Set<string>): string | undefined => of.values().next().value;

/** A frame as the server would have sent it. */
async function drawn({ evaluator, headers }: Here, name: string): Promise<Frame | null> {
  const [view, header] = [views.peek().find((other) => other.name === name), headers.get(name)];
  if (view === undefined || header === undefined) return null;
  const { width, height, words, hides } = await evaluator.draw(view.camera, ...eyeSize(view.width, view.height));
  noteDrawnHere();
  const whole = { tiles: [[0, 0, width, height]] as FrameHeader["tiles"], format: "rgb9e5" as const, kind: "picture" as const };
  return { header: { ...header, ...whole, width, height, alpha: hides !== null, tables: null }, payload: words, alpha: hides };
}

/** Where it was not asked for, drawing here goes on only as long as it is quick. */
function judge(ms: number): void {
  durations = [...durations.slice(1 - TRIALS), ms];
  const middle = [...durations].sort((a, b) => a - b)[TRIALS >> 1];
  if (drawnBy.peek() === "auto" && durations.length === TRIALS && (middle ?? 0) > SLOW_MS) giveUp(null);
}

/** The server draws until all is loaded anew, which its next picture begins. */
function loseContext(): void {
  if (here === null) return;
  const { of } = here;
  const times = 1 + (lost.get(of) ?? 0);
  lost.set(of, times);
  if (times > MOST_LOST_CONTEXTS) return giveUp("This browser keeps losing its graphics context; the server draws instead.");
  handOver();
}

/** The server draws from now on, until somebody wishes otherwise. */
function giveUp(reason: string | null): void {
  if (here === null) return;
  refused.add(here.of);
  handOver();
  if (reason !== null) note(reason);
}

function handOver(): void {
  if (here === null) return;
  const { of, evaluator } = here;
  here = null;
  drawsHere.value = false;
  dirty.clear();
  away.clear();
  evaluator.release();
  of.session.send({ type: "evaluate", by: "server" });
  of.toldEvaluator = false;
}

/** A picture of a view is shown: from now on this browser may draw it. */
async function offer(of: BakeConnection, view: string): Promise<void> {
  const isFree = of.hello?.views.find(({ name }) => name === view)?.eye === "free";
  if (!isFree || of !== connections.shown || isServers.peek() || refused.has(of)) return;
  if (here?.of === of) return tellWhereNeeded(here);
  if (loading === of) return;
  loading = of;
  try {
    const made = await load(of);
    if (made === null) return;
    if (of !== connections.shown || isServers.peek()) return made.evaluator.release();
    here?.evaluator.release();
    here = made;
    durations = [];
    tellWhereNeeded(made);
  } catch (error) {
    refused.add(of);
    if (drawnBy.peek() === "browser") note(`${(error as Error).message}; the server draws instead.`);
  } finally {
    loading = null;
  }
}

/** The server that greets knows nothing of who draws. */
function tellWhereNeeded({ of, headers }: Here): void {
  if (of.toldEvaluator) return;
  headers.clear();
  of.toldEvaluator = of.session.send({ type: "evaluate", by: "browser" });
  drawsHere.value = of.toldEvaluator;
}

/** Everything of a bake that never changes; null where this browser would draw with its processor. */
async function load(of: BakeConnection): Promise<Here | null> {
  const gl = new OffscreenCanvas(1, 1).getContext("webgl2", { antialias: false });
  if (gl === null) throw new Error("This browser offers no WebGL2");
  if (drawnBy.peek() === "auto" && isSoftware(gl)) {
    refused.add(of);
    return null;
  }
  const surface = await getJson<SurfaceBody>(pathOf(of));
  if (surface.has_holes) throw new Error("This browser cannot draw glass or surfaces with holes");
  const names = surface.arrays.filter((name) => name !== OF_LOBES);
  const arrays = await Promise.all(names.map(async (name) => [name, await loadArray(of, name)] as const));
  return { of, evaluator: new Evaluator(gl, surface, new Map(arrays)), headers: new Map(), ofLobes: null };
}

async function loadArray(of: BakeConnection, name: string): Promise<Uint8Array> {
  return new Uint8Array(await (await request(pathOf(of, `/${encodeURIComponent(name)}`))).arrayBuffer());
}

const pathOf = ({ bake }: BakeConnection, array = ""): string =>
  `/api/bakes/${encodeURIComponent(bake)}/surface${array}?layout=${SURFACE_LAYOUT}`;

effect(() => {
  const choice = drawnBy.value;
  const { shown } = connections;
  if (isServers.value || (choice === "auto" && here?.evaluator.isSoftware === true)) giveUp(null);
  if (shown === null) return;
  if (choice !== "server") refused.delete(shown);
  for (const view of shown.hello?.views ?? []) if (shown.arrivals.isShown(view.name)) void offer(shown, view.name);
});
