/** Solo: one material as it is, the others in dim gray; one light alone, the others dark. A view setting, no edit. */
import { signal } from "@preact/signals";
import type { Look } from "../../protocol";
import { selectedLight, selectedMaterial } from "../selection";

/** The material that is shown alone, the others in dim gray: the screen does that. */
export const soloMaterial = signal<string | null>(null);
/** The light source shown alone. */
export const soloLight = signal<string | null>(null);

/** What is alone after the switch was pressed with `selected` selected. */
export function toggledSolo(current: string | null, selected: string | null): string | null {
  return selected === null || selected === current ? null : selected;
}

export function toggleMaterialSolo(): void {
  soloMaterial.value = toggledSolo(soloMaterial.value, selectedMaterial.value);
}

/** What is selected, alone. */
export function toggleSolo(): void {
  if (selectedLight.value === null) toggleMaterialSolo();
  else toggleLightSolo(selectedLight.value);
}

export function toggleLightSolo(source: string): void {
  soloLight.value = toggledSolo(soloLight.value, source);
}

/** The environment among the lights: no light has this name. */
export const ENVIRONMENT_SOURCE = "";

/** Whether a look has this source of light; one that was removed can come back by undo. */
export function hasLightSource(look: Look, source: string): boolean {
  return source === ENVIRONMENT_SOURCE || look.lights[source] !== undefined;
}

/** Names of the sources that the server shall show alone; null: all. */
export function soloSources(look: Look): string[] | null {
  const source = soloLight.peek();
  if (source === null || !hasLightSource(look, source)) return null;
  return [source === ENVIRONMENT_SOURCE ? "environment" : source];
}
