/** Making terms: defaults from the model's declaration, and changing a model without losing what both have. */
import { isImageReference } from "../../state/document/imageReference";
import type { ModelBody, Term } from "../../protocol";
import { materialOf, modelOf } from "../../state/scene";

/** Labels of the images that a material may have. */
export const TEXTURES: Record<string, string> = { diffuse: "Base colour", specular: "Highlight" };

/** Those that a material of the scene has: its own terms take them. */
export function texturesOf(material: string): string[] {
  const ownTerms = materialOf(material)?.terms ?? [];
  return Object.keys(TEXTURES).filter((channel) => ownTerms.some((term) => term.texture === channel));
}

/** Whether a material of the scene has a map that its terms' widths may follow. */
export function hasRoughnessMap(material: string): boolean {
  return materialOf(material)?.terms.some((term) => term.roughness_map !== undefined) ?? false;
}

/** Whether a term is so smooth that it is a mirror rather than a highlight, by `relume/brdf/specular.py`. */
export function isMirror(term: Term): boolean {
  const { specular_below: below, width_parameter, curves } = modelOf(term) ?? {};
  if (below == null || width_parameter == null || term.roughness_map != null) return false;
  if (term.texture === "diffuse" || isImageReference(term.texture)) return false;
  const facets = curves?.find(({ angle }) => angle === "theta_h");
  if (facets !== undefined && term.curves?.[facets.name] !== undefined) return false;
  return [term.params?.[width_parameter] ?? below].flat().some((value) => value < below);
}

/** Whether what a term mirrors is shown blurred, since its material mirrored nothing when the scene was baked. */
export function isSoftMirror(material: string, term: Term): boolean {
  return isMirror(term) && materialOf(material)?.terms.some(isMirror) === false;
}

export function defaultTerm(model: ModelBody): Term {
  return {
    model: model.model,
    color: model.texture === "diffuse" ? [0.2, 0.2, 0.2] : [0.5, 0.5, 0.5],
    params: Object.fromEntries(model.parameters.map((info) => [info.name, info.default])),
    texture: null,
    curves: {},
  };
}

/** The models that a term can take: those that are measured only where it names a measurement of their kind. */
export function modelsFor(term: Term | null, models: readonly ModelBody[]): readonly ModelBody[] {
  return models.filter(({ data_prefix: prefix }) => prefix === null || term?.data?.startsWith(prefix) === true);
}

/** The term under another model: color and texture stay, and parameters of the same name; the map of roughness where
 * the new model has a width. Drawn curves belong to the old model's angles and go; a measured material stays where the
 * new model is measured too. */
export function withModel(term: Term, name: string, models: readonly ModelBody[]): Term {
  const model = models.find((m) => m.model === name);
  if (model === undefined) return term;
  const params = Object.fromEntries(
    model.parameters.map((info) => [info.name, term.params?.[info.name] ?? info.default]),
  );
  const { data, roughness_map: follows, ...remainingFields } = term;
  const measured = model.data_prefix !== null && data?.startsWith(model.data_prefix) === true ? { data } : {};
  const mapped = follows === undefined || model.width_parameter === null ? {} : { roughness_map: follows };
  return { ...remainingFields, ...measured, ...mapped, model: name, params, curves: {} };
}
