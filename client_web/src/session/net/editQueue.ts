/** Queue of edits to the server: only the newest look counts, each message has its revision. What an edit changed is
 * known from where it was made; looks are compared only where no edit leads from what the server holds. */
import { changeByPatch, rebasePatch, type LookChange } from "../../state/document/jsonPatch";
import { diffLooks } from "../../state/document/difference";
import { escapeToken } from "../../state/document/pointer";
import { MAX_OPERATIONS } from "../../look.gen";
import { MAX_MESSAGE_BYTES, type Look, type PatchOp } from "../../protocol";

/** A little room is left for the message around the patch. */
export const MAX_PATCH_BYTES = MAX_MESSAGE_BYTES - 1024;

/** What the user wants to see. */
export interface TargetState {
  look: Look;
  /** Path of the active control. */
  activeControl: string | null;
  /** Sources of light that alone are shown; null: all. */
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

/** An edit that the server has yet to show, or in a room to tell of. */
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

/** Split a patch that is too long for one message: the whole look goes material by material. */
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

/** The whole look where nothing is known of the server's. */
function patchToTarget(target: Look, sentLook: Look | null): PatchOp[] {
  return sentLook === null ? [{ op: "replace", path: "", value: target }] : diffLooks(sentLook, target);
}

export class EditQueue {
  private sentLook: Look | null = null;
  private sentSolo: readonly string[] | null = null;
  private target: TargetState | null = null;
  /** From `sentLook` to the target look; null if no edits lead there. */
  private pendingPatch: readonly PatchOp[] | null = null;
  private outstandingEdits: OutstandingEdit[] = [];
  /** The newest look that the server has shown a frame of; in a room, that it has announced. */
  private confirmedLook: Look | null = null;
  /** Others edit the look as well: the server tells what has become of it, and frames say nothing of that. */
  private isShared = false;
  /** Of the newest edit of all. */
  revision = 0;
  /** Revision of the newest edit that this server has; a replacement server has had none. */
  serverRevision = 0;

  /** Start afresh: the server holds `look` at `revision` (null: unknown, so the next edit is the whole look), and shows
   * these sources of light. */
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

  /** Come, perhaps again, into a room that has this look: what was edited meanwhile goes on top of it. */
  joinRoom(look: Look, revision: number, solo: readonly string[] | null): void {
    const patch = this.isShared ? this.unconfirmedPatch(revision) : [];
    this.reset(look, revision, solo, true);
    this.rebaseTarget(patch);
  }

  /** What was edited and is not known to be in the room's look, after a revision. */
  unconfirmedPatch(after = 0): readonly PatchOp[] {
    const edits = this.outstandingEdits.filter(({ revision }) => revision > after);
    return [...edits.flatMap(({ patch }) => patch), ...this.unsentPatch];
  }

  /** What leads from what was sent to what is wanted. */
  private get unsentPatch(): readonly PatchOp[] {
    if (this.sentLook === null || this.target === null) return [];
    return this.pendingPatch ?? diffLooks(this.sentLook, this.target.look);
  }

  /** The room's look has become another, with the own edits up to a revision in it; an empty patch: by those alone. Gives
   * what is wanted now: the own edits after them stay on top. */
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

  /** The look that is wanted; until one is, that of the server. */
  get look(): Look | null {
    return this.target?.look ?? this.confirmedLook;
  }

  /** Put what is not confirmed on top of what is, and what was not sent on top of that. */
  private rebaseTarget(unsentPatch: readonly PatchOp[]): void {
    let look = this.confirmedLook as Look;
    this.outstandingEdits = this.outstandingEdits.map((edit) => ({ ...edit, look: (look = rebasePatch(look, edit.patch)) }));
    this.sentLook = look;
    if (this.target !== null) this.target = { ...this.target, look: rebasePatch(look, unsentPatch) };
    this.pendingPatch = unsentPatch;
  }

  /** The user's newest target; `change` is the edit that made the look, where one did. */
  setTarget(target: TargetState, change: LookChange | null = null): void {
    this.pendingPatch = target.look === this.sentLook ? [] : this.extendPatch(change);
    this.target = target;
  }

  /** The way to what was wanted last, and on by a change. */
  private extendPatch(change: LookChange | null): readonly PatchOp[] | null {
    if (this.sentLook === null || this.pendingPatch === null || change === null || change.before !== this.target?.look) return null;
    return this.pendingPatch.length === 0 ? change.patch : changeByPatch(this.sentLook, [...this.pendingPatch, ...change.patch]).patch;
  }

  get hasPending(): boolean {
    return this.target !== null && (this.target.look !== this.sentLook || !this.isSoloSent(this.target));
  }

  private isSoloSent({ solo }: TargetState): boolean {
    return JSON.stringify(solo) === JSON.stringify(this.sentSolo);
  }

  /** The messages that bring the server to the wanted look; empty where it is there already. */
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

  /** A frame of this revision has come: everything up to it was accepted. */
  confirmRevision(revision: number): void {
    if (this.isShared) return;
    while (this.outstandingEdits[0] && this.outstandingEdits[0].revision <= revision) {
      this.confirmedLook = (this.outstandingEdits.shift() as OutstandingEdit).look;
    }
  }

  /** The server refused a revision: what it holds is no longer known; returns the last look it accepted. In a room, the
   * look without that edit. */
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
