/** One live session with a bake: connects, reconnects, sends the newest look, hands out what comes. */
import {
  SUBPROTOCOL,
  type BakeMessage,
  type ClientMessage,
  type CurveMessage,
  type HelloMessage,
  type Look,
  type ProbeAnswer,
  type ProblemMessage,
  type ServerMessage,
  type StatusMessage,
} from "../protocol";
import { backoffMs } from "./backoff";
import { FrameError, parseFrame, type Frame } from "./frame";
import { EditQueue } from "./queue";

const MAX_BUFFERED_BYTES = 1 << 20;
/** Another version of the protocol, no such bake, not ready, damaged: trying again gives the same. */
const FINAL_CODES = new Set([1002, 4404, 4409, 4410]);

export type Connection = "connecting" | "open" | "reconnecting" | "closed";

export interface SessionHandlers {
  connection(state: Connection, retryInMs: number): void;
  hello(message: HelloMessage): void;
  /** Resolves when the frame is on the screen. */
  frame(frame: Frame): Promise<void>;
  status(message: StatusMessage): void;
  problem(message: ProblemMessage, lastGood: Look | null): void;
  probe(message: ProbeAnswer): void;
  curve(message: CurveMessage): void;
  bake(message: BakeMessage): void;
  sent(revision: number, inputTime: number): void;
  /** The server will not have this session again; no use in trying. */
  ended(reason: string): void;
  broken(message: string): void;
}

export class Session {
  private socket: WebSocket | null = null;
  private attempt = 0;
  private retry = 0;
  private ready = false;
  private closed = false;
  private scheduled = false;
  private sentThisFrame = false;
  private readonly queue = new EditQueue();
  /** Names this session to the server, so that a lost connection finds its look again. */
  private resume: string | null = null;

  constructor(
    readonly bake: string,
    private readonly handlers: SessionHandlers,
  ) {}

  /** Of the newest edit that was sent. */
  get revision(): number {
    return this.queue.revision;
  }

  /** Whether the server has yet to hear of the newest edit. */
  get pending(): boolean {
    return this.queue.pending;
  }

  connect(): void {
    this.handlers.connection(this.attempt === 0 ? "connecting" : "reconnecting", 0);
    const url = new URL(`/api/bakes/${encodeURIComponent(this.bake)}/session`, location.href);
    url.protocol = url.protocol.replace("http", "ws");
    if (this.resume !== null) url.searchParams.set("resume", this.resume);
    const socket = new WebSocket(url, SUBPROTOCOL);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.receive(event.data);
    socket.onclose = (event) => this.lost(socket, event);
    this.socket = socket;
  }

  private lost(socket: WebSocket, event: CloseEvent): void {
    if (this.closed || socket !== this.socket) return;
    this.ready = false;
    if (FINAL_CODES.has(event.code)) {
      this.close();
      this.handlers.ended(event.reason || `code ${event.code}`);
      return;
    }
    const wait = backoffMs(this.attempt++);
    // a token that was refused once is not tried for ever
    if (this.attempt > 3) this.resume = null;
    this.handlers.connection("reconnecting", wait);
    this.retry = window.setTimeout(() => this.connect(), wait);
  }

  /** Try at once instead of waiting for the backoff. */
  reconnectNow(): void {
    if (this.ready || this.closed) return;
    clearTimeout(this.retry);
    this.connect();
  }

  private receive(data: string | ArrayBuffer): void {
    if (typeof data === "string") {
      this.receiveText(data);
      return;
    }
    try {
      const frame = parseFrame(data);
      this.queue.confirm(frame.header.revision);
      const acknowledge = () => void this.send({ type: "ack", frame: frame.header.frame });
      this.handlers.frame(frame).then(acknowledge, acknowledge);
    } catch (error) {
      if (!(error instanceof FrameError)) throw error;
      this.handlers.broken(error.message);
    }
  }

  private receiveText(text: string): void {
    let message: ServerMessage;
    try {
      message = JSON.parse(text) as ServerMessage;
    } catch {
      this.handlers.broken("the server sent a message that is not JSON");
      return;
    }
    switch (message.type) {
      case "hello":
        return this.welcome(message);
      case "status":
        return this.handlers.status(message);
      case "problem": {
        const lastGood = message.revision == null ? null : this.queue.refuse(message.revision);
        return this.handlers.problem(message, lastGood);
      }
      case "probe":
        return this.handlers.probe(message);
      case "curve":
        return this.handlers.curve(message);
      case "bake":
        return this.handlers.bake(message);
    }
  }

  private welcome(message: HelloMessage): void {
    this.attempt = 0;
    this.ready = true;
    this.resume = message.resume;
    this.queue.reset(message.look as unknown as Look, message.revision);
    this.handlers.hello(message);
    this.handlers.connection("open", 0);
    this.flush();
  }

  /** The look to show from now on; sent at once, then at most once per animation frame. */
  want(look: Look, inputTime: number): void {
    this.queue.want(look, inputTime);
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
    const socket = this.socket;
    if (!this.ready || socket === null || !this.queue.pending) return;
    if (socket.bufferedAmount < MAX_BUFFERED_BYTES) {
      for (const edit of this.queue.take()) {
        this.send({ type: "edit", revision: edit.revision, patch: edit.patch });
        this.handlers.sent(edit.revision, edit.inputTime);
      }
      this.sentThisFrame = true;
    }
    this.schedule();
  }

  /** Send a question about the look; the edits made before it go first. */
  ask(message: ClientMessage): boolean {
    if (this.queue.pending) this.flush();
    return this.send(message);
  }

  send(message: ClientMessage): boolean {
    if (!this.ready || this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  close(): void {
    this.closed = true;
    this.ready = false;
    clearTimeout(this.retry);
    this.socket?.close(1000);
    this.handlers.connection("closed", 0);
  }
}
