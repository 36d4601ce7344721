/** What is selected: a material opens its most telling curve, the highlight's where there is one; a light puts it away. */
import { batch, computed, signal } from "@preact/signals";
import { pointer } from "../document/pointer";
import type { Term } from "../protocol";
import { look } from "./look";
import { modelOf } from "./scene";

export const selectedMaterial = signal<string | null>(null);
/** The inspector shows a light or a material. */
export const selectedLight = signal<string | null>(null);
export const selectedTerm = signal(0);
export const selectedCurve = signal<string | null>(null);
export const hoveredMaterial = signal<string | null>(null);

export const terms = computed<Term[]>(() => {
  const name = selectedMaterial.value;
  return name === null ? [] : (look.value?.materials[name]?.terms ?? []);
});

/** Pointer of the curve that is open, null where none is. */
export const curvePath = computed(() => {
  const [material, curve] = [selectedMaterial.value, selectedCurve.value];
  const term = terms.value[selectedTerm.value];
  if (material === null || curve === null || term === undefined) return null;
  if (look.value?.materials[material]?.catcher) return null; // of a catcher's terms nothing is seen
  if (!modelOf(term)?.curves.some((info) => info.name === curve)) return null;
  return pointer("materials", material, "terms", selectedTerm.value, "curves", curve);
});

export function selectTerm(index: number): void {
  if (index === selectedTerm.value) return;
  const term = terms.value[index];
  batch(() => {
    selectedTerm.value = index;
    selectedCurve.value = (term && modelOf(term)?.curves[0]?.name) ?? null;
  });
}

export function selectLight(name: string | null): void {
  batch(() => {
    if (name !== null) select(null);
    selectedLight.value = name;
  });
}

export function select(material: string | null): void {
  selectedLight.value = null;
  if (material === selectedMaterial.value) return;
  const chosen = material === null ? undefined : look.value?.materials[material];
  const own = chosen === undefined || chosen.catcher ? [] : chosen.terms; // of a catcher's terms nothing is seen
  const index = Math.max(
    0,
    own.findIndex((term) => modelOf(term)?.texture !== "diffuse"),
  );
  const term = own[index];
  batch(() => {
    selectedMaterial.value = material;
    selectedTerm.value = index;
    selectedCurve.value = (term && modelOf(term)?.curves[0]?.name) ?? null;
  });
}
