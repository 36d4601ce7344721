/** Edits on their way to the server: only the newest look counts, each message has its revision. */
import { MAX_MESSAGE_BYTES, type Look, type PatchOp } from "../protocol";
import { escapeToken } from "../state/pointer";
import { diffLooks } from "../state/diff";

/** A little room is left for the message around the patch. */
export const MAX_PATCH_BYTES = MAX_MESSAGE_BYTES - 1024;
const MAX_OPERATIONS = 256;

export interface Edit {
  revision: number;
  patch: PatchOp[];
  inputTime: number;
}

function messageBytes(patch: PatchOp[]): number {
  return new TextEncoder().encode(JSON.stringify(patch)).length;
}

function chunked(patch: PatchOp[]): PatchOp[][] {
  const parts: PatchOp[][] = [];
  for (let i = 0; i < patch.length; i += MAX_OPERATIONS) parts.push(patch.slice(i, i + MAX_OPERATIONS));
  return parts;
}

/** Split a patch that is too long for one message: the whole look goes material by material. */
export function splitPatch(patch: PatchOp[]): PatchOp[][] {
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

export class EditQueue {
  private sent: Look | null = null;
  private wanted: Look | null = null;
  private inputTime = 0;
  private outstanding: { revision: number; look: Look }[] = [];
  /** The newest look that the server has shown a frame of. */
  private confirmed: Look | null = null;
  revision = 0;

  /** Start afresh: the server holds `look` at `revision` (null: unknown, so the next edit is the whole look). */
  reset(look: Look | null, revision = 0): void {
    this.sent = look;
    this.confirmed = look;
    this.revision = Math.max(this.revision, revision);
    this.outstanding = [];
  }

  /** The user wants this look now; `inputTime` is when the hand moved (performance.now clock). */
  want(look: Look, inputTime: number): void {
    this.wanted = look;
    this.inputTime = inputTime;
  }

  get pending(): boolean {
    return this.wanted !== null && this.wanted !== this.sent;
  }

  /** The messages that bring the server to the wanted look; empty where it is there already. */
  take(): Edit[] {
    if (this.wanted === null || !this.pending) return [];
    const patch = diffLooks(this.sent, this.wanted);
    this.sent = this.wanted;
    if (patch.length === 0) return [];
    return splitPatch(patch).map((part) => {
      this.revision += 1;
      this.outstanding.push({ revision: this.revision, look: this.wanted as Look });
      return { revision: this.revision, patch: part, inputTime: this.inputTime };
    });
  }

  /** A frame of this revision has come: everything up to it was accepted. */
  confirm(revision: number): void {
    while (this.outstanding[0] && this.outstanding[0].revision <= revision) {
      this.confirmed = (this.outstanding.shift() as { look: Look }).look;
    }
  }

  /** The server refused a revision: what it holds is no longer known; returns the last look it accepted. */
  refuse(revision: number): Look | null {
    this.outstanding = this.outstanding.filter((entry) => entry.revision !== revision);
    this.sent = null;
    return this.confirmed;
  }
}
