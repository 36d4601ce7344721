/** Difference of two looks without recorded edits between them, such as a replaced look or the server's. */
import type { Look, PatchOp } from "../../protocol";
import { escapeToken } from "./pointer";

type JsonObject = Record<string, unknown>;

function isObject(value: unknown): value is JsonObject {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

/** Lists of objects of equal length are compared element by element; other lists are replaced as a whole. */
function areObjectLists(a: unknown, b: unknown): boolean {
  return Array.isArray(a) && Array.isArray(b) && a.length === b.length && a.every(isObject) && b.every(isObject);
}

function collectDifferences(path: string, from: unknown, to: unknown, patch: PatchOp[]): void {
  if (from === to) return;
  if (isObject(from) && isObject(to)) {
    for (const key of Object.keys(from)) {
      if (!Object.hasOwn(to, key)) patch.push({ op: "remove", path: `${path}/${escapeToken(key)}` });
    }
    for (const [key, value] of Object.entries(to)) {
      const next = `${path}/${escapeToken(key)}`;
      if (!Object.hasOwn(from, key)) patch.push({ op: "add", path: next, value });
      else if (isCurveTable(path)) replaceDocument(next, from[key], value, patch);
      else collectDifferences(next, from[key], value, patch);
    }
  } else if (areObjectLists(from, to)) {
    (to as JsonObject[]).forEach((value, index) =>
      collectDifferences(`${path}/${index}`, (from as JsonObject[])[index], value, patch),
    );
  } else replaceDocument(path, from, to, patch);
}

/** A curve's edits are one value, never sent in parts. */
function isCurveTable(path: string): boolean {
  return /^\/materials\/[^/]+\/terms\/\d+\/curves$/.test(path);
}

function replaceDocument(path: string, from: unknown, to: unknown, patch: PatchOp[]): void {
  if (!isDeepEqual(from, to)) patch.push({ op: "replace", path, value: to });
}

/** JSON Patch from one look to another. */
export function diffLooks(from: Look, to: Look): PatchOp[] {
  const patch: PatchOp[] = [];
  collectDifferences("", from, to, patch);
  return patch;
}

/** True if two values of a look are equal, regardless of member order. */
export function isDeepEqual(a: unknown, b: unknown): boolean {
  if (a === b) return true;
  if (Array.isArray(a) && Array.isArray(b))
    return a.length === b.length && a.every((value, k) => isDeepEqual(value, b[k]));
  if (!isObject(a) || !isObject(b)) return false;
  const keys = Object.keys(a);
  return (
    keys.length === Object.keys(b).length && keys.every((key) => Object.hasOwn(b, key) && isDeepEqual(a[key], b[key]))
  );
}
