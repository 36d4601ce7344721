/** Which light paths are seen: a way of looking, no edit. A look may name some of its own, as one from a file does. */
import { computed } from "@preact/signals";
import type { Transport } from "../protocol";
import { look, seenPaths } from "./store";

export const shownPaths = computed<Transport | null>(() => seenPaths.value ?? look.value?.transport ?? null);

/** See some light paths; those of the look are seen when nothing else is asked for. */
export function seePaths(paths: Transport): void {
  const own = look.peek()?.transport;
  seenPaths.value = own?.show === paths.show && own.bounces === paths.bounces ? null : paths;
}
