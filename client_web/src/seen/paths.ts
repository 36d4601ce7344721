/** Which light paths are seen: a way of looking, no edit. A look may name some of its own, as one from a file does. */
import { computed, signal } from "@preact/signals";
import type { Look, Transport } from "../protocol";
import { look } from "../state/look";

/** The light paths that are seen in place of the look's own. */
export const seenPaths = signal<Transport | null>(null);

export const shownPaths = computed<Transport | null>(() => seenPaths.value ?? look.value?.transport ?? null);

/** See some light paths; those of the look are seen when nothing else is asked for. */
export function seePaths(paths: Transport): void {
  const own = look.peek()?.transport;
  seenPaths.value = own?.show === paths.show && own.bounces === paths.bounces ? null : paths;
}

const whole = new WeakMap<Look, Look>();

/** A look with the light paths that are seen. */
export function withSeenPaths(of: Look): Look {
  if (seenPaths.peek() === null) return of;
  const seen = { ...of, transport: seenPaths.peek() as Transport };
  whole.set(seen, of);
  return seen;
}

/** The look that a seen one was made of; any other is itself. */
export function wholeOf(seen: Look): Look {
  return whole.get(seen) ?? seen;
}
