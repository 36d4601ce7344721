/** The library of measured materials: what it holds, and putting one onto an object. */
import { computed, signal } from "@preact/signals";
import { listMaterials } from "../net/api";
import type { MaterialBody } from "../protocol";
import { edit } from "../state/edit";
import { pointer } from "../state/pointer";
import { select } from "../state/select";
import { selectedMaterial } from "../state/store";
import { attempt, note } from "../ui/toasts";

export const DRAG_TYPE = "application/x-relume-material";
export const libraryOpen = signal(false);
export const library = signal<MaterialBody[]>([]);
export const group = signal("all");
export const model = signal("cook_torrance");

const uniqueOf = (values: string[]) => [...new Set(values)].sort();
export const groups = computed(() => uniqueOf(library.value.map((material) => material.group)));
export const fittedModels = computed(() => uniqueOf(library.value.map((material) => material.model)));

/** One entry a material and source, of the model and group that are chosen. */
export const shown = computed(() =>
  library.value.filter((m) => m.model === model.value && (group.value === "all" || m.group === group.value)),
);

export async function openLibrary(): Promise<void> {
  libraryOpen.value = !libraryOpen.value;
  if (library.value.length > 0) return;
  await attempt(async () => {
    library.value = await listMaterials();
  });
}

/** Give an object the terms of a library material. */
export function putOn(target: string, id: string): void {
  const material = library.value.find((entry) => entry.id === id);
  if (material === undefined) return;
  edit(material.name, pointer("materials", target, "terms"), material.terms);
  select(target);
}

export function putOnSelected(id: string): void {
  if (selectedMaterial.value === null) note("Choose a material of the scene first; it takes what you pick here.");
  else putOn(selectedMaterial.value, id);
}
