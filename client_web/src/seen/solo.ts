/** Solo: one material as it is, the others in dim grey; one light alone, the others dark. What is seen, no edit. */
import { signal } from "@preact/signals";
import type { Look } from "../protocol";
import { selectedLight, selectedMaterial } from "../state/selection";

/** The material that is shown alone, the others in dim grey: the screen does that. */
export const solo = signal<string | null>(null);
/** The source of light that is seen alone. */
export const soloLight = signal<string | null>(null);

/** What is alone after the switch was pressed with `selected` selected. */
export function nextSolo(current: string | null, selected: string | null): string | null {
  return selected === null || selected === current ? null : selected;
}

export function toggleMaterialSolo(): void {
  solo.value = nextSolo(solo.value, selectedMaterial.value);
}

/** What is selected, alone. */
export function toggleSolo(): void {
  if (selectedLight.value === null) toggleMaterialSolo();
  else toggleLightSolo(selectedLight.value);
}

export function toggleLightSolo(source: string): void {
  soloLight.value = nextSolo(soloLight.value, source);
}

/** The environment among the lights: no light has this name. */
export const ENVIRONMENT = "";

/** Whether a look has this source of light; one that was removed can come back by undo. */
export function hasSource(look: Look, source: string): boolean {
  return source === ENVIRONMENT || look.lights[source] !== undefined;
}

/** Names of the sources that the server shall show alone; null: all. */
export function sourcesAlone(look: Look): string[] | null {
  const source = soloLight.peek();
  if (source === null || !hasSource(look, source)) return null;
  return [source === ENVIRONMENT ? "environment" : source];
}
