/** The live session: connects the look to the server and the frames to the pictures; swaps to a finer bake. */
import { batch, effect, untracked } from "@preact/signals";
import { problemText, request } from "../net/api";
import type { Frame } from "../net/frame";
import { Session, type SessionHandlers } from "../net/session";
import { Arrivals, type Arrival } from "../picture/arrival";
import { worst } from "../picture/fidelity";
import { decodeIds } from "../picture/png16";
import { stage } from "../picture/stage";
import type { ClientMessage, HelloMessage, Look, ProbeAnswer } from "../protocol";
import { attempt, note, showError } from "../ui/toasts";
import { onLook } from "./edit";
import { forgetShape, showShape } from "./shape";
import { seenOf, wholeOf } from "./solo";
import * as store from "./store";
import { editSent, forgetDrawn, forgetWaiting } from "./stats";
import { availableOf } from "./views";

let session: Session | null = null;
/** A session on a finer bake, until its first picture is there. */
let incoming: Session | null = null;
let onBakeReady: (bake: string) => void = () => undefined;
/** Of each connection: which views' first pictures are still on their way. */
const arrivals = new WeakMap<Session, Arrivals>();
const exactWaiters: (() => void)[] = [];

/** Ask for the picture of the look as it is now, or of what shall be seen of it. */
function want(of: Session | null, look: Look, inputTime: number): void {
  of?.want(seenOf(look), inputTime);
}

function wantNow(look: Look, inputTime: number): void {
  want(session, look, inputTime);
  want(incoming, look, inputTime);
}

onLook(wantNow);

export function whenBakeIsReady(take: typeof onBakeReady): void {
  onBakeReady = take;
}

export function send(message: ClientMessage): boolean {
  return session?.ask(message) ?? false;
}

/** The hand was last on a slider, for which the server may have put the open curve away. */
let holding = false;

/** A hand has come to the slider of a parameter: the server prepares for it. */
export function hold(parameter: string): void {
  holding = true;
  send({ type: "touch", parameter });
}

/** The hand has come back to the open curve. */
export function holdCurve(): void {
  const curve = store.curvePath.peek();
  if (!holding || curve === null) return;
  holding = false;
  send({ type: "touch", curve });
}

export function reconnectNow(): void {
  session?.reconnectNow();
}

export function disconnect(): void {
  session?.close();
  incoming?.close();
  session = incoming = null;
}

/** Open a session; where there is one already, it goes on until the new one has a picture. */
export function connect(bake: string): void {
  incoming?.close();
  const opened: Session = new Session(
    bake,
    handlersOf(() => opened),
  );
  if (session === null) session = opened;
  else incoming = opened;
  opened.connect();
}

async function loadIds(bake: string, view: string, arrival: Arrival): Promise<void> {
  await attempt(async () => {
    const path = `/api/bakes/${encodeURIComponent(bake)}/views/${encodeURIComponent(view)}/materials.png`;
    arrival.ids = await decodeIds(await (await request(path)).arrayBuffer());
    const picture = stage.of(view);
    if (picture.idsOf === bake) picture.setIds(arrival.ids);
  });
}

/** The views that each connection was asked to show. */
const told = new WeakMap<Session, string>();

function arrivalsOf(of: Session): Arrivals {
  const known = arrivals.get(of) ?? new Arrivals();
  arrivals.set(of, known);
  return known;
}

/** What is shown of these views is not what the server has. */
function tellNothingExact(shown: string[]): void {
  for (const picture of shown.map((view) => stage.of(view))) {
    picture.exactRevision = -1;
    picture.fidelity = "approximate";
  }
  store.exact.value = false;
  sayFidelity();
}

function sayFidelity(): void {
  store.fidelity.value = worst(stage.shown.filter((each) => each.isThere).map((each) => each.fidelity));
}

/** Say which views are shown, where that is news, and which of them goes first. */
function tellViews(of: Session, shown: string[], focus: string): void {
  const names = JSON.stringify(shown);
  if (told.get(of) !== names) {
    if (!of.send({ type: "views", names: shown })) return;
    told.set(of, names);
    arrivalsOf(of).keep(shown);
    if (of === session) tellNothingExact(shown); // they are sent whole again
  }
  if (shown.length > 1 && shown.includes(focus)) of.send({ type: "focus", view: focus });
}

/** Of a bake's views, those that the user wants to see. */
function shownOf(views: HelloMessage["views"], fallback: string): string[] {
  const names = views.map((view) => view.name);
  return availableOf(store.shownViews.peek(), names, names.includes(fallback) ? fallback : (names[0] ?? fallback));
}

