/** Which terms of a material an image of metalness is in, and what they are without it; the server makes those with it. */
import { isImageReference } from "../../../state/document/imageReference";
import type { ImageBody, Term } from "../../../protocol";
import { modelOf } from "../../../state/scene";

/** Finds an image by the name that terms have for it. */
type FindImage = (texture: string) => ImageBody | undefined;

/** What reflects more than that head-on is metal somewhere, as `relume.images.base_color` has it. */
const MOST_DIELECTRIC = 0.2;

const metalnessTexture = (term: Term, find: FindImage): ImageBody | undefined => {
  const image = isImageReference(term.texture) ? find(term.texture) : undefined;
  return image !== undefined && image.metalness !== null ? image : undefined;
};

/** The image that says where the material is metal. */
export function metalnessOf(terms: readonly Term[], find: FindImage): string | null {
  return terms.map((term) => metalnessTexture(term, find)?.metalness).find(isImageReference) ?? null;
}

/** Whether something of a material scatters light, and a highlight has a reflectance that a metal may change. */
export function canBeMetal(terms: readonly Term[]): boolean {
  const models = terms.map(modelOf);
  const shines = models.some((model) => model?.texture === "specular" && model.parameters.some(({ name }) => name === "f0"));
  return shines && models.some((model) => model?.texture === "diffuse");
}

function isMetal(terms: readonly Term[]): boolean {
  return terms.some((term) => [term.params?.f0 ?? 0].flat().some((value) => value > MOST_DIELECTRIC));
}

/** Terms without the image: what scatters has the base color that was under it, highlights what the scene's own have. */
export function withoutMetalness(terms: readonly Term[], originals: readonly Term[], find: FindImage): Term[] {
  return terms.map((term, k) => {
    const image = metalnessTexture(term, find);
    if (image === undefined) return term;
    const original = originals[k]?.model === term.model ? originals[k] : undefined;
    if (modelOf(term)?.texture === "diffuse") {
      if (isImageReference(image.base)) return { ...term, texture: image.base };
      const shared = image.base === "scene" || isMetal(originals); // what the file shared out was no base color
      return { ...term, texture: original?.texture ?? null, color: (shared && original?.color) || term.color };
    }
    const f0 = original?.params?.f0;
    return { ...term, texture: original?.texture ?? null, params: f0 === undefined ? term.params : { ...term.params, f0 } };
  });
}
