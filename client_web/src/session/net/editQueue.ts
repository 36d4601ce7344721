/** Queue of edits to the server: only the newest look counts, and each message has a revision. Changes are recorded with
 * the edits; looks are compared only if no recorded edits lead from the server's look. */
import { changeByPatch, rebasePatch, type LookChange } from "../../state/document/jsonPatch";
import { diffLooks } from "../../state/document/difference";
import { escapeToken } from "../../state/document/pointer";
import { MAX_OPERATIONS } from "../../look.gen";
import { MAX_MESSAGE_BYTES, type Look, type PatchOp } from "../../protocol";

/** Maximum patch length, with room for the rest of the message. */
export const MAX_PATCH_BYTES = MAX_MESSAGE_BYTES - 1024;

/** The state that the user wants to see. */
export interface TargetState {
  look: Look;
  /** Path of the active control. */
  activeControl: string | null;
  /** Solo light sources; null: all. */
  solo: readonly string[] | null;
  /** Time of the input (performance.now clock). */
  inputTime: number;
}

export interface QueuedEdit extends Omit<TargetState, "look"> {
  revision: number;
  patch: readonly PatchOp[];
}

function messageBytes(patch: readonly PatchOp[]): number {
  return new TextEncoder().encode(JSON.stringify(patch)).length;
}

/** An edit that the server has yet to show, or in a room to broadcast. */
interface OutstandingEdit {
  revision: number;
  look: Look;
  patch: readonly PatchOp[];
}

function chunkPatch(patch: readonly PatchOp[]): PatchOp[][] {
  const chunks: PatchOp[][] = [patch.slice(0, MAX_OPERATIONS)];
  for (let i = MAX_OPERATIONS; i < patch.length; i += MAX_OPERATIONS) chunks.push(patch.slice(i, i + MAX_OPERATIONS));
  return chunks;
}

/** Split a patch that is too long for one message: a whole look is sent material by material. */
function splitPatch(patch: readonly PatchOp[]): PatchOp[][] {
  if (messageBytes(patch) <= MAX_PATCH_BYTES) return chunkPatch(patch);
  return patch.flatMap((operation) => {
    if (operation.path !== "") return [[operation]];
    const look = operation.value as Look;
    const { materials, ...rest } = look;
    return [
      ...Object.entries(rest).map(([key, value]) => [{ op: "replace" as const, path: `/${key}`, value }]),
      ...Object.entries(materials).map(([name, value]) => [
        { op: "replace" as const, path: `/materials/${escapeToken(name)}`, value },
      ]),
    ];
  });
}

/** The patch of a whole look, if the server's look is unknown. */
function patchToTarget(target: Look, sentLook: Look | null): PatchOp[] {
  return sentLook === null ? [{ op: "replace", path: "", value: target }] : diffLooks(sentLook, target);
}

export class EditQueue {
  private sentLook: Look | null = null;
  private sentSolo: readonly string[] | null = null;
  private target: TargetState | null = null;
  /** Patch from `sentLook` to the target look; null if no recorded edits lead there. */
  private pendingPatch: readonly PatchOp[] | null = null;
  private outstandingEdits: OutstandingEdit[] = [];
  /** The newest look of which the server has sent a frame; in a room, the newest announced one. */
  private confirmedLook: Look | null = null;
  /** True in a room: the server announces the look separately, and frames confirm nothing. */
  private isShared = false;
  /** Revision of the newest edit. */
  revision = 0;
  /** Revision of the newest edit sent to the current server; none for a new server. */
  serverRevision = 0;

  /** Reset: the server has `look` at `revision` (null: unknown, so the next edit is the whole look) and shows these light
   * sources. */
  reset(look: Look | null, revision = 0, solo: readonly string[] | null = null, isShared = false): void {
    this.sentLook = look;
    this.sentSolo = solo;
    this.pendingPatch = null;
    this.confirmedLook = look;
    this.revision = Math.max(this.revision, revision);
    this.serverRevision = revision;
    this.outstandingEdits = [];
    this.isShared = isShared;
  }

  /** (Re)join a room with this look: edits made in the meantime are applied on top of it. */
  joinRoom(look: Look, revision: number, solo: readonly string[] | null): void {
    const patch = this.isShared ? this.unconfirmedPatch(revision) : [];
    this.reset(look, revision, solo, true);
    this.rebaseTarget(patch);
  }

