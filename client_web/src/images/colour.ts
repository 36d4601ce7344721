/** Which terms of a material its base colour is in, and what they become with an image in its place. */
import { isImage } from "../document/texture";
import type { Term } from "../protocol";
import { modelOf } from "../state/scene";

/** The channel of a term's texture, as `relume.brdf.channels` has it. */
export function channelOf(term: Term): string | null {
  const { texture } = term;
  return isImage(texture) ? (modelOf(term)?.texture ?? null) : (texture ?? null);
}

/** Places of the terms that show the base colour: what scatters light, or the highlights of a metal. */
function basePlaces(terms: readonly Term[]): number[] {
  const placesOf = (channel: string) => terms.flatMap((term, k) => (modelOf(term)?.texture === channel ? [k] : []));
  const diffuse = placesOf("diffuse");
  return diffuse.length > 0 ? diffuse : placesOf("specular");
}

/** Whether anything of a material shows a base color. */
export function hasBaseColor(terms: readonly Term[]): boolean {
  return basePlaces(terms).length > 0;
}

/** The texture of the base colour as it is. */
export function baseTexture(terms: readonly Term[]): string | null {
  const first = basePlaces(terms)[0];
  return first === undefined ? null : (terms[first]?.texture ?? null);
}

/** Give a term a texture, and the same to the others of its channel, which share one. */
export function withTexture(terms: readonly Term[], index: number, texture: string | null): Term[] {
  const given = terms.map((term, k) => (k === index ? { ...term, texture } : term));
  const channel = channelOf(given[index] as Term);
  return given.map((term) => (channel !== null && channelOf(term) === channel ? { ...term, texture } : term));
}

/** Put an image in the place of the base colour: a colour that stood alone becomes white, a tint of a texture stays. */
export function withBaseImage(terms: readonly Term[], texture: string): Term[] {
  return basePlaces(terms).reduce<Term[]>((made, place) => {
    const term = made[place] as Term;
    const alone = (terms[place]?.texture ?? null) === null;
    const bare = made.map((each, k) => (k === place && alone ? { ...term, color: [1, 1, 1] as Term["color"] } : each));
    return withTexture(bare, place, texture);
  }, [...terms]);
}

/** Terms without the image, as the scene's own have their textures and colours. */
export function withoutBaseImage(terms: readonly Term[], own: readonly Term[]): Term[] {
  return terms.map((term, k) => {
    if (!isImage(term.texture)) return term;
    const before = own[k]?.model === term.model ? own[k] : undefined;
    return { ...term, texture: before?.texture ?? null, color: before?.color ?? term.color };
  });
}
