/** What the hand is on: said with every edit, so that nothing has to guess it from what the edit changed. */
import { signal } from "@preact/signals";
import { pointer, tokens } from "../document/pointer";
import type { Look } from "../protocol";

/** A pointer of the look to what a picture can be prepared for; null where the hand is on nothing such. */
export const hand = signal<string | null>(null);

/** What the hand is on while it edits a look at a pointer: a curve, a parameter, a colour or texture of a term, a light, a
 * field of the environment or of the light paths. */
export function heldAt(path: string, look: Look): string | null {
  const [table, name, , , member, field] = tokens(path);
  if (table === "lights") return name !== undefined && Object.hasOwn(look.lights, name) ? pointer(table, name) : null;
  if (table === "environment" || table === "transport") return name === undefined ? null : path;
  if (table !== "materials") return null;
  if (member === "color" || member === "texture") return path;
  return (member === "params" || member === "curves") && field !== undefined ? path : null;
}
