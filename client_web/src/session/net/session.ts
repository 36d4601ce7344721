/** One live session with a bake: sends the newest look, acknowledges frames, dispatches messages. */
import type { LookChange } from "../../state/document/jsonPatch";
import { diffLooks } from "../../state/document/difference";
import { isViewSetting } from "../../state/document/pointer";
import type {
  BakeMessage,
  ClientMessage,
  CurveMessage,
  HelloMessage,
  Look,
  PatchOp,
  InspectAnswer,
  PathAnswer,
  ProblemMessage,
  RoomMessage,
  RoomUpdate,
  StatusMessage,
} from "../../protocol";
import { FrameError, parseFrame, type Frame } from "./binaryFrame";
import { EditQueue, type TargetState } from "./editQueue";
import { dispatchMessage, MessageError, type MessageHandlers } from "./parseMessage";
import { SessionSocket, type OpenParameters, type Connection } from "./socket";

const MAX_BUFFERED_BYTES = 1 << 20;

/** While this many edits wait for their frames, the next edit is delayed and merged, at most for this time: a busy server
 * need not read looks that it will never show. */
const MAX_UNSHOWN_REVISIONS = 2;
const MAX_WAIT_MS = 100;

export interface SessionHandlers {
  connection: (state: Connection, retryInMs: number, reason?: string) => void;
  hello: (message: HelloMessage) => void;
  /** Resolves when the frame is on the screen. */
  frame: (frame: Frame) => Promise<void>;
  status: (message: StatusMessage) => void;
  problem: (message: ProblemMessage, lastGood: Look | null) => void;
  inspect: (message: InspectAnswer) => void;
  path: (message: PathAnswer) => void;
  curve: (message: CurveMessage) => void;
  bake: (message: BakeMessage) => void;
  room: (message: RoomMessage) => void;
  /** The scene's comments have changed. */
  comments: () => void;
  /** Other members have edited the look, which is now this one. */
  roomUpdate: (message: RoomUpdate, look: Look | null) => void;
  onEditSent: (revision: number, inputTime: number) => void;
  /** Editing was rejected: the session is read-only. */
  readOnly: () => void;
  /** The server rejects this session for good; reconnecting is useless. */
  ended: (reason: string, code: number) => void;
  invalidMessage: (message: string) => void;
}

export class Session {
  private readonly socket: SessionSocket;
  private readonly queue = new EditQueue();
  private readonly messages: MessageHandlers;
  private isScheduled = false;
  private hasSentThisFrame = false;
  /** Newest revision shown by a frame, and the time of the last sent edit. */
  private shownRevision = 0;
  private sentTime = 0;
  /** The look of a read-only session, which may only change view settings; null if editing is allowed. */
  private readOnlyLook: Look | null = null;
  /** The room's look version at the last change by others. */
  sharedRevision = 0;

  constructor(
    readonly bake: string,
    private readonly handlers: SessionHandlers,
    openParameters?: OpenParameters,
  ) {
    this.socket = new SessionSocket(
      bake,
      {
        connection: (state, retryInMs, reason) => handlers.connection(state, retryInMs, reason),
        received: (data) => this.receive(data),
        ended: (reason, code) => handlers.ended(reason, code),
      },
      openParameters,
    );
    this.messages = {
      hello: (message) => this.onHello(message),
      status: (message) => handlers.status(message),
      problem: (message) => handlers.problem(message, this.onProblem(message)),
      inspect: (message) => handlers.inspect(message),
      path: (message) => handlers.path(message),
      curve: (message) => handlers.curve(message),
      bake: (message) => handlers.bake(message),
      room: (message) => handlers.room(message),
      comments: () => handlers.comments(),
      room_update: (message) => this.onRoomUpdate(message),
      server_draining: () => this.socket.abandonConnection(),
      pong: () => undefined, // only its arrival matters
    };
  }

  /** Revision of the newest edit sent to the current server. */
  get revision(): number {
    return this.queue.serverRevision;
  }

  /** True if the newest edit has not been sent yet. */
  get hasPendingEdits(): boolean {
    return this.queue.hasPending;
  }

  connect(): void {
    this.socket.connect();
  }

  /** Reconnect immediately instead of waiting for the backoff. */
  reconnectNow(): void {
    this.socket.reconnectNow();
  }

