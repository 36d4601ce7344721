/** Undo and redo for buttons and keys: a step that cannot be undone now is reported, and stays. */
import { changeByPatch, changeToLook, type LookChange } from "../../state/document/jsonPatch";
import { isDeepEqual } from "../../state/document/difference";
import { getAt } from "../../state/document/pointer";
import { cancelPreview, applyChange } from "../../edit/edit";
import { history, type LookStep, type Step } from "../../edit/history";
import type { Look } from "../../protocol";
import { look } from "../../state/look";
import { isInRoom } from "../../state/collaboration";
import { reportErrors, showNote } from "../../ui/toasts";
import { keyframes } from "./keyframes";
import { exchangeSavedLook, whenSaved } from "./savedLooks";

function reverseStep({ before, after, patch, inverse }: LookStep): LookChange {
  return { before: after, after: before, patch: inverse, inverse: patch };
}

/** Of a change what nobody else has come to since: each undoes their own edits. */
function isUnchangedSince(change: LookChange, step: LookStep, current: Look): LookChange {
  const patch = change.patch.filter(({ path }) => isDeepEqual(getAt(current, path), getAt(change.before, path)));
  if (patch.length < change.patch.length) showNote(`Others have edited what “${step.label}” changed. That stays as they made it.`);
  return changeByPatch(current, patch);
}

/** Make a change of the look that is there: where that is not what the change begins with, because the server refused
 * an edit in between, the way to its end is another. */
function applyStep(step: Step, isUndo: boolean): void | Promise<void> {
  if (step.kind === "timeline") return void (keyframes.value = isUndo ? step.before : step.after);
  if (step.kind === "shelf") return isUndo ? exchangeSavedLook(step.after, step.before) : exchangeSavedLook(step.before, step.after);
  const change = isUndo ? reverseStep(step) : step;
  const current = look.peek();
  if (isInRoom.peek() && current !== null) return applyChange(isUnchangedSince(change, step, current));
  applyChange(current === null || current === change.before ? change : changeToLook(current, change.after));
}

export function goToStep(count: number): void {
  cancelPreview();
  void reportErrors(() => history.goTo(count, applyStep));
}

/** A look that is being saved, renamed or deleted is a step when that is done: the press refers to what was displayed by then. */
async function moveInHistory(offset: 1 | -1): Promise<void> {
  const pending = whenSaved();
  if (pending !== null) await pending;
  goToStep(history.targetCursor + offset);
}
export const undo = () => moveInHistory(-1);
export const redo = () => moveInHistory(1);
