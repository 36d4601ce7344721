/** Changes of the look: what it was and becomes, and the JSON Patches (RFC 6902) that lead there and back. */
import { applyPatches, enablePatches, produceWithPatches, type Draft, type Patch } from "immer";
import type { Look, PatchOp } from "../protocol";
import { differenceOf, isSame } from "./difference";
import { getAt, pointer, tokens } from "./pointer";

enablePatches();

export interface Change {
  before: Look;
  after: Look;
  /** Leads from `before` to `after`. */
  patch: readonly PatchOp[];
  /** Leads back. */
  inverse: readonly PatchOp[];
}

type Node = Record<string, unknown>;

function operation({ op, path, value }: Patch): PatchOp {
  const at = pointer(...path);
  return op === "remove" ? { op, path: at } : { op, path: at, value };
}

type Recipe = (draft: Draft<Look>) => void;

/** What a recipe does to a look; what is not changed is shared. */
function made(before: Look, recipe: Recipe): Change {
  const [after, patch, inverse] = produceWithPatches(before, recipe);
  return { before, after, patch: patch.map(operation), inverse: inverse.map(operation) };
}

/** Set the value at a pointer (undefined removes it), and make the objects that are missing on the way. Nothing changes
 * where it is the same already. */
export function changeAt(look: Look, path: string, value: unknown): Change {
  return made(look, (draft) => {
    if (isSame(getAt(look, path), value)) return;
    const way = tokens(path);
    const last = way.pop() as string;
    let node = draft as unknown as Node;
    for (const token of way) {
      if (!Object.hasOwn(node, token)) node[token] = {};
      node = node[token] as Node;
    }
    if (value === undefined) delete node[last];
    else node[last] = value;
  });
}

/** What a patch does; of several operations on one place a single one is left. */
export function changeBy(look: Look, patch: readonly PatchOp[]): Change {
  const steps = patch.map(({ op, path, value }) => ({ op, path: tokens(path), value }) as Patch);
  return made(look, (draft) => void applyPatches(draft, steps));
}

/** Another look in the place of this one. */
export function changeTo(look: Look, next: Look): Change {
  return { ...changeBy(look, differenceOf(look, next)), after: next };
}

/** Two changes in a row as one. */
export function joined(first: Change, then: Change): Change {
  return { ...changeBy(first.before, [...first.patch, ...then.patch]), after: then.after };
}

/** A look after a patch that was made for another state of it: operations that find no place any more are left out. */
export function rebased(look: Look, patch: readonly PatchOp[]): Look {
  return patch.reduce((to, operation) => {
    try {
      return changeBy(to, [operation]).after;
    } catch {
      return to; // somebody else has removed what it is in
    }
  }, look);
}
