/** The selection: selecting a material opens its most important curve, the highlight's if any; selecting a light closes it. */
import { batch, computed, signal } from "@preact/signals";
import { jsonPointer } from "./document/pointer";
import type { Term } from "../protocol";
import { look } from "./look";
import { modelOf } from "./scene";

export const selectedMaterial = signal<string | null>(null);
/** Materials selected together with `selectedMaterial`, which the inspector shows. */
export const alsoSelected = signal<readonly string[]>([]);
/** The inspector shows a light or a material. */
export const selectedLight = signal<string | null>(null);
export const selectedTerm = signal(0);
export const selectedCurve = signal<string | null>(null);
export const hoveredMaterial = signal<string | null>(null);

export const selectedTerms = computed<Term[]>(() => {
  const name = selectedMaterial.value;
  return name === null ? [] : (look.value?.materials[name]?.terms ?? []);
});

/** All selected materials, first the one that the inspector shows. Edits of a value apply to all that have it. */
export const selectedMaterials = computed<readonly string[]>(() => {
  const name = selectedMaterial.value;
  return name === null ? [] : [name, ...alsoSelected.value];
});

/** Pointer of the open curve; null without one. */
export const curvePath = computed(() => {
  const [material, curve] = [selectedMaterial.value, selectedCurve.value];
  const term = selectedTerms.value[selectedTerm.value];
  if (material === null || curve === null || term === undefined) return null;
  if (look.value?.materials[material]?.shadow_catcher) return null; // a shadow catcher's terms are invisible
  if (!modelOf(term)?.curves.some((info) => info.name === curve)) return null;
  return jsonPointer("materials", material, "terms", selectedTerm.value, "curves", curve);
});

export function selectTerm(index: number): void {
  if (index === selectedTerm.value) return;
  const term = selectedTerms.value[index];
  batch(() => {
    selectedTerm.value = index;
    selectedCurve.value = (term && modelOf(term)?.curves[0]?.name) ?? null;
  });
}

export function selectLight(name: string | null): void {
  batch(() => {
    if (name !== null) selectMaterial(null);
    selectedLight.value = name;
  });
}

export function selectMaterial(material: string | null): void {
  selectedLight.value = null;
  alsoSelected.value = [];
  if (material === selectedMaterial.value) return;
  const materialLook = material === null ? undefined : look.value?.materials[material];
  const materialTerms = materialLook === undefined || materialLook.shadow_catcher ? [] : materialLook.terms; // a shadow catcher's terms are invisible
  const index = Math.max(
    0,
    materialTerms.findIndex((term) => modelOf(term)?.texture !== "diffuse"),
  );
  const term = materialTerms[index];
  batch(() => {
    selectedMaterial.value = material;
    selectedTerm.value = index;
    selectedCurve.value = (term && modelOf(term)?.curves[0]?.name) ?? null;
  });
}

/** Select several materials; the inspector shows the first. */
export function selectMaterials([first, ...others]: readonly string[]): void {
  batch(() => {
    selectMaterial(first ?? null);
    alsoSelected.value = others;
  });
}

/** Add a material to the selection, or remove it. */
export function toggleMaterial(name: string): void {
  const remaining = selectedMaterials.value.filter((other) => other !== name);
  selectMaterials(remaining.length < selectedMaterials.value.length ? remaining : [...remaining, name]);
}

/** Select the materials of a list from the one that the inspector shows to `name`. */
export function selectMaterialsTo(name: string, names: readonly string[]): void {
  const start = names.indexOf(selectedMaterial.value ?? name);
  const end = names.indexOf(name);
  const range = names.slice(Math.min(start, end), Math.max(start, end) + 1);
  selectMaterials(start <= end ? range : range.reverse());
}
