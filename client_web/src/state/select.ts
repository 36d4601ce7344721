/** Selecting: a material opens its most telling curve, the highlight's where there is one; a light puts it away. */
import { batch } from "@preact/signals";
import { look, modelOf, selectedCurve, selectedLight, selectedMaterial, selectedTerm, terms } from "./store";

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
