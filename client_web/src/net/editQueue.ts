/** Edits on their way to the server: only the newest look counts, each message has its revision. What an edit changed is
 * known from where it was made; looks are compared only where no edit leads from what the server holds. */
import { changeBy, rebased, type Change } from "../document/change";
import { differenceOf } from "../document/difference";
import { escapeToken } from "../document/pointer";
import { MAX_OPERATIONS } from "../look.gen";
import { MAX_MESSAGE_BYTES, type Look, type PatchOp } from "../protocol";

/** A little room is left for the message around the patch. */
export const MAX_PATCH_BYTES = MAX_MESSAGE_BYTES - 1024;

/** What the user wants to see. */
export interface Wanted {
  look: Look;
  /** What the hand is on. */
  hand: string | null;
  /** Sources of light that alone are shown; null: all. */
  solo: readonly string[] | null;
  /** When the hand moved (performance.now clock). */
  inputTime: number;
}

export interface Edit extends Omit<Wanted, "look"> {
  revision: number;
  patch: readonly PatchOp[];
}

function messageBytes(patch: readonly PatchOp[]): number {
  return new TextEncoder().encode(JSON.stringify(patch)).length;
}

/** An edit that the server has yet to show, or in a room to tell of. */
interface Outstanding {
  revision: number;
  look: Look;
  patch: readonly PatchOp[];
}

function chunked(patch: readonly PatchOp[]): PatchOp[][] {
  const parts: PatchOp[][] = [patch.slice(0, MAX_OPERATIONS)];
  for (let i = MAX_OPERATIONS; i < patch.length; i += MAX_OPERATIONS) parts.push(patch.slice(i, i + MAX_OPERATIONS));
  return parts;
}

/** Split a patch that is too long for one message: the whole look goes material by material. */
function splitPatch(patch: readonly PatchOp[]): PatchOp[][] {
  if (messageBytes(patch) <= MAX_PATCH_BYTES) return chunked(patch);
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
function differenceTo(wanted: Look, sent: Look | null): PatchOp[] {
  return sent === null ? [{ op: "replace", path: "", value: wanted }] : differenceOf(sent, wanted);
}

export class EditQueue {
  private sent: Look | null = null;
  private sentSolo: readonly string[] | null = null;
  private wanted: Wanted | null = null;
  /** From `sent` to the wanted look; null where no edits lead there. */
  private way: readonly PatchOp[] | null = null;
  private outstanding: Outstanding[] = [];
  /** The newest look that the server has shown a frame of; in a room, that it has told of. */
  private confirmed: Look | null = null;
  /** Others edit the look as well: the server tells what has become of it, and frames say nothing of that. */
  private isShared = false;
  /** Of the newest edit of all. */
  revision = 0;
  /** Of the newest edit that this server knows of: another one, in place of one that is gone, has had none. */
  known = 0;

  /** Start afresh: the server holds `look` at `revision` (null: unknown, so the next edit is the whole look), and shows
   * these sources of light. */
  reset(look: Look | null, revision = 0, solo: readonly string[] | null = null, isShared = false): void {
    this.sent = look;
    this.sentSolo = solo;
    this.way = null;
    this.confirmed = look;
    this.revision = Math.max(this.revision, revision);
    this.known = revision;
    this.outstanding = [];
    this.isShared = isShared;
  }

  /** Come, perhaps again, into a room that has this look: what was edited meanwhile goes on top of it. */
  join(look: Look, revision: number, solo: readonly string[] | null): void {
    const patch = this.isShared ? this.unconfirmed(revision) : [];
    this.reset(look, revision, solo, true);
    this.rebase(patch);
  }

  /** What was edited and is not known to be in the room's look, after a revision. */
  unconfirmed(after = 0): readonly PatchOp[] {
    const edits = this.outstanding.filter(({ revision }) => revision > after);
    return [...edits.flatMap(({ patch }) => patch), ...this.unsent];
  }

  /** What leads from what was sent to what is wanted. */
  private get unsent(): readonly PatchOp[] {
    if (this.sent === null || this.wanted === null) return [];
    return this.way ?? differenceOf(this.sent, this.wanted.look);
  }

  /** The room's look has become another, with the own edits up to a revision in it; an empty patch: by those alone. Gives
   * what is wanted now: the own edits after them stay on top. */
  follow(patch: readonly PatchOp[], revision: number): Look | null {
    const unsent = this.unsent;
    const own = this.outstanding.findLast((edit) => edit.revision <= revision);
    this.confirmed = own?.look ?? this.confirmed;
    this.outstanding = this.outstanding.filter((edit) => edit.revision > revision);
    if (patch.length > 0 && this.confirmed !== null) {
      this.confirmed = rebased(this.confirmed, patch);
      this.rebase(unsent);
    }
    return this.look;
  }

  /** The look that is wanted; until one is, that of the server. */
  get look(): Look | null {
    return this.wanted?.look ?? this.confirmed;
  }

  /** Put what is not confirmed on top of what is, and what was not sent on top of that. */
  private rebase(unsent: readonly PatchOp[]): void {
    let look = this.confirmed as Look;
    this.outstanding = this.outstanding.map((edit) => ({ ...edit, look: (look = rebased(look, edit.patch)) }));
    this.sent = look;
    if (this.wanted !== null) this.wanted = { ...this.wanted, look: rebased(look, unsent) };
    this.way = unsent;
  }

  /** The user wants this now; `change` is the edit that made the look, where one did. */
  want(wanted: Wanted, change: Change | null = null): void {
    this.way = wanted.look === this.sent ? [] : this.extended(change);
    this.wanted = wanted;
  }

  /** The way to what was wanted last, and on by a change. */
  private extended(change: Change | null): readonly PatchOp[] | null {
    if (this.sent === null || this.way === null || change === null || change.before !== this.wanted?.look) return null;
    return this.way.length === 0 ? change.patch : changeBy(this.sent, [...this.way, ...change.patch]).patch;
  }

  get pending(): boolean {
    return this.wanted !== null && (this.wanted.look !== this.sent || !this.isSoloSent(this.wanted));
  }

  private isSoloSent({ solo }: Wanted): boolean {
    return JSON.stringify(solo) === JSON.stringify(this.sentSolo);
  }

  /** The messages that bring the server to the wanted look; empty where it is there already. */
  take(): Edit[] {
    if (this.wanted === null || !this.pending) return [];
    const { look, hand, solo, inputTime } = this.wanted;
    const patch = this.way ?? differenceTo(look, this.sent);
    this.sent = look;
    this.way = [];
    if (patch.length === 0 && this.isSoloSent(this.wanted)) return [];
    this.sentSolo = solo;
    return splitPatch(patch).map((part) => {
      this.known = this.revision += 1;
      this.outstanding.push({ revision: this.revision, look, patch: part });
      return { revision: this.revision, patch: part, hand, solo, inputTime };
    });
  }

  /** A frame of this revision has come: everything up to it was accepted. */
  confirm(revision: number): void {
    if (this.isShared) return;
    while (this.outstanding[0] && this.outstanding[0].revision <= revision) {
      this.confirmed = (this.outstanding.shift() as Outstanding).look;
    }
  }

  /** The server refused a revision: what it holds is no longer known; returns the last look it accepted. In a room, the
   * look without that edit. */
  refuse(revision: number): Look | null {
    const unsent = this.unsent;
    this.outstanding = this.outstanding.filter((entry) => entry.revision !== revision);
    if (this.isShared) {
      this.rebase(unsent);
      return this.wanted?.look ?? null;
    }
    this.sent = this.way = null;
    return this.confirmed;
  }
}
