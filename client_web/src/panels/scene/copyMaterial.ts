/** Copies a material, and pastes it on all selected ones as one step. */
import { signal } from "@preact/signals";
import { replaceLook } from "../../edit/edit";
import type { MaterialLook, Term } from "../../protocol";
import { isImageReference } from "../../state/document/imageReference";
import { look } from "../../state/look";
import { selectedMaterial, selectedMaterials } from "../../state/selection";
import { showNote } from "../../ui/toasts";
import { withGlassOf } from "../inspector/glass/glass";
import { hasRoughnessMap, texturesOf } from "../inspector/terms";

export const copiedMaterial = signal<{ name: string; material: MaterialLook } | null>(null);

export function copyMaterial(): void {
  const name = selectedMaterial.peek();
  const material = name === null ? undefined : look.peek()?.materials[name];
  if (name === null || material === undefined) return;
  copiedMaterial.value = { name, material };
  showNote(`“${name}” copied.`);
}

/** A term for another material: uploaded images stay, textures of the scene only where the material has its own. */
function termFor(target: string, term: Term): Term {
  const { texture, roughness_map, ...rest } = term;
  const keepsTexture = isImageReference(texture) || (texture != null && texturesOf(target).includes(texture));
  const keepsMap = isImageReference(roughness_map) || (roughness_map != null && hasRoughnessMap(target));
  return { ...rest, texture: keepsTexture ? texture : null, ...(keepsMap && { roughness_map }) };
}

/** A material with the terms, normal map and glass of a copied one. Its shadow catcher and basis functions stay. */
export function pasteOn(target: string, current: MaterialLook, copied: MaterialLook): MaterialLook {
  const terms = copied.terms.map((term) => termFor(target, term));
  const { normal_map, ...rest } = current;
  const pasted = { ...rest, terms, ...(copied.normal_map == null ? {} : { normal_map: copied.normal_map }) };
  return withGlassOf(pasted, copied.glass);
}

export function pasteMaterial(): void {
  const [copied, current, targets] = [copiedMaterial.peek(), look.peek(), selectedMaterials.peek()];
  if (copied === null || current === null || targets.length === 0) return;
  const materials = { ...current.materials };
  for (const target of targets) {
    const material = materials[target];
    if (material !== undefined && target !== copied.name)
      materials[target] = pasteOn(target, material, copied.material);
  }
  const label = targets.length === 1 ? targets[0] : `${targets.length} materials`;
  replaceLook(`${label} · Paste “${copied.name}”`, { ...current, materials });
  if (copied.material.terms.some(({ texture }) => texture != null && !isImageReference(texture)))
    showNote(`The scene’s textures of “${copied.name}” stay with it; uploaded images are pasted.`);
}
