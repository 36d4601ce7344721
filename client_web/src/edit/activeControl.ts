/** The active control: sent with every edit, so that the server need not infer it from the changed values. */
import { signal } from "@preact/signals";
import { jsonPointer, pointerTokens } from "../state/document/pointer";
import type { Look } from "../protocol";

/** JSON pointer to the look's value that the active control edits; null if nothing can be prepared for it. */
export const activeControl = signal<string | null>(null);

/** The active control of an edit at a JSON pointer: a curve, a parameter, a color or texture of a term, a light, a
 * light group, a field of the environment or of the light paths. */
export function activePath(path: string, look: Look): string | null {
  const [table, name, , , member, field] = pointerTokens(path);
  if (table === "lights")
    return name !== undefined && Object.hasOwn(look.lights, name) ? jsonPointer(table, name) : null;
  if (table === "light_groups")
    return name !== undefined && Object.hasOwn(look.light_groups, name) ? jsonPointer(table, name) : null;
  if (table === "environment" || table === "transport") return name === undefined ? null : path;
  if (table !== "materials") return null;
  if (member === "color" || member === "texture") return path;
  return (member === "params" || member === "curves") && field !== undefined ? path : null;
}
