/** JSON Pointer (RFC 6901): the path of a value in a document. */

export function escapeToken(token: string): string {
  return token.replaceAll("~", "~0").replaceAll("/", "~1");
}

export function jsonPointer(...tokens: (string | number)[]): string {
  return tokens.map((token) => `/${escapeToken(String(token))}`).join("");
}

export function pointerTokens(path: string): string[] {
  if (path === "") return [];
  return path
    .slice(1)
    .split("/")
    .map((token) => token.replaceAll("~1", "/").replaceAll("~0", "~"));
}

/** The value at a pointer; undefined if missing. */
export function getAt(document: unknown, path: string): unknown {
  let value = document;
  for (const token of pointerTokens(path)) {
    if (typeof value !== "object" || value === null || !Object.hasOwn(value, token)) return undefined;
    value = (value as Record<string, unknown>)[token];
  }
  return value;
}

/** True if a pointer refers to a view setting, which is per user and allowed for read-only users. */
export function isViewSetting(path: string): boolean {
  return /^\/(display|transport)(\/|$)/.test(path);
}
