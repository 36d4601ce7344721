/** How two looks differ that no edit leads between: one that is shown in another's place, or what a server holds. */
import type { Look, PatchOp } from "../protocol";
import { escapeToken } from "./pointer";

type Json = Record<string, unknown>;

function isObject(value: unknown): value is Json {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

/** Lists of objects of equal length are compared one by one; everything else in a list is replaced whole. */
function alike(a: unknown, b: unknown): boolean {
  return Array.isArray(a) && Array.isArray(b) && a.length === b.length && a.every(isObject) && b.every(isObject);
}

function walk(path: string, from: unknown, to: unknown, patch: PatchOp[]): void {
  if (from === to) return;
  if (isObject(from) && isObject(to)) {
    for (const key of Object.keys(from)) {
      if (!Object.hasOwn(to, key)) patch.push({ op: "remove", path: `${path}/${escapeToken(key)}` });
    }
    for (const [key, value] of Object.entries(to)) {
      const next = `${path}/${escapeToken(key)}`;
      if (!Object.hasOwn(from, key)) patch.push({ op: "add", path: next, value });
      else if (isCurveTable(path)) replaceWhole(next, from[key], value, patch);
      else walk(next, from[key], value, patch);
    }
  } else if (alike(from, to)) {
    (to as Json[]).forEach((value, index) => walk(`${path}/${index}`, (from as Json[])[index], value, patch));
  } else replaceWhole(path, from, to, patch);
}

/** A curve's edits are one value: half of a drawn curve never travels alone. */
function isCurveTable(path: string): boolean {
  return /^\/materials\/[^/]+\/terms\/\d+\/curves$/.test(path);
}

function replaceWhole(path: string, from: unknown, to: unknown, patch: PatchOp[]): void {
  if (!isSame(from, to)) patch.push({ op: "replace", path, value: to });
}

/** The operations of a JSON Patch that lead from a look to another. */
export function differenceOf(from: Look, to: Look): PatchOp[] {
  const patch: PatchOp[] = [];
  walk("", from, to, patch);
  return patch;
}

/** Whether two values of a look say the same, in whatever order their members are. */
export function isSame(a: unknown, b: unknown): boolean {
  if (a === b) return true;
  if (Array.isArray(a) && Array.isArray(b)) return a.length === b.length && a.every((value, k) => isSame(value, b[k]));
  if (!isObject(a) || !isObject(b)) return false;
  const keys = Object.keys(a);
  return keys.length === Object.keys(b).length && keys.every((key) => Object.hasOwn(b, key) && isSame(a[key], b[key]));
}
