/** The lights of the look: which is selected, and changing, adding and removing them. */
import { batch, computed } from "@preact/signals";
import type { Light } from "../protocol";
import { edit } from "../state/edit";
import { pointer } from "../state/pointer";
import { defaultLook, look, selectedLight } from "../state/store";

export const lights = computed<Record<string, Light>>(() => look.value?.lights ?? {});
export const lightNames = computed(() => Object.keys(lights.value));

/** The selected light, while it is there. */
export const openLight = computed<Light | null>(() => lights.value[selectedLight.value ?? ""] ?? null);

/** Whether a light was added here: it can be removed, where the scene's own can be switched off. */
export function isAdded(name: string): boolean {
  return defaultLook.value?.lights[name] === undefined;
}

export function lightPath(name: string, field?: string): string {
  return field === undefined ? pointer("lights", name) : pointer("lights", name, field);
}

/** Change a field of a light; during one gesture on one field that is one step. */
export function editLight(deed: string, name: string, field: string, value: unknown): void {
  edit(deed, lightPath(name, field), value);
}

export function addLight(name: string, light: Light): void {
  batch(() => {
    edit("Add", lightPath(name), light);
    selectedLight.value = name;
  });
}

export function removeLight(name: string): void {
  if (!isAdded(name)) return;
  if (selectedLight.peek() === name) selectedLight.value = null;
  edit("Remove", lightPath(name), undefined);
}
