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

/** While so many edits wait for a frame that shows them, the next one grows newer instead, for so long at most: a server
 * that is busy with many users need not read what it will never show. */
const MAX_UNSHOWN_REVISIONS = 2;
const MAX_WAIT_MS = 100;

export interface SessionHandlers {
  connection(state: Connection, retryInMs: number, reason?: string): void;
  hello(message: HelloMessage): void;
  /** Resolves when the frame is on the screen. */
  frame(frame: Frame): Promise<void>;
  status(message: StatusMessage): void;
  problem(message: ProblemMessage, lastGood: Look | null): void;
  inspect(message: InspectAnswer): void;
  curve(message: CurveMessage): void;
  bake(message: BakeMessage): void;
  room(message: RoomMessage): void;
  /** Somebody has commented on the scene. */
  comments(): void;
  /** Others have edited the look; it has become this one, where there is one yet. */
  roomUpdate(message: RoomUpdate, look: Look | null): void;
  onEditSent(revision: number, inputTime: number): void;
  /** The look cannot be changed: the server lets this one only look. */
  readOnly(): void;
  /** The server will not have this session again; no use in trying. */
  ended(reason: string, code: number): void;
  invalidMessage(message: string): void;
}

export class Session {
  private readonly socket: SessionSocket;
  private readonly queue = new EditQueue();
  private readonly messages: MessageHandlers;
  private isScheduled = false;
  private hasSentThisFrame = false;
  /** Newest revision that a frame has shown, and when the last edit went. */
  private shownRevision = 0;
  private sentTime = 0;
  /** The look that there is for one who may change only ways of looking at it; null for who may edit. */
  private readOnlyLook: Look | null = null;
  /** How often the room's look had changed when others changed it last. */
  sharedRevision = 0;

  constructor(
    readonly bake: string,
    private readonly handlers: SessionHandlers,
    openParameters?: OpenParameters,
  ) {
    this.socket = new SessionSocket(bake, {
      connection: (state, retryInMs, reason) => handlers.connection(state, retryInMs, reason),
      received: (data) => this.receive(data),
      ended: (reason, code) => handlers.ended(reason, code),
    }, openParameters);
    this.messages = {
      hello: (message) => this.onHello(message),
      status: (message) => handlers.status(message),
      problem: (message) => handlers.problem(message, this.onProblem(message)),
      inspect: (message) => handlers.inspect(message),
      curve: (message) => handlers.curve(message),
      bake: (message) => handlers.bake(message),
      room: (message) => handlers.room(message),
      comments: () => handlers.comments(),
      room_update: (message) => this.onRoomUpdate(message),
      server_draining: () => this.socket.abandonConnection(),
      pong: () => undefined, // that it came is all it says
    };
  }

  /** Of the newest edit that was sent to the server that is there. */
  get revision(): number {
    return this.queue.serverRevision;
  }

  /** Whether the server has yet to hear of the newest edit. */
  get hasPendingEdits(): boolean {
    return this.queue.hasPending;
  }

  connect(): void {
    this.socket.connect();
  }

  /** Try at once instead of waiting for the backoff. */
  reconnectNow(): void {
    this.socket.reconnectNow();
  }

  /** Ask the server whether it is still there. */
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
    const look = this.queue.applyRemote(message.patch as PatchOp[], message.revision);
    if (this.readOnlyLook !== null) this.readOnlyLook = look;
    if (message.patch.length > 0) this.sharedRevision = message.room_revision;
    if (message.patch.length > 0) this.handlers.roomUpdate(message, look);
  }

  /** The look that is wanted, with what others made of it. */
  get look(): Look | null {
    return this.queue.look;
  }

  /** What was edited and may not have come to the room. */
  get unconfirmedPatch(): readonly PatchOp[] {
    return this.queue.unconfirmedPatch();
  }

  /** What to show from now on, and the edit that made it; sent at once, then at most once per animation frame. */
  setTarget(target: TargetState, change: LookChange | null = null): void {
    if (this.readOnlyLook !== null && !diffLooks(this.readOnlyLook, target.look).every(({ path }) => isViewSetting(path))) {
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

  /** Send a question about the look; the edits made before it go first. */
  sendAfterEdits(message: ClientMessage): boolean {
    if (this.queue.hasPending && this.socket.isOpen) this.sendEdits();
    return this.send(message);
  }

  /** Whether the message went. */
  send(message: ClientMessage): boolean {
    const isHold = message.type === "prepare" && message.curve == null;
    if (this.readOnlyLook !== null && isHold) return false; // nothing of it is edited
    return this.socket.send(message);
  }
}
