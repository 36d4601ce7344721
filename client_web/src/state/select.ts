/** Selecting a material opens its most telling curve: the highlight's where there is one. */
import { batch } from "@preact/signals";
import { look, modelOf, selectedCurve, selectedMaterial, selectedTerm } from "./store";

export function select(material: string | null): void {
  if (material === selectedMaterial.value) return;
  const terms = (material === null ? undefined : look.value?.materials[material]?.terms) ?? [];
  const glossy = terms.findIndex((term) => modelOf(term)?.texture !== "diffuse");
  const index = Math.max(0, glossy);
  const term = terms[index];
  batch(() => {
    selectedMaterial.value = material;
    selectedTerm.value = index;
    selectedCurve.value = (term && modelOf(term)?.curves[0]?.name) ?? null;
  });
}
