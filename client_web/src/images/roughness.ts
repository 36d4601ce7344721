/** Which terms of a material follow a map of roughness, and what they become with an image in its place. */
import { isImage } from "../document/texture";
import type { ImageBody, ModelBody, ParamValue, Term } from "../protocol";
import { modelOf } from "../state/scene";

type Follows = NonNullable<Term["roughness_map"]>;

const isFollowing = (term: Term): boolean => term.roughness_map !== undefined && term.roughness_map !== false;

/** The image in the place of the material's map of roughness; all terms that follow one follow the same. */
export function roughnessImage(terms: readonly Term[]): string | null {
  return terms.map((term) => term.roughness_map).find(isImage) ?? null;
}

/** The terms that an image dropped on the object is for: those that follow a map or may, else all that have a width. */
export function roughPlaces(terms: readonly Term[]): number[] {
  const placesOf = (is: (term: Term) => boolean) => terms.flatMap((term, k) => (modelOf(term)?.width != null && is(term) ? [k] : []));
  const following = placesOf((term) => term.roughness_map !== undefined);
  return following.length > 0 ? following : placesOf(() => true);
}

/** The width of a term whose material is so rough; null where the model measures it otherwise. */
function widthOf(model: ModelBody, roughness: number): ParamValue | null {
  const info = model.parameters.find(({ name }) => name === model.width);
  if (info === undefined || !((model.width_power ?? 0) > 0)) return null;
  const value = Math.min(Math.max(roughness ** (model.width_power as number), info.minimum), info.maximum);
  return Math.round(value * 1e4) / 1e4;
}

/** Let a term follow a map, an image, or none; others that follow one follow the same. */
export function withMap(terms: readonly Term[], index: number, follows: Follows): Term[] {
  const image = isImage(follows) || roughnessImage(terms) !== null;
  return terms.map((term, k) => {
    const changes = k === index || (image && follows !== false && isFollowing(term));
    return changes ? { ...term, roughness_map: follows } : term;
  });
}

/** Let terms follow an image, as rough as it says: sliders show its mean, and scale it from there. */
export function withRoughnessImage(terms: readonly Term[], places: readonly number[], image: ImageBody): Term[] {
  const following = places.reduce<Term[]>((made, place) => withMap(made, place, image.texture), [...terms]);
  return following.map((term) => {
    const model = modelOf(term);
    if (model?.width == null || term.roughness_map !== image.texture) return term;
    const width = widthOf(model, image.roughness);
    return width === null ? term : { ...term, params: { ...term.params, [model.width]: width } };
  });
}

/** Terms without the image, as rough as the scene's own are. */
export function withoutRoughnessImage(terms: readonly Term[], own: readonly Term[]): Term[] {
  return terms.map((term, k) => {
    if (!isImage(term.roughness_map)) return term;
    const before = own[k]?.model === term.model ? own[k] : undefined;
    const width = modelOf(term)?.width;
    const value = width == null ? undefined : before?.params?.[width];
    const params = width == null || value === undefined ? term.params : { ...term.params, [width]: value };
    const { roughness_map: _image, ...bare } = term;
    return { ...bare, params, ...(before?.roughness_map === undefined ? {} : { roughness_map: before.roughness_map }) };
  });
}
