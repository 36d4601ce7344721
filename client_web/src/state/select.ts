/** Selecting a material opens its most telling curve: the highlight's where there is one. */
import { batch } from "@preact/signals";
import { look, modelOf, selectedCurve, selectedMaterial, selectedTerm, terms } from "./store";

export function selectTerm(index: number): void {
  if (index === selectedTerm.value) return;
  const term = terms.value[index];
  batch(() => {
    selectedTerm.value = index;
    selectedCurve.value = (term && modelOf(term)?.curves[0]?.name) ?? null;
  });
}

export function select(material: string | null): void {
  if (material === selectedMaterial.value) return;
  const own = (material === null ? undefined : look.value?.materials[material]?.terms) ?? [];
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
