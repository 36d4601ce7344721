/** The connections to bakes: that whose pictures are shown, and one on a finer bake until its first picture is there. */
import { Session, type SessionHandlers } from "../net/session";
import { Arrivals } from "../picture/arrival";
import type { ClientMessage, HelloMessage } from "../protocol";
import { watched } from "../state/me";
import { scene } from "../state/scene";

/** Of one who only looks: with what a session begins. */
function begins(): Record<string, string> {
  const { scene: of, ...look } = watched.peek() ?? { scene: null };
  return of !== null && of === scene.peek()?.id ? look : {};
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
  /** The server was told that this browser draws moving views. */
  toldEvaluator = false;

  constructor(
    readonly bake: string,
    handlersOf: (self: BakeConnection) => SessionHandlers,
  ) {
    this.session = new Session(bake, handlersOf(this), begins());
  }

  /** The server is there, perhaps again: it knows of no views yet, and nothing of it has come. */
  greeted(hello: HelloMessage): void {
    this.hello = hello;
    this.arrivals = new Arrivals();
    this.toldViews = null;
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
}

export function disconnect(): void {
  connections.shown?.session.close();
  connections.incoming?.session.close();
  connections.shown = connections.incoming = null;
}
