/** Sets and removes a material's normal map. */
import type { MaterialLook, Term } from "../../../protocol";
import { modelOf, models } from "../../../state/scene";
import { ROUGHNESS_MAP } from "./roughness";

/** True if normals finer than a pixel widen a term, as for imported normal maps: not for mirrors. */
function isWidened(term: Term): boolean {
  const roughness = modelOf(term)?.width_parameter === "roughness" ? term.params?.roughness : undefined;
  const mirrorsBelow = Math.max(0, ...models.value.map(({ specular_below }) => specular_below ?? 0));
  return roughness !== undefined && Math.min(...[roughness].flat()) >= mirrorsBelow;
}

/** The material with the normal map, at its current strength or 1. */
export function withNormals(material: MaterialLook, image: string): MaterialLook {
  const terms = material.terms.map((term) =>
    term.roughness_map === undefined && isWidened(term) ? { ...term, roughness_map: ROUGHNESS_MAP } : term,
  );
  return { ...material, terms, normal_map: { image, scale: material.normal_map?.scale ?? 1 } };
}

/** The material with its original normal map; terms no longer follow a roughness map derived from the image. */
export function withoutNormals(material: MaterialLook, original: MaterialLook | undefined): MaterialLook {
  const { normal_map: _image, ...bare } = material;
  const terms = material.terms.map((term, k) => {
    if (term.roughness_map !== ROUGHNESS_MAP || original?.terms[k]?.roughness_map !== undefined) return term;
    const { roughness_map: _followed, ...rest } = term;
    return rest;
  });
  return { ...bare, terms };
}
