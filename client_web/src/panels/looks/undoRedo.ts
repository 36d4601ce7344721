/** Undo and redo for buttons and keys: a step that cannot be undone is reported and stays. */
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

/** The part of a change that nobody else has edited since: users undo only their own edits. */
function isUnchangedSince(change: LookChange, step: LookStep, current: Look): LookChange {
  const patch = change.patch.filter(({ path }) => isDeepEqual(getAt(current, path), getAt(change.before, path)));
  if (patch.length < change.patch.length)
    showNote(`“${step.label}” was changed by someone else; their version is kept.`);
  return changeByPatch(current, patch);
}

/** Apply a change to the current look. If the look differs from the change's start, because the server rejected an edit
 * in between, the patch is computed again. */
function applyStep(step: Step, isUndo: boolean): void | Promise<void> {
  if (step.kind === "timeline") return void (keyframes.value = isUndo ? step.before : step.after);
  if (step.kind === "savedLook")
    return isUndo ? exchangeSavedLook(step.after, step.before) : exchangeSavedLook(step.before, step.after);
  const change = isUndo ? reverseStep(step) : step;
  const current = look.peek();
  if (isInRoom.peek() && current !== null) return applyChange(isUnchangedSince(change, step, current));
  applyChange(current === null || current === change.before ? change : changeToLook(current, change.after));
}

export function goToStep(count: number): void {
  cancelPreview();
  void reportErrors(() => history.goTo(count, applyStep));
}

/** Wait for a pending save, rename or deletion, which becomes a step when done, before undoing or redoing. */
async function moveInHistory(offset: 1 | -1): Promise<void> {
  const pending = whenSaved();
  if (pending !== null) await pending;
  goToStep(history.targetCursor + offset);
}
export const undo = () => moveInHistory(-1);
export const redo = () => moveInHistory(1);
