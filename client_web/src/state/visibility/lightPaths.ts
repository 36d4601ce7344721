/** Which light paths are visible: a view setting, no edit. A look may name some of its own, as one from a file does. */
import { computed, signal } from "@preact/signals";
import type { Look, Transport } from "../../protocol";
import { look } from "../look";

/** The light paths shown in place of the look's own. */
export const pathOverride = signal<Transport | null>(null);

export const visiblePaths = computed<Transport | null>(() => pathOverride.value ?? look.value?.transport ?? null);

/** Show some light paths; without an override those of the look are shown. */
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

/** The full look of a visible look; any other is itself. */
export function fullLookOf(visibleLook: Look): Look {
  return fullLooks.get(visibleLook) ?? visibleLook;
}
