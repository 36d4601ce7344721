/** The lights of the look: changing, adding, renaming and removing them. */
import { batch, computed } from "@preact/signals";
import { jsonPointer } from "../../state/document/pointer";
import { editValue, replaceLook } from "../../edit/edit";
import { MAX_LIGHTS } from "../../look.gen";
import type { Light, Look, Triple } from "../../protocol";
import { soloLight } from "../../state/visibility/soloSources";
import { defaultLook, look } from "../../state/look";
import { selectedLight, selectLight } from "../../state/selection";
import { showNote } from "../../ui/toasts";
import type { LightChange } from "./handleGeometry";
import { groupOfLight, lightGroups, withoutLights } from "./lightGroups";
import { isAddedKind, nameProblem, offsetCopy, nextLightName } from "./lightKinds";

export const lights = computed<Record<string, Light>>(() => look.value?.lights ?? {});
export const lightNames = computed(() => Object.keys(lights.value));

/** The selected light, if it exists. */
export const openLight = computed<Light | null>(() => lights.value[selectedLight.value ?? ""] ?? null);

/** True if a light was added in the editor: only these can be removed; the scene's lights can be turned off. */
export function isAddedLight(name: string): boolean {
  return defaultLook.value?.lights[name] === undefined;
}

export function lightPath(name: string, field?: string): string {
  return field === undefined ? jsonPointer("lights", name) : jsonPointer("lights", name, field);
}

/** Change a field of a light; edits of one gesture on one field are one step. */
export function editLight(label: string, name: string, field: string, value: unknown): void {
  editValue(label, lightPath(name, field), value);
}

export function addLight(name: string, light: Light): void {
  batch(() => {
    editValue("Add", lightPath(name), light);
    selectLight(name);
  });
}

/** Change fields of a light that belong together. */
export function changeLight(label: string, name: string, change: LightChange): void {
  const light = lights.peek()[name];
  const fields = Object.entries(change);
  if (light === undefined || fields.length === 0) return;
  if (fields.length === 1) editLight(label, name, ...(fields[0] as [string, Triple]));
  else editValue(label, lightPath(name), { ...light, ...change });
}

/** Add a copy of a light beside it. */
export function duplicateLight(name: string): void {
  const light = lights.peek()[name];
  if (light === undefined || !isAddedKind(light.kind)) return;
  if (lightNames.peek().length >= MAX_LIGHTS) showNote(`Limit of ${MAX_LIGHTS} lights reached. Remove one first.`);
  else addLight(nextLightName(name, lightNames.peek()), offsetCopy(light));
}

function withRenamedLight(groups: Look["light_groups"], name: string, to: string): Look["light_groups"] {
  const rename = (lights: string[]) => lights.map((light) => (light === name ? to : light));
  return Object.fromEntries(
    Object.entries(groups).map(([key, group]) => [
      key,
      group.lights.includes(name) ? { ...group, lights: rename(group.lights) } : group,
    ]),
  );
}

/** Rename a light that was added in the editor; it keeps its position in the list. */
export function renameLight(name: string, to: string): void {
  const current = look.peek();
  if (current === null || !isAddedLight(name) || to === name) return;
  const problem = nameProblem("light", to, current.lights);
  if (problem !== null) return showNote(problem);
  const renamed = Object.entries(current.lights).map(([entryName, light]) => [
    entryName === name ? to : entryName,
    light,
  ]);
  batch(() => {
    replaceLook(`${name} · Rename to ${to}`, {
      ...current,
      lights: Object.fromEntries(renamed) as Look["lights"],
      light_groups: withRenamedLight(current.light_groups, name, to),
    });
    if (selectedLight.peek() === name) selectedLight.value = to;
    if (soloLight.peek() === name) soloLight.value = to;
  });
}

export function removeLight(name: string): void {
  if (!isAddedLight(name)) return;
  if (selectedLight.peek() === name) selectedLight.value = null;
  const current = look.peek();
  if (current === null || !groupOfLight.peek().has(name)) return editValue("Remove", lightPath(name), undefined);
  const remaining = Object.fromEntries(Object.entries(current.lights).filter(([key]) => key !== name));
  const groups = withoutLights(lightGroups.peek(), [name]);
  replaceLook(`${name} · Remove`, { ...current, lights: remaining, light_groups: groups });
}
