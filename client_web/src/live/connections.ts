/** The connections to bakes: that whose pictures are shown, and one on a finer bake until its first picture is there. */
import { Session, type SessionHandlers } from "../net/session";
import type { Asked } from "../net/socket";
import { Arrivals } from "../picture/arrival";
import type { ClientMessage, HelloMessage } from "../protocol";
import { offline } from "../state/connection";
import { watched } from "../state/me";
import { scene } from "../state/scene";
import { door, ownName, seatIn } from "../state/together";

/** Of one who only looks: with what a session begins; of those who work together: the room, and the place in it. */
function asked(): ReturnType<Asked> {
  const of = scene.peek()?.id;
  const room = door.peek();
  if (room !== null && room.scene === of) {
    const { room: id, watch, share } = room;
    return { ...(id !== null ? { room: id } : { watch }), share, seat: seatIn(room), name: ownName.peek() || null };
  }
  const { scene: watchedScene, ...look } = watched.peek() ?? { scene: null };
  return watchedScene !== null && watchedScene === of ? look : {};
}

/** A session with a bake, and what is on its way from it. */
export class BakeConnection {
  readonly session: Session;
  /** What the server said first; null until then. */
  hello: HelloMessage | null = null;
  /** Views whose first pictures are still on their way. */
  arrivals = new Arrivals();
  /** The views that the server was asked to show, as text. */
  toldViews: string | null = null;
  /** The part of each view that the server was told is on the screen, as text. */
  toldRegions = new Map<string, string>();
  /** The server was told that this browser draws moving views. */
  toldEvaluator = false;

  constructor(
    readonly bake: string,
    handlersOf: (self: BakeConnection) => SessionHandlers,
  ) {
    this.session = new Session(bake, handlersOf(this), asked);
  }

  /** The server is there, perhaps again: it knows of no views yet, and nothing of it has come. */
  greeted(hello: HelloMessage): void {
    this.hello = hello;
    this.arrivals = new Arrivals();
    this.toldViews = null;
    this.toldRegions.clear();
    this.toldEvaluator = false;
  }
}

export const connections: { shown: BakeConnection | null; incoming: BakeConnection | null } = {
  shown: null,
  incoming: null,
};

/** Send a question to the shown bake; whether it went. */
export function send(message: ClientMessage): boolean {
  return connections.shown?.session.ask(message) ?? false;
}

export function reconnectNow(): void {
  connections.shown?.session.reconnectNow();
  connections.incoming?.session.reconnectNow();
}

/** Heed what the browser says of its network: asks the server when it is gone, and connects at once when it is back. */
export function followNetwork(): void {
  offline.value = !navigator.onLine;
  window.addEventListener("offline", () => {
    offline.value = true;
    connections.shown?.session.check();
    connections.incoming?.session.check();
  });
  window.addEventListener("online", () => {
    offline.value = false;
    reconnectNow();
  });
}

export function disconnect(): void {
  connections.shown?.session.close();
  connections.incoming?.session.close();
  connections.shown = connections.incoming = null;
}