/** What a new connection needs to know: which views, how to stream, and the look where it has another one. */
function welcome(of: Session, message: HelloMessage): void {
  const own = message.look as unknown as Look;
  store.defaultLook.value ??= own;
  const kept = store.look.peek();
  // a look that was kept by an older editor lacks what that one did not know
  if (kept === null || Object.keys(own).some((section) => !(section in kept))) store.look.value = { ...own, ...kept };
  want(of, store.look.peek() as Look, performance.now());
  told.delete(of);
  arrivals.delete(of);
  const shown = shownOf(message.views, message.view);
  tellViews(of, shown, store.focusedView.peek());
  if (of === session) {
    store.freezing.value = null;
    showBake(of, message);
  } else pending = message;
  of.send({ type: "stream", format: "auto", quality: 80 });
  const curve = store.curvePath.peek();
  if (curve !== null) of.send({ type: "touch", curve });
}

/** Of a bake whose first picture is on its way. */
let pending: HelloMessage | null = null;

/** The view that the hand will be in when that bake is shown. */
function activeOf(hello: HelloMessage | null): string | null {
  if (hello === null) return null;
  const [shown, active] = [shownOf(hello.views, hello.view), store.viewName.peek()];
  return shown.includes(active) ? active : (shown[0] ?? null);
}

/** Follow a session from now on: its bake and views. */
function showBake(of: Session, { views, view, method }: HelloMessage): void {
  const shown = shownOf(views, view);
  batch(() => {
    store.views.value = views;
    store.shownViews.value = shown;
    if (!shown.includes(store.viewName.peek())) store.viewName.value = shown[0] as string;
    store.bake.value = of.bake;
    store.method.value = method;
  });
}

async function takeFrame(from: Session, frame: Frame): Promise<void> {
  const { view, kind } = frame.header;
  if (from !== incoming && (from !== session || !store.shownViews.peek().includes(view))) return;
  if (!arrivalsOf(from).isShown(view)) return kind === "brush" ? undefined : arrive(from, frame);
  await stage.of(view).show(frame).catch(showError);
  if (kind === "picture" && from === session) noteShown(from, frame.header);
}

/** Take a frame of a view whose first picture is on its way: what is shown stays until that is whole. */
async function arrive(from: Session, frame: Frame): Promise<void> {
  const { view } = frame.header;
  const isNew = arrivalsOf(from).get(view) === undefined;
  const arrival = arrivalsOf(from).take(frame);
  if (isNew && stage.of(view).idsOf !== from.bake) void loadIds(from.bake, view, arrival);
  if (!arrival.isWhole) return;
  if (from === session) return showArrived(from, view);
  await swapWhereWhole();
}

/** The new bake takes over once the view that the hand is in is whole; those beside it follow as they come. */
async function swapWhereWhole(): Promise<void> {
  const active = activeOf(pending);
  if (incoming === null || active === null) return;
  if (arrivalsOf(incoming).get(active)?.isWhole) await swap(incoming);
}

async function showArrived(of: Session, view: string): Promise<void> {
  const [arrival, picture] = [arrivalsOf(of).get(view), stage.of(view)];
  if (arrival === undefined) return;
  arrivalsOf(of).show(view);
  if (picture.idsOf !== of.bake) {
    picture.idsOf = of.bake;
    picture.setIds(arrival.ids);
  }
  if (store.coming.peek()?.id === of.bake) store.coming.value = null;
  await picture.showArrived(arrival).catch(showError);
  if (of === session) noteShown(of, arrival.header);
}

/** A frame is on the screen. */
function noteShown(of: Session, { view, exact, revision, fidelity }: Frame["header"]): void {
  const picture = stage.of(view);
  picture.exactRevision = exact ? revision : -1;
  picture.fidelity = fidelity;
  store.exact.value = stage.shown.every((each) => each.exactRevision >= of.revision);
  sayFidelity();
  if (!store.exact.value) return;
  for (const done of exactWaiters.splice(0)) done();
}

async function swap(to: Session): Promise<void> {
  const old = session;
  session = to;
  incoming = null;
  old?.close();
  store.freezing.value = null;
  forgetWaiting();
  if (pending !== null) showBake(to, pending);
  pending = null;
  store.connection.value = "open";
  const shown = store.shownViews.peek();
  tellNothingExact(shown);
  const whole = shown.filter((view) => arrivalsOf(to).get(view)?.isWhole);
  await Promise.all(whole.map((view) => showArrived(to, view)));
  note("The new bake is in place.");
}

