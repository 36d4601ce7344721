/** Transport of a live session: a WebSocket that reconnects automatically, with the token that identifies its look. */
import { ROOM_PREFIX, SUBPROTOCOL, type ClientMessage, type OpenMessage } from "../../protocol";
import { backoffMs } from "./backoff";
import { Heartbeat } from "./heartbeat";
import { serverUrl } from "./serverUrl";

/** Login missing or no longer valid. */
export const LOGIN_CODE = 4401;
/** Different protocol version, or a missing, unfinished or damaged bake: retrying is useless. */
const FINAL_CODES = new Set([1002, LOGIN_CODE, 4403, 4404, 4409, 4410]);
/** Too many sessions or members, or an empty room: a later attempt may succeed. */
const BUSY_CODE = 1013;
/** Maximum number of attempts with a rejected token. */
const MAX_RESUMES = 3;

/** `silent`: connected, but the server does not respond. */
export type Connection = "connecting" | "open" | "silent" | "reconnecting" | "closed";

/** The session's initial look, and its room. */
export type OpenParameters = () => Readonly<Omit<OpenMessage, "type" | "resume">>;

export interface SocketHandlers {
  /** `reason`: the server's message if it is full. */
  connection: (state: Connection, retryInMs: number, reason?: string) => void;
  received: (data: string | ArrayBuffer) => void;
  /** The server rejects this session for good; reconnecting is useless. */
  ended: (reason: string, code: number) => void;
}

export class SessionSocket {
  private socket: WebSocket | null = null;
  /** Number of connections so far: server state does not carry over between them. */
  connectionCount = 0;
  private attempt = 0;
  private retry = 0;
  private isGreeted = false;
  private isClosed = false;
  /** Token that identifies this session, so that a reconnection resumes its look. */
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
    /** Parameters sent with each connection. */
    private readonly openParameters: OpenParameters = () => ({}),
  ) {}

  connect(): void {
    this.handlers.connection(this.attempt === 0 ? "connecting" : "reconnecting", 0);
    const url = new URL(serverUrl(`/api/bakes/${encodeURIComponent(this.bake)}/session`), location.href);
    url.protocol = url.protocol.replace("http", "ws");
    // everything else is in a message: URLs are logged
    const opening: OpenMessage = { type: "open", ...this.openParameters(), resume: this.resume };
    const room = opening.room ?? opening.view_token;
    if (room != null) url.searchParams.set("room_prefix", room.slice(0, ROOM_PREFIX));
    this.socket?.close(1000); // a previous attempt may hang while connecting
    const socket = new WebSocket(url, SUBPROTOCOL);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => socket.send(JSON.stringify(opening));
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (socket !== this.socket) return; // replaced by another socket
      this.heartbeat.recordActivity();
      this.handlers.received(event.data);
    };
    socket.onclose = (event) => this.onClose(socket, event);
    this.socket = socket;
    this.connectionCount += 1;
  }

  /** After the server's hello: messages may be sent, and `resume` identifies the session. */
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

  /** Abandon the connection, and retry until a server is available. */
  abandonConnection(): void {
    const abandoned = this.socket;
    if (abandoned === null || this.isClosed) return;
    abandoned.close(1000);
    this.onClose(abandoned, { code: 1012, reason: "" });
  }

  /** Reconnect immediately instead of waiting for the backoff. */
  reconnectNow(): void {
    if (this.isClosed) return;
    if (this.heartbeat.isSilent) this.abandonConnection();
    if (this.isGreeted) return;
    clearTimeout(this.retry);
    this.connect();
  }

  /** Ping the server. */
  checkConnection(): void {
    this.heartbeat.check();
  }

  get isOpen(): boolean {
    return this.isGreeted && this.socket?.readyState === WebSocket.OPEN;
  }

  /** Bytes waiting in the browser's send buffer. */
  get bufferedBytes(): number {
    return this.socket?.bufferedAmount ?? 0;
  }

  /** Send a message; true if it was sent. */
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
