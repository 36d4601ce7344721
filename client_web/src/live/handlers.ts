/** What each message of a server does to what the editor knows. */
import { passing } from "../edit/edit";
import { history } from "../edit/history";
import { problemText } from "../net/api";
import type { SessionHandlers } from "../net/session";
import { LOGIN_CODE } from "../net/socket";
import type { HelloMessage, Look } from "../protocol";
import { wholeOf } from "../seen/paths";
import { coming } from "../state/bakes";
import { connection, freezing, refusedBecause, retryInMs } from "../state/connection";
import { showShape } from "../state/curveShape";
import { exact, isOutdated } from "../state/fidelity";
import { editSent, forgetWaiting } from "../state/latency";
import { defaultLook, look } from "../state/look";
import { loginWords, mayEdit, readOnlyWords } from "../state/me";
import { probe } from "../state/probe";
import { curvePath } from "../state/selection";
import { door, people, you } from "../state/together";
import { focusedView } from "../state/views";
import { mended, showError } from "../ui/toasts";
import { connections, type BakeConnection } from "./connections";
import { take } from "./drawing";
import { answered } from "./probing";
import { showBake } from "./swap";
import { tellRegions } from "./tellRegions";
import { shownOf, tellEyes, tellViews } from "./tellViews";
import { comeIn, followShared } from "./together";
import { want } from "./want";

let onBakeReady: (bake: string) => void = () => undefined;

/** Who is told that a bake of the scene is ready. */
export function whenBakeIsReady(take: typeof onBakeReady): void {
  onBakeReady = take;
}

let onComments: () => void = () => undefined;

/** Who is told that others have commented. */
export function whenCommented(take: typeof onComments): void {
  onComments = take;
}

/** The look from a server's first one: a look that was kept goes on, with what an older editor did not know of. Who waited
 * for a look, as a link does, may have changed it when this returns. */
function takeUp(own: Look): void {
  const kept = look.peek();
  if (!mayEdit.peek()) look.value = own;
  else if (kept === null || !Object.keys(own).every((section) => section in kept)) look.value = { ...own, ...kept };
}

/** What a new connection needs to know: which views, how to stream, and the look where it has another one. */
function welcome(of: BakeConnection, hello: HelloMessage): void {
  of.greeted(hello);
  defaultLook.value ??= (hello.room?.default ?? hello.look) as unknown as Look;
  if (!comeIn(of, hello)) {
    takeUp(hello.look as unknown as Look);
    want(of, look.peek() as Look, performance.now());
  }
  tellViews(of, shownOf(hello), focusedView.peek());
  tellEyes(of, hello);
  tellRegions(of);
  if (of === connections.shown) {
    freezing.value = null;
    showBake(of);
  }
  of.session.send({ type: "stream", format: "auto", quality: 80 });
  const curve = curvePath.peek();
  if (curve !== null) of.session.send({ type: "touch", curve });
}

/** The server has refused the edit that was made last: what it took before is shown again. */
function takeBack(of: BakeConnection, lastGood: Look | null): void {
  if (passing.peek() === null) history.drop();
  passing.value = null;
  if (lastGood === null) return;
  look.value = wholeOf(lastGood);
  want(of, look.value, performance.now());
}

export function handlersOf(self: BakeConnection): SessionHandlers {
  const isShown = () => self === connections.shown;
  return {
    connection(state, retryIn, reason) {
      if (!isShown()) return;
      if (state === "open" && connection.peek() === "silent") forgetWaiting();
      connection.value = state;
      if (state === "open") mended("server");
      retryInMs.value = retryIn;
      if (state === "open" || retryIn > 0) refusedBecause.value = reason ?? null;
    },
    hello: (message) => welcome(self, message),
    frame: (frame) => take(self, frame),
    status({ state, view, what, progress }) {
      if (isShown()) freezing.value = state === "ready" ? null : { state, view, what, progress };
    },
    problem({ problem, revision }, lastGood) {
      if (revision === null) showError(problemText(problem));
      else showError(`${problemText(problem)} The look is as it was before.`, "edit");
      if (isShown() && revision !== null) takeBack(self, lastGood);
    },
    probe(message) {
      answered(message);
      const at = probe.peek();
      if (isShown() && at?.view === message.view) probe.value = { ...at, answer: message };
    },
    curve(message) {
      if (isShown() && message.curve === curvePath.peek()) showShape(message);
    },
    room(message) {
      if (!isShown() || door.peek() === null) return;
      people.value = message.people;
      you.value = message.you;
    },
    comments: () => onComments(),
    shared: (message, shared) => followShared(self, message, shared),
    bake({ bake: id, state, progress, phase, seconds_left }) {
      if (state === "ready") onBakeReady(id);
      else coming.value = { id, state: state as "running", progress, phase, seconds_left, problem: null };
    },
    sent(revision, inputTime) {
      if (!isShown()) return;
      exact.value = false;
      isOutdated.value = true;
      editSent(revision, inputTime);
    },
    readOnly: () => showError(readOnlyWords.value),
    ended(reason, code) {
      if (self === connections.incoming) connections.incoming = null;
      if (coming.peek()?.id === self.bake) coming.value = null;
      if (code === LOGIN_CODE) loginWords.value = `${reason}. What you have edited is kept in this tab.`;
      else showError(`The session has ended: ${reason}. Your look is kept here; bake again or reload.`);
    },
    broken: (text) =>
      showError(`The server's answer was not understood (${text}). The picture stays; reload if it does not follow.`),
  };
}
