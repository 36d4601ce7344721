/** Edits of glass: light that it transmits, and the reflections that follow from the same surface. */
import type { GlassLook } from "../../../look.gen";
import type { MaterialLook, ParamValue, Term } from "../../../protocol";
import { modelOf } from "../../../state/scene";

const TOLERANCE = 1e-3;

/** Fresnel reflectance at normal incidence. */
export function reflectanceOf(ior: number): number {
  return ((ior - 1) / (ior + 1)) ** 2;
}

/** True for a parameter with this value in all channels. */
function hasValue(value: ParamValue | undefined, expected: number): boolean {
  return value !== undefined && [value].flat().every((channel) => Math.abs(channel - expected) < TOLERANCE);
}

/** A value within the range of a term's parameter; without the parameter, as it is. */
function inRange(term: Term, name: string, value: number): number {
  const parameter = modelOf(term)?.parameters.find((declared) => declared.name === name);
  return parameter === undefined ? value : Math.min(parameter.maximum, Math.max(parameter.minimum, value));
}

/** The material with the glass of another one, if it is glass in the scene; only solids absorb. */
export function withGlassOf(material: MaterialLook, glass: MaterialLook["glass"]): MaterialLook {
  if (!material.glass || !glass) return material;
  const { color, roughness, ior } = glass;
  const absorbing = material.glass.absorption ? glass : {};
  return { ...material, glass: { ...material.glass, ...absorbing, color, roughness, ior } };
}

/** The material with edited glass. Terms that reflect as the glass before reflect as the glass after: their f0 follows
 * the index of refraction, and their roughness that of the glass. */
export function withGlass(material: MaterialLook, change: Partial<GlassLook>): MaterialLook {
  const before = material.glass;
  if (before === undefined || before === null) return material;
  const after = { ...before, ...change };
  const follow = (term: Term, name: string, old: number, next: number): Term =>
    old !== next && hasValue(term.params?.[name], inRange(term, name, old))
      ? { ...term, params: { ...term.params, [name]: inRange(term, name, next) } }
      : term;
  const terms = material.terms.map((term) =>
    follow(
      follow(term, "f0", reflectanceOf(before.ior), reflectanceOf(after.ior)),
      "roughness",
      before.roughness,
      after.roughness,
    ),
  );
  return { ...material, terms, glass: after };
}
