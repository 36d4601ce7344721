/** JSON Patch (RFC 6902) as a server applies it, for checking what the client sends. */
import type { PatchOp } from "../src/protocol";

export function applyPatch<T>(document: T, patch: readonly PatchOp[]): T {
  let root = structuredClone(document) as unknown;
  for (const { op, path, value } of patch) {
    if (path === "") {
      root = structuredClone(value);
      continue;
    }
    const keys = path
      .slice(1)
      .split("/")
      .map((k) => k.replaceAll("~1", "/").replaceAll("~0", "~"));
    const last = keys.pop() as string;
    const parent = keys.reduce((node, key) => {
      if (!(key in (node as object))) throw new Error(`${path}: no ${key}`);
      return (node as Record<string, unknown>)[key];
    }, root) as Record<string, unknown>;
    if (op !== "add" && !(last in parent)) throw new Error(`${path} does not exist`);
    if (op === "remove") Reflect.deleteProperty(parent, last);
    else parent[last] = structuredClone(value);
  }
  return root as T;
}
