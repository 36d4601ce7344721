/** What a step of the history is called: what was changed, then what was done to it. */
import { tokens } from "../document/pointer";
import type { Look, ModelBody } from "../protocol";

const BETWEEN = " · ";

/** "Teapot · half angle θh · move point": material, curve and deed of an edit at a pointer of the look. */
export function stepName(path: string, deed: string, look: Look, models: readonly ModelBody[]): string {
  const [table, named, , index, kind, name] = tokens(path);
  if (table === "lights" && named !== undefined) return named + BETWEEN + deed;
  if (table !== "materials" || named === undefined) return deed;
  if (kind !== "curves") return named + BETWEEN + deed;
  const term = look.materials[named]?.terms[Number(index)];
  const curves = models.find((model) => model.model === term?.model)?.curves;
  const label = curves?.find((curve) => curve.name === name)?.label ?? name;
  return [named, label, deed.charAt(0).toLowerCase() + deed.slice(1)].join(BETWEEN);
}

/** A label's material or light, null where it has none, and what was done with it. */
export function stepWords(label: string): { of: string | null; deed: string } {
  const end = label.indexOf(BETWEEN);
  return end < 0 ? { of: null, deed: label } : { of: label.slice(0, end), deed: label.slice(end + BETWEEN.length) };
}
