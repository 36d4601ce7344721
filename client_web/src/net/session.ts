/** One live session with a bake: sends the newest look, acknowledges frames, hands out what comes. */
import type { Change } from "../document/change";
import { differenceOf } from "../document/difference";
import { isWayOfLooking } from "../document/pointer";
import type {
  BakeMessage,
  ClientMessage,
  CurveMessage,
  HelloMessage,
  Look,
  PatchOp,
  ProbeAnswer,
  ProblemMessage,
  RoomMessage,
  SharedMessage,
  StatusMessage,
} from "../protocol";
import { FrameError, parseFrame, type Frame } from "./binaryFrame";
import { EditQueue, type Wanted } from "./editQueue";
import { deliver, MessageError, type MessageHandlers } from "./messages";
import { LiveSocket, type Asked, type Connection } from "./socket";

const MAX_BUFFERED_BYTES = 1 << 20;

/** While so many edits wait for a frame that shows them, the next one grows newer instead, for so long at most: a server
 * that is busy with many hands need not read what it will never show. */
const MAX_AHEAD = 2;
const PATIENCE_MS = 100;

export interface SessionHandlers {
  connection(state: Connection, retryInMs: number, reason?: string): void;
  hello(message: HelloMessage): void;
  /** Resolves when the frame is on the screen. */
  frame(frame: Frame): Promise<void>;
  status(message: StatusMessage): void;
  problem(message: ProblemMessage, lastGood: Look | null): void;
  probe(message: ProbeAnswer): void;
  curve(message: CurveMessage): void;
  bake(message: BakeMessage): void;
  room(message: RoomMessage): void;
  /** Somebody has commented on the scene. */
  comments(): void;
  /** Others have edited the look; it has become this one, where there is one yet. */
  shared(message: SharedMessage, look: Look | null): void;
  sent(revision: number, inputTime: number): void;
  /** The look cannot be changed: the server lets this one only look. */
  readOnly(): void;
  /** The server will not have this session again; no use in trying. */
  ended(reason: string, code: number): void;
  broken(message: string): void;
}

export class Session {
  private readonly socket: LiveSocket;
  private readonly queue = new EditQueue();
  private readonly messages: MessageHandlers;
  private scheduled = false;
  private sentThisFrame = false;
  /** Newest revision that a frame has shown, and when the last edit went. */
  private shownRevision = 0;
  private sentTime = 0;
  /** The look that there is for one who may change only ways of looking at it; null for who may edit. */
  private fixed: Look | null = null;
  /** How often the room's look had changed when others changed it last. */
  shared = 0;

  constructor(
    readonly bake: string,
    private readonly handlers: SessionHandlers,
    asked?: Asked,
  ) {
    this.socket = new LiveSocket(bake, {
      connection: (state, retryInMs, reason) => handlers.connection(state, retryInMs, reason),
      received: (data) => this.receive(data),
      ended: (reason, code) => handlers.ended(reason, code),
    }, asked);
    this.messages = {
      hello: (message) => this.welcome(message),
      status: (message) => handlers.status(message),
      problem: (message) => handlers.problem(message, this.refused(message)),
      probe: (message) => handlers.probe(message),
      curve: (message) => handlers.curve(message),
      bake: (message) => handlers.bake(message),
      room: (message) => handlers.room(message),
      comments: () => handlers.comments(),
      shared: (message) => this.follow(message),
      leaving: () => this.socket.leave(),
      pong: () => undefined, // that it came is all it says
    };
  }

  /** Of the newest edit that was sent to the server that is there. */
  get revision(): number {
    return this.queue.known;
  }

  /** Whether the server has yet to hear of the newest edit. */
  get pending(): boolean {
    return this.queue.pending;
  }

  connect(): void {
    this.socket.connect();
  }

  /** Try at once instead of waiting for the backoff. */
  reconnectNow(): void {
    this.socket.reconnectNow();
  }

