/** The JSON Patch that turns the look the server has into the look the user wants. */
import type { Look, PatchOp } from "../protocol";
import { escapeToken, setAt } from "./pointer";

type Json = Record<string, unknown>;

function isObject(value: unknown): value is Json {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

function sameValue(a: unknown, b: unknown): boolean {
  return a === b || JSON.stringify(a) === JSON.stringify(b);
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
  if (!sameValue(from, to)) patch.push({ op: "replace", path, value: to });
}

/** Operations from `from` to `to`; the whole look where nothing is known about the server's. */
export function diffLooks(from: Look | null, to: Look): PatchOp[] {
  if (from === null) return [{ op: "replace", path: "", value: to }];
  const patch: PatchOp[] = [];
  walk("", from, to, patch);
  return patch;
}

/** What `diffLooks` took apart: the look with these operations done, sharing what they leave alone. */
export function applied(from: Look, patch: readonly PatchOp[]): Look {
  return patch.reduce((look, { op, path, value }) => setAt(look, path, op === "remove" ? undefined : value), from);
}
