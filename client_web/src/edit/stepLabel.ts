/** Labels of history steps: the changed object, then the action. */
import { pointerTokens } from "../state/document/pointer";
import type { Look, ModelBody } from "../protocol";

const SEPARATOR = " · ";

/** "Teapot · half angle θh · move point": material, curve and action of an edit at a JSON pointer of the look. */
export function stepLabel(path: string, action: string, look: Look, models: readonly ModelBody[]): string {
  const [table, subject, , index, kind, name] = pointerTokens(path);
  if ((table === "lights" || table === "light_groups") && subject !== undefined) return subject + SEPARATOR + action;
  if (table !== "materials" || subject === undefined) return action;
  if (kind !== "curves") return subject + SEPARATOR + action;
  const term = look.materials[subject]?.terms[Number(index)];
  const curves = models.find((model) => model.model === term?.model)?.curves;
  const label = curves?.find((curve) => curve.name === name)?.label ?? name;
  return [subject, label, action.charAt(0).toLowerCase() + action.slice(1)].join(SEPARATOR);
}

/** Split a label into its material or light (null without one) and the action. */
export function splitStepLabel(label: string): { subject: string | null; action: string } {
  const end = label.indexOf(SEPARATOR);
  return end < 0
    ? { subject: null, action: label }
    : { subject: label.slice(0, end), action: label.slice(end + SEPARATOR.length) };
}
