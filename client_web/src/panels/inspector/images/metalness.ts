/** Finds the metalness map of a material, and removes it from the terms; the server adds it. */
import { isImageReference } from "../../../state/document/imageReference";
import type { ImageBody, Term } from "../../../protocol";
import { modelOf } from "../../../state/scene";

/** Finds an image by its reference in terms. */
type FindImage = (texture: string) => ImageBody | undefined;

/** A higher reflectance at normal incidence means metal, as in `relume.images.base_color`. */
const MOST_DIELECTRIC = 0.2;

const metalnessTexture = (term: Term, find: FindImage): ImageBody | undefined => {
  const image = isImageReference(term.texture) ? find(term.texture) : undefined;
  return image !== undefined && image.metalness !== null ? image : undefined;
};

/** The material's metalness map. */
export function metalnessOf(terms: readonly Term[], find: FindImage): string | null {
  return terms.map((term) => metalnessTexture(term, find)?.metalness).find(isImageReference) ?? null;
}

/** True if a material has a diffuse term, and a highlight with an adjustable reflectance. */
export function canBeMetal(terms: readonly Term[]): boolean {
  const models = terms.map(modelOf);
  const shines = models.some(
    (model) => model?.texture === "specular" && model.parameters.some(({ name }) => name === "f0"),
  );
  return shines && models.some((model) => model?.texture === "diffuse");
}

function isMetal(terms: readonly Term[]): boolean {
  return terms.some((term) => [term.params?.f0 ?? 0].flat().some((value) => value > MOST_DIELECTRIC));
}

/** Terms without the map: diffuse terms get the base color below it, highlights the original textures. */
export function withoutMetalness(terms: readonly Term[], originals: readonly Term[], find: FindImage): Term[] {
  return terms.map((term, k) => {
    const image = metalnessTexture(term, find);
    if (image === undefined) return term;
    const original = originals[k]?.model === term.model ? originals[k] : undefined;
    if (modelOf(term)?.texture === "diffuse") {
      if (isImageReference(image.base)) return { ...term, texture: image.base };
      const shared = image.base === "scene" || isMetal(originals); // textures split by the importer are not a base color
      return { ...term, texture: original?.texture ?? null, color: (shared && original?.color) || term.color };
    }
    const f0 = original?.params?.f0;
    return {
      ...term,
      texture: original?.texture ?? null,
      params: f0 === undefined ? term.params : { ...term.params, f0 },
    };
  });
}
