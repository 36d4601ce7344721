/** Which terms of a material an image of metalness is in, and what they are without it; the server makes those with it. */
import { isImage } from "../document/texture";
import type { ImageBody, Term } from "../protocol";
import { modelOf } from "../state/scene";

/** Finds an image by the name that terms have for it. */
type Find = (texture: string) => ImageBody | undefined;

/** What reflects more than that head-on is metal somewhere, as `relume.images.base_colour` has it. */
const MOST_DIELECTRIC = 0.2;

const madeFor = (term: Term, find: Find): ImageBody | undefined => {
  const image = isImage(term.texture) ? find(term.texture) : undefined;
  return image !== undefined && image.metalness !== null ? image : undefined;
};

/** The image that says where the material is metal. */
export function metalnessOf(terms: readonly Term[], find: Find): string | null {
  return terms.map((term) => madeFor(term, find)?.metalness).find(isImage) ?? null;
}

/** Whether something of a material scatters light, and a highlight has a reflectance that a metal may change. */
export function mayBeMetal(terms: readonly Term[]): boolean {
  const models = terms.map(modelOf);
  const shines = models.some((model) => model?.texture === "specular" && model.parameters.some(({ name }) => name === "f0"));
  return shines && models.some((model) => model?.texture === "diffuse");
}

function isMetal(terms: readonly Term[]): boolean {
  return terms.some((term) => [term.params?.f0 ?? 0].flat().some((value) => value > MOST_DIELECTRIC));
}

/** Terms without the image: what scatters has the base colour that was under it, highlights what the scene's own have. */
export function withoutMetalness(terms: readonly Term[], own: readonly Term[], find: Find): Term[] {
  return terms.map((term, k) => {
    const image = madeFor(term, find);
    if (image === undefined) return term;
    const before = own[k]?.model === term.model ? own[k] : undefined;
    if (modelOf(term)?.texture === "diffuse") {
      if (isImage(image.base)) return { ...term, texture: image.base };
      const shared = image.base === "scene" || isMetal(own); // what the file shared out was no base colour
      return { ...term, texture: before?.texture ?? null, color: (shared && before?.color) || term.color };
    }
    const f0 = before?.params?.f0;
    return { ...term, texture: before?.texture ?? null, params: f0 === undefined ? term.params : { ...term.params, f0 } };
  });
}