  /** Ask the server whether it is still there. */
  check(): void {
    this.socket.check();
  }

  close(): void {
    this.socket.close();
  }

  private receive(data: string | ArrayBuffer): void {
    try {
      if (typeof data === "string") deliver(data, this.messages);
      else this.show(parseFrame(data));
    } catch (error) {
      if (!(error instanceof FrameError || error instanceof MessageError)) throw error;
      this.handlers.broken(error.message);
    }
  }

  private show(frame: Frame): void {
    this.queue.confirm(frame.header.revision);
    this.shownRevision = Math.max(this.shownRevision, frame.header.revision);
    const { number } = this.socket;
    const acknowledge = () => {
      if (number === this.socket.number) this.send({ type: "ack", frame: frame.header.frame });
    };
    this.handlers.frame(frame).then(acknowledge, acknowledge);
  }

  private refused({ revision }: ProblemMessage): Look | null {
    return revision == null ? null : this.queue.refuse(revision);
  }

  private welcome(message: HelloMessage): void {
    this.socket.greet(message.resume);
    const look = message.look as unknown as Look;
    this.fixed = message.role === "view" ? look : null;
    this.shared = 0;
    if (message.room === null || message.room.created) {
      this.queue.reset(look, message.revision, message.solo, message.room !== null);
    } else this.queue.join(look, message.revision, message.solo);
    this.shownRevision = this.queue.revision;
    this.handlers.hello(message);
    this.handlers.connection("open", 0);
    this.flush();
  }

  private follow(message: SharedMessage): void {
    const look = this.queue.follow(message.patch as PatchOp[], message.revision);
    if (this.fixed !== null) this.fixed = look;
    if (message.patch.length > 0) this.shared = message.shared;
    if (message.patch.length > 0) this.handlers.shared(message, look);
  }

  /** The look that is wanted, with what others made of it. */
  get look(): Look | null {
    return this.queue.look;
  }

  /** What was edited and may not have come to the room. */
  get unconfirmed(): readonly PatchOp[] {
    return this.queue.unconfirmed();
  }

  /** What to show from now on, and the edit that made it; sent at once, then at most once per animation frame. */
  want(wanted: Wanted, change: Change | null = null): void {
    if (this.fixed !== null && !differenceOf(this.fixed, wanted.look).every(({ path }) => isWayOfLooking(path))) {
      return this.handlers.readOnly();
    }
    this.queue.want(wanted, change);
    if (this.sentThisFrame) this.schedule();
    else this.flush();
  }

  private schedule(): void {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => {
      this.scheduled = false;
      this.sentThisFrame = false;
      if (this.queue.pending) this.flush();
    });
  }

  private flush(): void {
    if (!this.socket.isOpen || !this.queue.pending) return;
    if (this.socket.bufferedBytes < MAX_BUFFERED_BYTES && !this.isAhead) this.sendWanted();
    this.schedule();
  }

  private get isAhead(): boolean {
    const isRecent = performance.now() - this.sentTime < PATIENCE_MS;
    return isRecent && this.queue.revision - this.shownRevision >= MAX_AHEAD;
  }

  private sendWanted(): void {
    for (const { revision, patch, hand, solo, inputTime } of this.queue.take()) {
      this.send({ type: "edit", revision, patch: [...patch], hand, solo: solo && [...solo] });
      this.handlers.sent(revision, inputTime);
    }
    this.sentThisFrame = true;
    this.sentTime = performance.now();
  }

  /** Send a question about the look; the edits made before it go first. */
  ask(message: ClientMessage): boolean {
    if (this.queue.pending && this.socket.isOpen) this.sendWanted();
    return this.send(message);
  }

  /** Whether the message went. */
  send(message: ClientMessage): boolean {
    const isHold = message.type === "touch" && message.curve == null;
    if (this.fixed !== null && isHold) return false; // nothing of it is edited
    return this.socket.send(message);
  }
}
