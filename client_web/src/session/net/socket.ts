/** The transport of a live session: a WebSocket that connects again by itself, with the token that finds its look. */
import { ROOM_PREFIX, SUBPROTOCOL, type ClientMessage, type OpenMessage } from "../../protocol";
import { backoffMs } from "./backoff";
import { Heartbeat } from "./heartbeat";

/** Nobody has logged in, or may no longer be here. */
export const LOGIN_CODE = 4401;
/** Another version of the protocol, no such bake, not ready, damaged: trying again gives the same. */
const FINAL_CODES = new Set([1002, LOGIN_CODE, 4403, 4404, 4409, 4410]);
/** Too many sessions or members, or nobody in a room yet: a later attempt may succeed. */
const BUSY_CODE = 1013;
/** A token that was refused so often is not tried for ever. */
const MAX_RESUMES = 3;

/** `silent`: the connection is there, and nothing comes over it. */
export type Connection = "connecting" | "open" | "silent" | "reconnecting" | "closed";

/** With what a session is to begin, and in which room. */
export type OpenParameters = () => Readonly<Omit<OpenMessage, "type" | "resume">>;

export interface SocketHandlers {
  /** `reason`: what the server said where it has no room now. */
  connection(state: Connection, retryInMs: number, reason?: string): void;
  received(data: string | ArrayBuffer): void;
  /** The server will not have this session again; no use in trying. */
  ended(reason: string, code: number): void;
}

export class SessionSocket {
  private socket: WebSocket | null = null;
  /** How many connections there have been: what came over one is no longer known over the next. */
  connectionCount = 0;
  private attempt = 0;
  private retry = 0;
  private isGreeted = false;
  private isClosed = false;
  /** Names this session to the server, so that a lost connection finds its look again. */
  private resume: string | null = null;
  private readonly heartbeat = new Heartbeat({
    sendPing: () => void this.send({ type: "ping" }),
    onSilent: () => this.handlers.connection("silent", 0),
    onAnswered: () => this.handlers.connection("open", 0),
    onLost: () => this.abandonConnection(),
  });

  constructor(
    readonly bake: string,
    private readonly handlers: SocketHandlers,
    /** What is asked of the server with each connection. */
    private readonly openParameters: OpenParameters = () => ({}),
  ) {}

  connect(): void {
    this.handlers.connection(this.attempt === 0 ? "connecting" : "reconnecting", 0);
    const url = new URL(`/api/bakes/${encodeURIComponent(this.bake)}/session`, location.href);
    url.protocol = url.protocol.replace("http", "ws");
    // all else is in a message: addresses are written into logs
    const opening: OpenMessage = { type: "open", ...this.openParameters(), resume: this.resume };
    const room = opening.room ?? opening.view_token;
    if (room != null) url.searchParams.set("room_prefix", room.slice(0, ROOM_PREFIX));
    this.socket?.close(1000); // one that hangs while it connects
    const socket = new WebSocket(url, SUBPROTOCOL);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => socket.send(JSON.stringify(opening));
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (socket !== this.socket) return; // it was left for another one
      this.heartbeat.recordActivity();
      this.handlers.received(event.data);
    };
    socket.onclose = (event) => this.onClose(socket, event);
    this.socket = socket;
    this.connectionCount += 1;
  }

  /** The server has said hello: messages may go, and `resume` names the session from now on. */
  onHello(resume: string): void {
    this.attempt = 0;
    this.isGreeted = true;
    this.heartbeat.start();
    this.resume = resume;
  }

  private onClose(socket: WebSocket, event: Pick<CloseEvent, "code" | "reason">): void {
    if (this.isClosed || socket !== this.socket) return;
    this.isGreeted = false;
    this.heartbeat.stop();
    this.socket = null;
    if (FINAL_CODES.has(event.code)) {
      this.close();
      this.handlers.ended(event.reason || `code ${event.code}`, event.code);
      return;
    }
    const wait = backoffMs(this.attempt++);
    if (this.attempt > MAX_RESUMES) this.resume = null;
    this.handlers.connection("reconnecting", wait, event.code === BUSY_CODE ? event.reason : undefined);
    this.retry = window.setTimeout(() => this.connect(), wait);
  }

  /** Abandon the connection, and retry until the server, or a replacement, is there. */
  abandonConnection(): void {
    const abandoned = this.socket;
    if (abandoned === null || this.isClosed) return;
    abandoned.close(1000);
    this.onClose(abandoned, { code: 1012, reason: "" });
  }

  /** Try at once instead of waiting for the backoff. */
  reconnectNow(): void {
    if (this.isClosed) return;
    if (this.heartbeat.isSilent) this.abandonConnection();
    if (this.isGreeted) return;
    clearTimeout(this.retry);
    this.connect();
  }

  /** Ask the server whether it is still there. */
  checkConnection(): void {
    this.heartbeat.check();
  }

  get isOpen(): boolean {
    return this.isGreeted && this.socket?.readyState === WebSocket.OPEN;
  }

  /** Bytes that wait in the browser. */
  get bufferedBytes(): number {
    return this.socket?.bufferedAmount ?? 0;
  }

  /** Whether the message went. */
  send(message: ClientMessage): boolean {
    if (!this.isOpen) return false;
    this.socket?.send(JSON.stringify(message));
    return true;
  }

  close(): void {
    this.isClosed = true;
    this.isGreeted = false;
    this.heartbeat.stop();
    clearTimeout(this.retry);
    this.socket?.close(1000);
    this.handlers.connection("closed", 0);
  }
}
