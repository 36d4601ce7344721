/** JSON Pointer (RFC 6901): the place of a value in a document. */

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

/** The value at a pointer; undefined where there is none. */
export function getAt(document: unknown, path: string): unknown {
  let value = document;
  for (const token of tokens(path)) {
    if (typeof value !== "object" || value === null || !Object.hasOwn(value, token)) return undefined;
    value = (value as Record<string, unknown>)[token];
  }
  return value;
}

/** Whether a pointer is to a way of looking, which each has for themselves and who may not edit, too. */
export function isWayOfLooking(path: string): boolean {
  return /^\/(display|transport)(\/|$)/.test(path);
}
