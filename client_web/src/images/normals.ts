/** What a material becomes with an image in the place of its normal map, and without it. */
import type { MaterialLook, Term } from "../protocol";
import { modelOf } from "../state/scene";

/** Below that a highlight is a mirror's, which bumps do not widen, as `relume.brdf.mirror.SOFT` has it. */
const SOFT = 0.06;

/** Whether bumps that are finer than a pixel make a term rougher: as of files that have a normal map. */
function isWidened(term: Term): boolean {
  const roughness = modelOf(term)?.width === "roughness" ? term.params?.roughness : undefined;
  return roughness !== undefined && Math.min(...[roughness].flat()) >= SOFT;
}

/** The material with the image, as strong as it was, or as it is. */
export function withNormals(material: MaterialLook, image: string): MaterialLook {
  const terms = material.terms.map((term) =>
    term.roughness_map === undefined && isWidened(term) ? { ...term, roughness_map: true } : term,
  );
  return { ...material, terms, normal_map: { image, scale: material.normal_map?.scale ?? 1 } };
}

/** The material with its own bumps; terms that follow a map for the image's sake alone follow none. */
export function withoutNormals(material: MaterialLook, own: MaterialLook | undefined): MaterialLook {
  const { normal_map: _image, ...bare } = material;
  const terms = material.terms.map((term, k) => {
    if (term.roughness_map !== true || own?.terms[k]?.roughness_map !== undefined) return term;
    const { roughness_map: _followed, ...rest } = term;
    return rest;
  });
  return { ...bare, terms };
}