function handlersOf(self: () => Session): SessionHandlers {
  const current = () => self() === session;
  return {
    connection(state, retryInMs) {
      if (!current()) return;
      store.connection.value = state;
      store.retryInMs.value = retryInMs;
    },
    hello: (message) => welcome(self(), message),
    frame: (frame) => takeFrame(self(), frame),
    status(message) {
      if (!current()) return;
      const { state, view, what, progress } = message;
      store.freezing.value = state === "ready" ? null : { state, view, what, progress };
    },
    problem(message, lastGood) {
      showError(`${problemText(message.problem)} The look is as it was before.`);
      if (!current() || message.revision === null) return;
      store.history.drop();
      if (lastGood !== null) {
        store.look.value = wholeOf(lastGood);
        want(self(), store.look.value, performance.now());
      }
    },
    probe(message) {
      for (const take of probeWaiters) take(message);
      const at = store.probe.peek();
      if (current() && at?.view === message.view) store.probe.value = { ...at, answer: message };
    },
    curve(message) {
      if (current() && message.curve === store.curvePath.peek()) showShape(message);
    },
    bake(message) {
      const { bake: id, state, progress, phase, seconds_left } = message;
      if (state === "ready") onBakeReady(id);
      else store.coming.value = { id, state: state as "running", progress, phase, seconds_left, problem: null };
    },
    sent(revision, inputTime) {
      if (!current()) return;
      store.exact.value = false;
      editSent(revision, inputTime);
    },
    ended(reason) {
      if (self() === incoming) incoming = pending = null;
      if (store.coming.peek()?.id === self().bake) store.coming.value = null;
      showError(`The session has ended: ${reason}. Your look is kept here; bake again or reload.`);
    },
    broken: (text) =>
      showError(`The server's answer was not understood (${text}). The picture stays; reload if it does not follow.`),
  };
}

const probeWaiters = new Set<(answer: ProbeAnswer) => void>();
const PROBE_MS = 3000;

/** What the server says of a pixel of a shown view. The newest question wins there, so another's answer asks again. */
export function askProbe(view: string, x: number, y: number): Promise<ProbeAnswer> {
  return new Promise((resolve, reject) => {
    const end = (): void => {
      clearTimeout(timer);
      probeWaiters.delete(take);
    };
    const ask = () => send({ type: "probe", view, x, y });
    const take = (answer: ProbeAnswer): void => {
      if (answer.view !== view || answer.x !== x || answer.y !== y) return void ask();
      end();
      resolve(answer);
    };
    const timer = window.setTimeout(() => {
      end();
      reject(new Error("The server did not say what is there; try again."));
    }, PROBE_MS);
    probeWaiters.add(take);
    ask();
  });
}

/** Whether the active view has a picture of the newest look, be it a first one. */
export function isDrawn(): boolean {
  return session !== null && !session.pending && stage.active.revision >= session.revision;
}

/** Resolves when the picture is exact for everything that was sent. */
export function whenExact(): Promise<void> {
  if (store.exact.peek()) return Promise.resolve();
  return new Promise((done) => exactWaiters.push(done));
}

/** Fetch the exact pictures of another look and take them, while the screens keep what they show. */
export async function withPicturesOf(of: Look, take: () => void): Promise<void> {
  if (store.connection.peek() !== "open") throw new Error("There is no connection; try again when it is back.");
  const back = store.look.peek() as Look;
  store.held.value = true;
  try {
    want(session, of, performance.now());
    await new Promise((done) => requestAnimationFrame(done));
    await whenExact();
    take();
  } finally {
    want(session, store.look.peek() ?? back, performance.now());
    await new Promise((done) => requestAnimationFrame(done));
    await whenExact();
    store.held.value = false;
  }
}

effect(() => {
  const [shown, focus] = [store.shownViews.value, store.focusedView.value];
  if (session !== null && shown.length > 0) tellViews(session, shown, focus);
  if (incoming !== null && pending !== null) tellViews(incoming, shownOf(pending.views, pending.view), focus);
});

// the hand may come to a view that was whole before
effect(() => {
  store.viewName.value;
  store.shownViews.value;
  untracked(() => void swapWhereWhole());
});

// revisions that the view has already drawn while another one was counted tell nothing about the time they took
effect(() => forgetDrawn(stage.of(store.focusedView.value).revision));

effect(() => {
  store.soloLight.value;
  store.seenPaths.value;
  const look = store.look.peek();
  if (look !== null) wantNow(look, performance.now());
});

effect(() => {
  const curve = store.curvePath.value;
  forgetShape();
  stage.clearBrush();
  holding = false;
  if (curve !== null) send({ type: "touch", curve });
});
