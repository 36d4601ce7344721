/** The live session: connects the look to the server and the frames to the stage; swaps to a finer bake. */
import { effect } from "@preact/signals";
import { problemText, request } from "../net/api";
import type { Frame } from "../net/frame";
import { Session, type SessionHandlers } from "../net/session";
import { decodeIds } from "../picture/png16";
import { stage } from "../picture/stage";
import type { ClientMessage, HelloMessage, Look } from "../protocol";
import { attempt, note, showError } from "../ui/toasts";
import { onLook } from "./edit";
import { forgetShape, showShape } from "./shape";
import * as store from "./store";
import { editSent, forgetWaiting } from "./stats";

let session: Session | null = null;
/** A session on a finer bake, until its first picture is there. */
let incoming: Session | null = null;
let onBakeReady: (bake: string) => void = () => undefined;
const exactWaiters: (() => void)[] = [];

onLook((look, inputTime) => {
  session?.want(look, inputTime);
  incoming?.want(look, inputTime);
});

export function whenBakeIsReady(take: typeof onBakeReady): void {
  onBakeReady = take;
}

export function send(message: ClientMessage): boolean {
  return session?.ask(message) ?? false;
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

async function loadIds(bake: string, view: string): Promise<void> {
  await attempt(async () => {
    const path = `/api/bakes/${encodeURIComponent(bake)}/views/${encodeURIComponent(view)}/materials.png`;
    stage.setIds(await decodeIds(await (await request(path)).arrayBuffer()));
  });
}

/** What a new connection needs to know: which view, how to stream, and the look where it has another one. */
function welcome(of: Session, message: HelloMessage): void {
  const known = message.views.some((view) => view.name === store.viewName.peek());
  const name = known ? store.viewName.peek() : message.view;
  store.defaultLook.value ??= message.look as unknown as Look;
  if (store.look.peek() === null) store.look.value = message.look as unknown as Look;
  of.want(store.look.peek() as Look, performance.now());
  if (of === session) store.freezing.value = null;
  if (of === session) showViews(of, message.views, name);
  else pendingViews = message.views;
  const view = message.views.find((v) => v.name === name);
  if (view !== undefined) of.send({ type: "view", name, size: [view.width, view.height] });
  of.send({ type: "stream", format: "auto", quality: 80 });
  const curve = store.curvePath.peek();
  if (curve !== null) of.send({ type: "touch", curve });
}

let pendingViews: HelloMessage["views"] = [];

function showViews(of: Session, views: HelloMessage["views"], name: string): void {
  store.views.value = views;
  store.viewName.value = name;
  store.bake.value = of.bake;
  void loadIds(of.bake, name);
}

async function takeFrame(from: Session, frame: Frame): Promise<void> {
  if (from === incoming && frame.header.kind !== "brush") swap(from);
  if (store.coming.peek()?.id === from.bake) store.coming.value = null;
  if (from !== session || frame.header.view !== store.viewName.peek()) return;
  await stage.show(frame).catch(showError);
  if (frame.header.kind === "brush" || from !== session) return;
  store.exact.value = frame.header.exact && frame.header.revision >= from.revision;
  if (!store.exact.value) return;
  for (const done of exactWaiters.splice(0)) done();
}

function swap(to: Session): void {
  const old = session;
  session = to;
  incoming = null;
  old?.close();
  store.freezing.value = null;
  forgetWaiting();
  showViews(to, pendingViews, store.viewName.peek());
  store.coming.value = null;
  store.connection.value = "open";
  note("The finer bake is in place.");
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
      const { state, what, progress } = message;
      store.freezing.value = state === "ready" ? null : { state, what, progress };
    },
    problem(message, lastGood) {
      showError(`${problemText(message.problem)} The look is as it was before.`);
      if (!current() || message.revision === null) return;
      store.history.drop();
      if (lastGood !== null) {
        store.look.value = lastGood;
        self().want(lastGood, performance.now());
      }
    },
    probe(message) {
      const at = store.probe.peek();
      if (current() && at !== null) store.probe.value = { ...at, answer: message };
    },
    curve(message) {
      if (current() && message.curve === store.curvePath.peek()) showShape(message);
    },
    bake(message) {
      const { bake: id, state, progress, seconds_left } = message;
      if (state === "ready") onBakeReady(id);
      else store.coming.value = { id, state: state as "running", progress, seconds_left, problem: null };
    },
    sent(revision, inputTime) {
      if (!current()) return;
      store.exact.value = false;
      editSent(revision, inputTime);
    },
    ended(reason) {
      if (self() === incoming) incoming = null;
      showError(`The session has ended: ${reason}. Your look is kept here; bake again or reload.`);
    },
    broken: (text) =>
      showError(`The server's answer was not understood (${text}). The picture stays; reload if it does not follow.`),
  };
}

/** Resolves when the picture is exact for everything that was sent. */
export function whenExact(): Promise<void> {
  if (store.exact.peek()) return Promise.resolve();
  return new Promise((done) => exactWaiters.push(done));
}

/** Fetch the exact picture of another look while the canvas keeps what it shows. */
export async function fetchPicture(of: Look): Promise<ReturnType<typeof stage.capture>> {
  if (store.connection.peek() !== "open") throw new Error("There is no connection; try again when it is back.");
  const back = store.look.peek() as Look;
  stage.held = true;
  try {
    session?.want(of, performance.now());
    await new Promise((done) => requestAnimationFrame(done));
    await whenExact();
    return stage.capture();
  } finally {
    session?.want(store.look.peek() ?? back, performance.now());
    await new Promise((done) => requestAnimationFrame(done));
    await whenExact();
    stage.held = false;
    stage.redraw();
  }
}

export function chooseView(name: string): void {
  const view = store.views.peek().find((v) => v.name === name);
  if (view === undefined || session === null) return;
  store.viewName.value = name;
  stage.setIds(null);
  stage.setReference(null);
  session.send({ type: "view", name, size: [view.width, view.height] });
  void loadIds(session.bake, name);
}

effect(() => {
  const curve = store.curvePath.value;
  forgetShape();
  stage.clearBrush();
  if (curve !== null) send({ type: "touch", curve });
});