  /** Ping the server. */
  checkConnection(): void {
    this.socket.checkConnection();
  }

  close(): void {
    this.socket.close();
  }

  private receive(data: string | ArrayBuffer): void {
    try {
      if (typeof data === "string") dispatchMessage(data, this.messages);
      else this.onFrame(parseFrame(data));
    } catch (error) {
      if (!(error instanceof FrameError || error instanceof MessageError)) throw error;
      this.handlers.invalidMessage(error.message);
    }
  }

  private onFrame(frame: Frame): void {
    this.queue.confirmRevision(frame.header.revision);
    this.shownRevision = Math.max(this.shownRevision, frame.header.revision);
    const { connectionCount } = this.socket;
    const acknowledge = () => {
      if (connectionCount === this.socket.connectionCount) this.send({ type: "ack", frame: frame.header.frame });
    };
    this.handlers.frame(frame).then(acknowledge, acknowledge);
  }

  private onProblem({ revision }: ProblemMessage): Look | null {
    return revision == null ? null : this.queue.rejectRevision(revision);
  }

  private onHello(message: HelloMessage): void {
    this.socket.onHello(message.resume);
    const look = message.look as unknown as Look;
    this.readOnlyLook = message.role === "view" ? look : null;
    this.sharedRevision = 0;
    if (message.room === null || message.room.is_new) {
      this.queue.reset(look, message.revision, message.solo, message.room !== null);
    } else this.queue.joinRoom(look, message.revision, message.solo);
    this.shownRevision = this.queue.revision;
    this.handlers.hello(message);
    this.handlers.connection("open", 0);
    this.flush();
  }

  private onRoomUpdate(message: RoomUpdate): void {
    const look = this.queue.applyRemote(message.patch, message.revision);
    if (this.readOnlyLook !== null) this.readOnlyLook = look;
    if (message.patch.length > 0) this.sharedRevision = message.room_revision;
    if (message.patch.length > 0) this.handlers.roomUpdate(message, look);
  }

  /** The target look, including edits by others. */
  get look(): Look | null {
    return this.queue.look;
  }

  /** Edits that the room may not have received. */
  get unconfirmedPatch(): readonly PatchOp[] {
    return this.queue.unconfirmedPatch();
  }

  /** Set the target state and the edit that made it; sent immediately, then at most once per animation frame. */
  setTarget(target: TargetState, change: LookChange | null = null): void {
    if (
      this.readOnlyLook !== null &&
      !diffLooks(this.readOnlyLook, target.look).every(({ path }) => isViewSetting(path))
    ) {
      return this.handlers.readOnly();
    }
    this.queue.setTarget(target, change);
    if (this.hasSentThisFrame) this.schedule();
    else this.flush();
  }

  private schedule(): void {
    if (this.isScheduled) return;
    this.isScheduled = true;
    requestAnimationFrame(() => {
      this.isScheduled = false;
      this.hasSentThisFrame = false;
      if (this.queue.hasPending) this.flush();
    });
  }

  private flush(): void {
    if (!this.socket.isOpen || !this.queue.hasPending) return;
    if (this.socket.bufferedBytes < MAX_BUFFERED_BYTES && !this.isTooFarAhead) this.sendEdits();
    this.schedule();
  }

  private get isTooFarAhead(): boolean {
    const isRecent = performance.now() - this.sentTime < MAX_WAIT_MS;
    return isRecent && this.queue.revision - this.shownRevision >= MAX_UNSHOWN_REVISIONS;
  }

  private sendEdits(): void {
    for (const { revision, patch, activeControl, solo, inputTime } of this.queue.takeEdits()) {
      this.send({ type: "edit", revision, patch: [...patch], active_control: activeControl, solo: solo && [...solo] });
      this.handlers.onEditSent(revision, inputTime);
    }
    this.hasSentThisFrame = true;
    this.sentTime = performance.now();
  }

  /** Send a request about the look, after all earlier edits. */
  sendAfterEdits(message: ClientMessage): boolean {
    if (this.queue.hasPending && this.socket.isOpen) this.sendEdits();
    return this.send(message);
  }

  /** Send a message; true if it was sent. */
  send(message: ClientMessage): boolean {
    const isHold = message.type === "prepare" && message.curve == null;
    if (this.readOnlyLook !== null && isHold) return false; // a read-only session edits nothing
    return this.socket.send(message);
  }
}