  /** The edits after a revision that are not confirmed to be in the room's look. */
  unconfirmedPatch(after = 0): readonly PatchOp[] {
    const edits = this.outstandingEdits.filter(({ revision }) => revision > after);
    return [...edits.flatMap(({ patch }) => patch), ...this.unsentPatch];
  }

  /** The patch from the sent look to the target look. */
  private get unsentPatch(): readonly PatchOp[] {
    if (this.sentLook === null || this.target === null) return [];
    return this.pendingPatch ?? diffLooks(this.sentLook, this.target.look);
  }

  /** The room's look has changed and includes the own edits up to a revision; with an empty patch, only those. Returns the
   * new target look: later own edits stay on top. */
  applyRemote(patch: readonly PatchOp[], revision: number): Look | null {
    const unsent = this.unsentPatch;
    const ownLook = this.outstandingEdits.findLast((edit) => edit.revision <= revision);
    this.confirmedLook = ownLook?.look ?? this.confirmedLook;
    this.outstandingEdits = this.outstandingEdits.filter((edit) => edit.revision > revision);
    if (patch.length > 0 && this.confirmedLook !== null) {
      this.confirmedLook = rebasePatch(this.confirmedLook, patch);
      this.rebaseTarget(unsent);
    }
    return this.look;
  }

  /** The target look; the server's look before the first edit. */
  get look(): Look | null {
    return this.target?.look ?? this.confirmedLook;
  }

  /** Apply the unconfirmed edits on top of the confirmed look, and the unsent ones on top of them. */
  private rebaseTarget(unsentPatch: readonly PatchOp[]): void {
    let look = this.confirmedLook as Look;
    this.outstandingEdits = this.outstandingEdits.map((edit) => ({
      ...edit,
      look: (look = rebasePatch(look, edit.patch)),
    }));
    this.sentLook = look;
    if (this.target !== null) this.target = { ...this.target, look: rebasePatch(look, unsentPatch) };
    this.pendingPatch = unsentPatch;
  }

  /** Set the user's newest target; `change`: the edit that made the look, if any. */
  setTarget(target: TargetState, change: LookChange | null = null): void {
    this.pendingPatch = target.look === this.sentLook ? [] : this.extendPatch(change);
    this.target = target;
  }

  /** Append a change to the recorded edits. */
  private extendPatch(change: LookChange | null): readonly PatchOp[] | null {
    if (this.sentLook === null || this.pendingPatch === null || change === null || change.before !== this.target?.look)
      return null;
    return this.pendingPatch.length === 0
      ? change.patch
      : changeByPatch(this.sentLook, [...this.pendingPatch, ...change.patch]).patch;
  }

  get hasPending(): boolean {
    return this.target !== null && (this.target.look !== this.sentLook || !this.isSoloSent(this.target));
  }

  private isSoloSent({ solo }: TargetState): boolean {
    return JSON.stringify(solo) === JSON.stringify(this.sentSolo);
  }

  /** The messages that bring the server to the target look; empty if it is there already. */
  takeEdits(): QueuedEdit[] {
    if (this.target === null || !this.hasPending) return [];
    const { look, activeControl, solo, inputTime } = this.target;
    const patch = this.pendingPatch ?? patchToTarget(look, this.sentLook);
    this.sentLook = look;
    this.pendingPatch = [];
    if (patch.length === 0 && this.isSoloSent(this.target)) return [];
    this.sentSolo = solo;
    return splitPatch(patch).map((chunk) => {
      this.serverRevision = this.revision += 1;
      this.outstandingEdits.push({ revision: this.revision, look, patch: chunk });
      return { revision: this.revision, patch: chunk, activeControl, solo, inputTime };
    });
  }

  /** A frame of this revision was received: everything up to it was accepted. */
  confirmRevision(revision: number): void {
    if (this.isShared) return;
    while (this.outstandingEdits[0] && this.outstandingEdits[0].revision <= revision) {
      this.confirmedLook = (this.outstandingEdits.shift() as OutstandingEdit).look;
    }
  }

  /** The server rejected a revision, so its look is unknown; returns the last accepted look. In a room, the look without
   * that edit. */
  rejectRevision(revision: number): Look | null {
    const unsent = this.unsentPatch;
    this.outstandingEdits = this.outstandingEdits.filter((entry) => entry.revision !== revision);
    if (this.isShared) {
      this.rebaseTarget(unsent);
      return this.target?.look ?? null;
    }
    this.sentLook = this.pendingPatch = null;
    return this.confirmedLook;
  }
}
