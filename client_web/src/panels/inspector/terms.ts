/** Creates terms with a model's defaults, and changes a term's model, keeping shared settings. */
import { isImageReference } from "../../state/document/imageReference";
import type { DrawnCurve, ModelBody, Term } from "../../protocol";
import { materialOf, modelOf } from "../../state/scene";

/** Labels of a material's texture slots. */
export const TEXTURES: Record<string, string> = { diffuse: "Base color", specular: "Specular" };

/** Texture slots that a material's original terms use. */
export function texturesOf(material: string): string[] {
  const ownTerms = materialOf(material)?.terms ?? [];
  return Object.keys(TEXTURES).filter((channel) => ownTerms.some((term) => term.texture === channel));
}

/** True if a material of the scene has a roughness map. */
export function hasRoughnessMap(material: string): boolean {
  return materialOf(material)?.terms.some((term) => term.roughness_map !== undefined) ?? false;
}

/** True if a term is smooth enough to be a mirror, by the rule of `relume/brdf/specular.py`. */
export function isMirror(term: Term): boolean {
  const { specular_below: below, width_parameter, curves } = modelOf(term) ?? {};
  if (below == null || width_parameter == null || term.roughness_map != null) return false;
  if (term.texture === "diffuse" || isImageReference(term.texture)) return false;
  const facets = curves?.find(({ angle }) => angle === "theta_h");
  if (facets !== undefined && term.curves?.[facets.name] !== undefined) return false;
  return [term.params?.[width_parameter] ?? below].flat().some((value) => value < below);
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

/** "LV" of Ben-Artzi 2006, table 1: diffuse, times a drawn curve of the light angle and one of the view angle. Both start
 * at one. */
export const LIGHT_VIEW = { name: "light_view", label: "Light–view, LV (diffuse, drawn)" };

export function lightViewTerm(models: readonly ModelBody[]): Term | null {
  const lambert = models.find(({ model }) => model === "lambert");
  const one: DrawnCurve = {
    points: [
      [0, 1],
      [90, 1],
    ],
  };
  return lambert === undefined ? null : { ...defaultTerm(lambert), curves: { theta_i: one, theta_o: one } };
}

/** The models that a term can have: measured models only if it refers to a measurement of their kind. */
export function modelsFor(term: Term | null, models: readonly ModelBody[]): readonly ModelBody[] {
  return models.filter(({ data_prefix: prefix }) => prefix === null || term?.data?.startsWith(prefix) === true);
}

/** The term with another model: keeps color, texture and parameters of the same name, and the roughness map if the new
 * model has a width. Edited curves belong to the old model's angles and are dropped; a measurement stays if the new
 * model is measured too. */
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
