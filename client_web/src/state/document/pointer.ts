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

/** The value at a pointer; undefined where there is none. */
export function getAt(document: unknown, path: string): unknown {
  let value = document;
  for (const token of pointerTokens(path)) {
    if (typeof value !== "object" || value === null || !Object.hasOwn(value, token)) return undefined;
    value = (value as Record<string, unknown>)[token];
  }
  return value;
}

/** Whether a pointer is to a way of looking, which each has for themselves and who may not edit, too. */
export function isViewSetting(path: string): boolean {
  return /^\/(display|transport)(\/|$)/.test(path);
}
