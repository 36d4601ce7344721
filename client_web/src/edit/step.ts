/** What a step of the history is called: what was changed, then what was done to it. */
import { tokens } from "../document/pointer";
import type { Look, ModelBody } from "../protocol";

/** "Teapot · half angle θh · move point": material, curve and deed of an edit at a pointer of the look. */
export function stepName(path: string, deed: string, look: Look, models: readonly ModelBody[]): string {
  const [table, named, , index, kind, name] = tokens(path);
  if (table === "lights" && named !== undefined) return `${named} · ${deed}`;
  if (table !== "materials" || named === undefined) return deed;
  if (kind !== "curves") return `${named} · ${deed}`;
  const term = look.materials[named]?.terms[Number(index)];
  const curves = models.find((model) => model.model === term?.model)?.curves;
  const label = curves?.find((curve) => curve.name === name)?.label ?? name;
  return `${named} · ${label} · ${deed.charAt(0).toLowerCase()}${deed.slice(1)}`;
}
