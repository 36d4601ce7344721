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

const GROUP_PREFIX = "group:";

/** Name of a light group among the light sources. */
export const groupSource = (group: string) => GROUP_PREFIX + group;

/** Names of the lights of a source, none of the environment; null if a look has no such source: a removed one can return
 * by undo. */
export function lightsOfSource(look: Look, source: string): readonly string[] | null {
  if (source === ENVIRONMENT_SOURCE) return [];
  if (Object.hasOwn(look.lights, source)) return [source];
  return source.startsWith(GROUP_PREFIX)
    ? (look.light_groups[source.slice(GROUP_PREFIX.length)]?.lights ?? null)
    : null;
}

/** A light source as people name it. */
export function sourceLabel(look: Look, source: string): string {
  if (source === ENVIRONMENT_SOURCE) return "environment";
  return Object.hasOwn(look.lights, source) ? source : source.slice(GROUP_PREFIX.length);
}

/** Names of the solo sources for the server; null: all. */
export function soloSources(look: Look): string[] | null {
  const source = soloLight.peek();
  const names = source === null ? null : lightsOfSource(look, source);
  if (source === ENVIRONMENT_SOURCE) return ["environment"];
  return names === null || names.length === 0 ? null : [...names];
}
