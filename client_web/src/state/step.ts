/** What a step of the history is called: what was changed, then what was done to it. */
import type { Look, ModelInfo } from "../protocol";
import { tokens } from "./pointer";

/** "Teapot · half angle θh · move point": material, curve and deed of an edit at a pointer of the look. */
export function stepName(path: string, deed: string, look: Look, models: readonly ModelInfo[]): string {
  const [table, material, , index, kind, name] = tokens(path);
  if (table !== "materials" || material === undefined) return deed;
  if (kind !== "curves") return `${material} · ${deed}`;
  const term = look.materials[material]?.terms[Number(index)];
  const curves = models.find((model) => model.model === term?.model)?.curves;
  const label = curves?.find((curve) => curve.name === name)?.label ?? name;
  return `${material} · ${label} · ${deed.charAt(0).toLowerCase()}${deed.slice(1)}`;
}
