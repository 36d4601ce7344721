/** Applies each server message to the editor's state. */
import { previewedStep } from "../edit/edit";
import { history } from "../edit/history";
import { problemText } from "./net/api";
import type { SessionHandlers } from "./net/session";
import { LOGIN_CODE } from "./net/socket";
import type { HelloMessage, Look } from "../protocol";
import { fullLookOf } from "../state/visibility/lightPaths";
import { pendingBake } from "../state/bakes";
import { connection, freezeStatus, rejectionMessage, retryInMs } from "../state/connection";
import { showCurvePreview } from "../state/curvePreview";
import { isFrameExact, isOutdated } from "../state/fidelity";
import { recordEditSent, clearPendingEdits } from "../state/latency";
import { defaultLook, look } from "../state/look";
import { loginMessage, mayEdit, readOnlyMessage } from "../state/sessionUser";
import { pixelProbe } from "../state/pointerPixel";
import { curvePath } from "../state/selection";
import { joinState, members, selfNumber } from "../state/collaboration";
import { focusedView } from "../state/views";
import { clearErrors, showError } from "../ui/toasts";
import { connections, type BakeConnection } from "./connections";
import { onFrame } from "./clientRendering";
import { deliverPath } from "./pathTracing";
import { deliverProbe } from "./pixelProbe";
import { applyBake } from "./bakeSwap";
import { sendRegions } from "./sendRegions";
import { shownViewsOf, sendCameras, sendViews } from "./sendViews";
import { joinRoom, onRoomUpdate } from "./roomSync";
import { requestFrames } from "./requestFrames";

let onBakeReady: (bake: string) => void = () => undefined;

/** Called when a bake of the scene is ready. */
export function setBakeReadyListener(callback: typeof onBakeReady): void {
  onBakeReady = callback;
}

let onComments: () => void = () => undefined;

/** Called when others comment. */
export function onComment(callback: typeof onComments): void {
  onComments = callback;
}

/** Set the look after the server's hello: a stored look stays, completed by fields of a newer server. Callbacks waiting
 * for a look, as for a link, may have changed it when this returns. */
function adoptLook(serverLook: Look): void {
  const currentLook = look.peek();
  if (!mayEdit.peek()) look.value = serverLook;
  else if (currentLook === null || !Object.keys(serverLook).every((section) => section in currentLook))
    look.value = { ...serverLook, ...currentLook };
}

/** Send a new connection its settings: views, streaming, and the look if it differs. */
function handleHello(bakeConnection: BakeConnection, hello: HelloMessage): void {
  bakeConnection.onHello(hello);
  defaultLook.value ??= (hello.room?.default_look ?? hello.look) as unknown as Look;
  if (!joinRoom(bakeConnection, hello)) {
    adoptLook(hello.look as unknown as Look);
    requestFrames(bakeConnection, look.peek() as Look, performance.now());
  }
  sendViews(bakeConnection, shownViewsOf(hello), focusedView.peek());
  sendCameras(bakeConnection, hello);
  sendRegions(bakeConnection);
  if (bakeConnection === connections.shown) {
    freezeStatus.value = null;
    applyBake(bakeConnection);
  }
  bakeConnection.session.send({ type: "encoding", format: "auto", quality: 80 });
  const curve = curvePath.peek();
  if (curve !== null) bakeConnection.session.send({ type: "prepare", curve });
}

/** The server has rejected the last edit: show the last accepted look. */
function revertLook(bakeConnection: BakeConnection, lastGood: Look | null): void {
  if (previewedStep.peek() === null) history.dropLastStep();
  previewedStep.value = null;
  if (lastGood === null) return;
  look.value = fullLookOf(lastGood);
  requestFrames(bakeConnection, look.value, performance.now());
}

export function makeSessionHandlers(source: BakeConnection): SessionHandlers {
  const isShown = () => source === connections.shown;
  return {
    connection(state, retryIn, reason) {
      if (!isShown()) return;
      if (state === "open" && connection.peek() === "silent") clearPendingEdits();
      connection.value = state;
      if (state === "open") clearErrors("server");
      retryInMs.value = retryIn;
      if (state === "open" || retryIn > 0) rejectionMessage.value = reason ?? null;
    },
    hello: (message) => handleHello(source, message),
    frame: (frame) => onFrame(source, frame),
    status({ state, view, label, progress }) {
      if (isShown()) freezeStatus.value = state === "ready" ? null : { state, view, label, progress };
    },
    problem({ problem, revision }, lastGood) {
      if (revision === null) showError(problemText(problem));
      else showError(`${problemText(problem)} The look was reset to the last accepted state.`, "edit");
      if (isShown() && revision !== null) revertLook(source, lastGood);
    },
    inspect(message) {
      deliverProbe(message);
      const pixel = pixelProbe.peek();
      if (isShown() && pixel?.view === message.view) pixelProbe.value = { ...pixel, answer: message };
    },
    path: (message) => deliverPath(message),
    curve(message) {
      if (isShown() && message.curve === curvePath.peek()) showCurvePreview(message);
    },
    room(message) {
      if (!isShown() || joinState.peek() === null) return;
      members.value = message.people;
      selfNumber.value = message.self_id;
    },
    comments: () => onComments(),
    roomUpdate: (message, sharedLook) => onRoomUpdate(source, message, sharedLook),
    bake({ bake: id, state, progress, phase, seconds_left }) {
      if (state === "ready") onBakeReady(id);
      else pendingBake.value = { id, state: state as "running", progress, phase, seconds_left, problem: null };
    },
    onEditSent(revision, inputTime) {
      if (!isShown()) return;
      isFrameExact.value = false;
      isOutdated.value = true;
      recordEditSent(revision, inputTime);
    },
    readOnly: () => showError(readOnlyMessage.value),
    ended(reason, code) {
      if (source === connections.incoming) connections.incoming = null;
      if (pendingBake.peek()?.id === source.bake) pendingBake.value = null;
      if (code === LOGIN_CODE) loginMessage.value = `${reason}. Your edits are kept in this tab.`;
      else showError(`Session ended: ${reason}. Your look is kept. Reload the page or bake again.`);
    },
    invalidMessage: (text) => showError(`Something went wrong (${text}). Reload if the picture stops updating.`),
  };
}
