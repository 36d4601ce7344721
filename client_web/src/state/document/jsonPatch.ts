/** Changes of the look: before and after, and the JSON Patches (RFC 6902) in both directions. */
import { enablePatches, produceWithPatches, type Draft, type Patch } from "immer";
import type { Look, PatchOp } from "../../protocol";
import { diffLooks, isDeepEqual } from "./difference";
import { getAt, jsonPointer, pointerTokens } from "./pointer";

enablePatches();

export interface LookChange {
  before: Look;
  after: Look;
  /** Patch from `before` to `after`. */
  patch: readonly PatchOp[];
  /** Patch from `after` to `before`. */
  inverse: readonly PatchOp[];
}

type DraftNode = Record<string, unknown>;

function toPatchOp({ op, path, value }: Patch): PatchOp {
  const targetPath = jsonPointer(...path);
  return op === "remove" ? { op, path: targetPath } : { op, path: targetPath, value };
}

type DraftRecipe = (draft: Draft<Look>) => void;

/** The change made by an Immer recipe; unchanged parts are shared. */
function makeChange(before: Look, recipe: DraftRecipe): LookChange {
  const [after, patch, inverse] = produceWithPatches(before, recipe);
  return { before, after, patch: patch.map(toPatchOp), inverse: inverse.map(toPatchOp) };
}

/** Set the value at a pointer (undefined removes it), creating missing parent objects. An equal value changes
 * nothing. */
export function changeValue(look: Look, path: string, value: unknown): LookChange {
  return makeChange(look, (draft) => {
    if (isDeepEqual(getAt(look, path), value)) return;
    const pathTokens = pointerTokens(path);
    const lastToken = pathTokens.pop() as string;
    let node = draft as unknown as DraftNode;
    for (const token of pathTokens) {
      if (!Object.hasOwn(node, token)) node[token] = {};
      node = node[token] as DraftNode;
    }
    if (value === undefined) Reflect.deleteProperty(node, lastToken);
    else node[lastToken] = value;
  });
}

/** The change made by a patch; several operations on one path are merged. */
export function changeByPatch(look: Look, patch: readonly PatchOp[]): LookChange {
  return makeChange(look, (draft) => patch.forEach((operation) => apply(draft, operation)));
}

/** Apply one operation. Throws for a path that does not exist. Immer's own refuses the name "prototype", which
 * materials may have. */
function apply(draft: DraftNode, { op, path, value }: PatchOp): void {
  const node = getAt(draft, path.slice(0, path.lastIndexOf("/")));
  const key = pointerTokens(path).at(-1);
  if (key === undefined || !isNode(node) || (op !== "add" && !Object.hasOwn(node, key)))
    throw new Error(`No ${path} to ${op}`);
  if (Array.isArray(node) && op !== "replace") {
    const index = key === "-" ? node.length : Number(key);
    if (op === "add") node.splice(index, 0, structuredClone(value));
    else node.splice(index, 1);
  } else if (op === "remove") Reflect.deleteProperty(node, key);
  else node[key] = structuredClone(value);
}

function isNode(value: unknown): value is DraftNode {
  return typeof value === "object" && value !== null;
}

/** The change to another look. */
export function changeToLook(look: Look, next: Look): LookChange {
  return { ...changeByPatch(look, diffLooks(look, next)), after: next };
}

/** Merge two consecutive changes. */
export function joinChanges(first: LookChange, second: LookChange): LookChange {
  return { ...changeByPatch(first.before, [...first.patch, ...second.patch]), after: second.after };
}

/** Apply a patch made for another state of the look: operations whose path no longer exists are dropped. */
export function rebasePatch(look: Look, patch: readonly PatchOp[]): Look {
  return patch.reduce((rebasedLook, operation) => {
    try {
      return changeByPatch(rebasedLook, [operation]).after;
    } catch {
      return rebasedLook; // removed by someone else
    }
  }, look);
}
