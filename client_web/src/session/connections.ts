/** The connections to bakes: the shown one, and a pending one to a new bake until its first image is complete. */
import { Session, type SessionHandlers } from "./net/session";
import type { OpenParameters } from "./net/socket";
import { PendingFrames } from "../render/frameArrival";
import type { ClientMessage, HelloMessage } from "../protocol";
import { isOffline } from "../state/connection";
import { joinTarget } from "../state/sessionUser";
import { scene } from "../state/scene";
import { joinState, ownName, loadMemberToken } from "../state/collaboration";

/** Parameters that open a session: the shared look of a read-only user; the room and participant token of a member. */
function openParametersOf(): ReturnType<OpenParameters> {
  const sceneId = scene.peek()?.id;
  const currentJoin = joinState.peek();
  if (currentJoin !== null && currentJoin.scene === sceneId) {
    const { room: id, watch, share } = currentJoin;
    return { ...(id !== null ? { room: id } : { view_token: watch }), share, participant_token: loadMemberToken(currentJoin), name: ownName.peek() || null };
  }
  const { scene: watchedScene, ...look } = joinTarget.peek() ?? { scene: null };
  return watchedScene !== null && watchedScene === sceneId ? look : {};
}

/** A session with a bake, and its pending images. */
export class BakeConnection {
  readonly session: Session;
  /** The server's hello; null before. */
  hello: HelloMessage | null = null;
  /** Views whose first images are pending. */
  pendingFrames = new PendingFrames();
  /** The views last requested from the server, as text. */
  sentViews: string | null = null;
  /** The visible region of each view as last sent to the server, as text. */
  sentRegions = new Map<string, string>();
  /** True if the server knows that this browser draws free-camera views. */
  isRenderingAnnounced = false;
  /** True if this browser has failed to draw the bake. */
  isRenderingRejected = false;
  /** Number of lost graphics contexts of this bake. */
  numLostContexts = 0;
  /** Number of each view's camera as last sent to the server: images of earlier cameras are outdated. */
  readonly cameraSeqs = new Map<string, number>();

  constructor(
    readonly bake: string,
    handlersOf: (self: BakeConnection) => SessionHandlers,
  ) {
    this.session = new Session(bake, handlersOf(this), openParametersOf);
  }

  /** Reset after a (re)connection: the server knows of no views yet, and has sent no frames. */
  onHello(hello: HelloMessage): void {
    this.hello = hello;
    this.pendingFrames = new PendingFrames();
    this.sentViews = null;
    this.sentRegions.clear();
    this.isRenderingAnnounced = false;
  }
}

export const connections: { shown: BakeConnection | null; incoming: BakeConnection | null } = {
  shown: null,
  incoming: null,
};

/** Send a request to the shown bake; true if it was sent. */
export function sendToShown(message: ClientMessage): boolean {
  return connections.shown?.session.sendAfterEdits(message) ?? false;
}

export function reconnectNow(): void {
  connections.shown?.session.reconnectNow();
  connections.incoming?.session.reconnectNow();
}

/** Watch the browser's network state: ping the server when offline, reconnect immediately when online again. */
export function trackNetwork(): void {
  isOffline.value = !navigator.onLine;
  window.addEventListener("offline", () => {
    isOffline.value = true;
    connections.shown?.session.checkConnection();
    connections.incoming?.session.checkConnection();
  });
  window.addEventListener("online", () => {
    isOffline.value = false;
    reconnectNow();
  });
}

export function disconnectAll(): void {
  connections.shown?.session.close();
  connections.incoming?.session.close();
  connections.shown = connections.incoming = null;
}
