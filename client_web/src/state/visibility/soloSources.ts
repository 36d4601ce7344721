/** Solo: one material in color, the others in dim gray; one light on, the others off. A view setting, not an edit. */
import { signal } from "@preact/signals";
import type { Look } from "../../protocol";
import { selectedLight, selectedMaterial } from "../selection";

/** The solo material; a display effect. */
export const soloMaterial = signal<string | null>(null);
/** The solo light source. */
export const soloLight = signal<string | null>(null);

/** The solo object after the button was pressed with `selected` selected. */
export function toggledSolo(current: string | null, selected: string | null): string | null {
  return selected === null || selected === current ? null : selected;
}

export function toggleMaterialSolo(): void {
  soloMaterial.value = toggledSolo(soloMaterial.value, selectedMaterial.value);
}

/** Toggle solo of the selection. */
export function toggleSolo(): void {
  if (selectedLight.value === null) toggleMaterialSolo();
  else toggleLightSolo(selectedLight.value);
}

export function toggleLightSolo(source: string): void {
  soloLight.value = toggledSolo(soloLight.value, source);
}

/** Name of the environment among the light sources; not a valid light name. */
export const ENVIRONMENT_SOURCE = "";

/** True if a look has this light source; a removed one can return by undo. */
export function hasLightSource(look: Look, source: string): boolean {
  return source === ENVIRONMENT_SOURCE || look.lights[source] !== undefined;
}

/** Names of the solo sources for the server; null: all. */
export function soloSources(look: Look): string[] | null {
  const source = soloLight.peek();
  if (source === null || !hasLightSource(look, source)) return null;
  return [source === ENVIRONMENT_SOURCE ? "environment" : source];
}
