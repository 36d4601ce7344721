/** Terms with a roughness map, and the same terms with an image as roughness map. */
import { isImageReference } from "../../../state/document/imageReference";
import type { ImageBody, ModelBody, ParamValue, Term } from "../../../protocol";
import { modelOf } from "../../../state/scene";

/** The `roughness_map` value for the material's original map. */
export const ROUGHNESS_MAP = "roughness";

const followsMap = (term: Term): boolean => term.roughness_map != null;

/** The image used as the material's roughness map; all terms with a map share it. */
export function roughnessImage(terms: readonly Term[]): string | null {
  return terms.map((term) => term.roughness_map).find(isImageReference) ?? null;
}

/** Indices of the terms that a dropped roughness map applies to: those with a map or able to have one, else all with a width. */
export function roughTermIndices(terms: readonly Term[]): number[] {
  const indicesWhere = (predicate: (term: Term) => boolean) =>
    terms.flatMap((term, k) => (modelOf(term)?.width_parameter != null && predicate(term) ? [k] : []));
  const following = indicesWhere((term) => term.roughness_map !== undefined);
  return following.length > 0 ? following : indicesWhere(() => true);
}

/** The width parameter for a roughness; null if the model defines it differently. */
function lobeWidth(model: ModelBody, roughness: number): ParamValue | null {
  const info = model.parameters.find(({ name }) => name === model.width_parameter);
  if (info === undefined || !((model.width_power ?? 0) > 0)) return null;
  const value = Math.min(Math.max(roughness ** (model.width_power as number), info.minimum), info.maximum);
  return Math.round(value * 1e4) / 1e4;
}

/** Set a term's roughness map: the original, an image, or none; other terms with a map share it. */
export function withMap(terms: readonly Term[], index: number, follows: string | null): Term[] {
  const image = isImageReference(follows) || roughnessImage(terms) !== null;
  return terms.map((term, k) => {
    const changes = k === index || (image && follows !== null && followsMap(term));
    return changes ? { ...term, roughness_map: follows } : term;
  });
}

/** Set an image as the terms' roughness map: the sliders start at its mean and scale it. */
export function withRoughnessImage(terms: readonly Term[], indices: readonly number[], image: ImageBody): Term[] {
  const following = indices.reduce<Term[]>((result, index) => withMap(result, index, image.texture), [...terms]);
  return following.map((term) => {
    const model = modelOf(term);
    if (model?.width_parameter == null || term.roughness_map !== image.texture) return term;
    const width = lobeWidth(model, image.roughness);
    return width === null ? term : { ...term, params: { ...term.params, [model.width_parameter]: width } };
  });
}

/** Terms without the image, with the original roughness. */
export function withoutRoughnessImage(terms: readonly Term[], originals: readonly Term[]): Term[] {
  return terms.map((term, k) => {
    if (!isImageReference(term.roughness_map)) return term;
    const original = originals[k]?.model === term.model ? originals[k] : undefined;
    const width = modelOf(term)?.width_parameter;
    const value = width == null ? undefined : original?.params?.[width];
    const params = width == null || value === undefined ? term.params : { ...term.params, [width]: value };
    const { roughness_map: _image, ...bare } = term;
    return {
      ...bare,
      params,
      ...(original?.roughness_map === undefined ? {} : { roughness_map: original.roughness_map }),
    };
  });
}
