/** The visible light paths: a view setting, not an edit. A look, as from a file, may have its own. */
import { computed, signal } from "@preact/signals";
import type { Look, Transport } from "../../protocol";
import { look } from "../look";

/** Override of the look's light paths. */
export const pathOverride = signal<Transport | null>(null);

export const visiblePaths = computed<Transport | null>(() => pathOverride.value ?? look.value?.transport ?? null);

/** Set the visible light paths; null: those of the look. */
export function setVisiblePaths(paths: Transport): void {
  const lookPaths = look.peek()?.transport;
  pathOverride.value = lookPaths?.show === paths.show && lookPaths.bounces === paths.bounces ? null : paths;
}

const fullLooks = new WeakMap<Look, Look>();

/** A look with the visible light paths. */
export function withVisiblePaths(fullLook: Look): Look {
  if (pathOverride.peek() === null) return fullLook;
  const visibleLook = { ...fullLook, transport: pathOverride.peek() as Transport };
  fullLooks.set(visibleLook, fullLook);
  return visibleLook;
}

/** The unfiltered look of a visible look; other looks are returned as they are. */
export function fullLookOf(visibleLook: Look): Look {
  return fullLooks.get(visibleLook) ?? visibleLook;
}
