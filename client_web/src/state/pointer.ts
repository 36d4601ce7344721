/** JSON Pointer (RFC 6901) on immutable documents: reading, and writing with structural sharing. */

export function escapeToken(token: string): string {
  return token.replaceAll("~", "~0").replaceAll("/", "~1");
}

export function pointer(...tokens: (string | number)[]): string {
  return tokens.map((token) => `/${escapeToken(String(token))}`).join("");
}

export function tokens(path: string): string[] {
  if (path === "") return [];
  return path
    .slice(1)
    .split("/")
    .map((token) => token.replaceAll("~1", "/").replaceAll("~0", "~"));
}

export function getAt(document: unknown, path: string): unknown {
  let value = document;
  for (const token of tokens(path)) {
    if (typeof value !== "object" || value === null || !Object.hasOwn(value, token)) return undefined;
    value = (value as Record<string, unknown>)[token];
  }
  return value;
}

function setTokens(document: unknown, path: string[], value: unknown): unknown {
  const [head, ...rest] = path;
  if (head === undefined) return value;
  if (Array.isArray(document)) {
    const copy = document.slice();
    copy[Number(head)] = setTokens(copy[Number(head)], rest, value);
    return copy;
  }
  const entries = { ...(document as Record<string, unknown> | undefined) };
  const next = setTokens(entries[head], rest, value);
  if (next === undefined) delete entries[head];
  else entries[head] = next;
  return entries;
}

/** A copy of `document` with `value` at `path`; missing objects on the way are made, `undefined` removes a member. */
export function setAt<T>(document: T, path: string, value: unknown): T {
  return setTokens(document, tokens(path), value) as T;
}
