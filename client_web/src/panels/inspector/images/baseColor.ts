/** Terms with the base color, and the same terms with an image as base color. */
import { isImageReference } from "../../../state/document/imageReference";
import type { Term } from "../../../protocol";
import { modelOf } from "../../../state/scene";

/** The texture slot of a term, as in `relume.brdf.texture_slots`. */
export function channelOf(term: Term): string | null {
  const { texture } = term;
  return isImageReference(texture) ? (modelOf(term)?.texture ?? null) : (texture ?? null);
}

/** Indices of the terms with the base color: diffuse terms, or the highlights of a metal. */
function baseTermIndices(terms: readonly Term[]): number[] {
  const indicesOf = (channel: string) => terms.flatMap((term, k) => (modelOf(term)?.texture === channel ? [k] : []));
  const diffuse = indicesOf("diffuse");
  return diffuse.length > 0 ? diffuse : indicesOf("specular");
}

/** True if a term of the material has a base color. */
export function hasBaseColor(terms: readonly Term[]): boolean {
  return baseTermIndices(terms).length > 0;
}

/** The current base-color texture. */
export function baseTexture(terms: readonly Term[]): string | null {
  const first = baseTermIndices(terms)[0];
  return first === undefined ? null : (terms[first]?.texture ?? null);
}

/** Set a term's texture, also for the other terms of its slot, which share one. */
export function withTexture(terms: readonly Term[], index: number, texture: string | null): Term[] {
  const given = terms.map((term, k) => (k === index ? { ...term, texture } : term));
  const channel = channelOf(given[index] as Term);
  return given.map((term) => (channel !== null && channelOf(term) === channel ? { ...term, texture } : term));
}

/** Set an image as base color: a color without a texture becomes white; the tint of a texture stays. */
export function withBaseImage(terms: readonly Term[], texture: string): Term[] {
  return baseTermIndices(terms).reduce<Term[]>(
    (result, index) => {
      const term = result[index] as Term;
      const isUntextured = (terms[index]?.texture ?? null) === null;
      const bare = result.map((current, k) =>
        k === index && isUntextured ? { ...term, color: [1, 1, 1] as Term["color"] } : current,
      );
      return withTexture(bare, index, texture);
    },
    [...terms],
  );
}

/** Terms without the image, with the textures and colors of the original ones. */
export function withoutBaseImage(terms: readonly Term[], originals: readonly Term[]): Term[] {
  return terms.map((term, k) => {
    if (!isImageReference(term.texture)) return term;
    const original = originals[k]?.model === term.model ? originals[k] : undefined;
    return { ...term, texture: original?.texture ?? null, color: original?.color ?? term.color };
  });
}
