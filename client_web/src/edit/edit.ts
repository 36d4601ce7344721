/** All changes of the look go through here: an undoable step, and its patch to the server. A previewed look, as during
 * playback, becomes a step when the user commits or edits it. */
import { signal } from "@preact/signals";
import { changeValue, changeToLook, joinChanges, type LookChange } from "../state/document/jsonPatch";
import { isViewSetting } from "../state/document/pointer";
import type { Look } from "../protocol";
import { look } from "../state/look";
import { mayEdit, numRejectedEdits } from "../state/sessionUser";
import { models } from "../state/scene";
import { selectedMaterials } from "../state/selection";
import { activeControl, activePath } from "./activeControl";
import { history } from "./history";
import { sharedPaths } from "./sharedPaths";
import { stepLabel } from "./stepLabel";

type ChangeListener = (change: LookChange, inputTime: number) => void;
let changeListener: ChangeListener = () => undefined;

/** Sends changes of the look to the server. */
export function onLookChange(callback: ChangeListener): void {
  changeListener = callback;
}

/** Time of the input on the clock of performance.now; inside an event handler, the event's own time. */
function currentInputTime(): number {
  // eslint-disable-next-line @typescript-eslint/no-deprecated -- otherwise all handlers would hand their events down to here
  const event = window.event;
  return event !== undefined && event.timeStamp > 0 ? event.timeStamp : performance.now();
}

/** Apply a change without a history step; `controlPath` is the active control. */
export function applyChange(change: LookChange, controlPath: string | null = null): void {
  activeControl.value = controlPath;
  look.value = change.after;
  changeListener(change, currentInputTime());
}

/** The look before the preview, and the label of the preview's step; null without a preview. */
export const previewedStep = signal<{ before: Look; label: string } | null>(null);

/** Preview a look. */
export function previewStep(label: string, next: Look): void {
  if (rejectIfReadOnly()) return;
  const current = look.peek();
  if (current === null) return;
  previewedStep.value = { before: previewedStep.peek()?.before ?? current, label };
  const change = changeToLook(current, next);
  const [first, second] = change.patch;
  if (first === undefined) return;
  applyChange(change, second === undefined ? activePath(first.path, next) : null); // a single changed value updates incrementally, as during a drag
}

/** End the preview and return to the look before it. */
export function cancelPreview(): void {
  const [preview, current] = [previewedStep.peek(), look.peek()];
  previewedStep.value = null;
  if (preview !== null && current !== null && current !== preview.before)
    applyChange(changeToLook(current, preview.before));
}

/** Make the previewed look a step. */
export function commitPreview(): void {
  const [preview, current] = [previewedStep.peek(), look.peek()];
  previewedStep.value = null;
  if (preview === null || current === null || current === preview.before) return;
  history.record({ kind: "look", label: preview.label, ...changeToLook(preview.before, current) });
  history.endGesture();
}

/** Reject edits of a read-only user with a message. */
function rejectIfReadOnly(): boolean {
  if (!mayEdit.peek()) numRejectedEdits.value += 1;
  return !mayEdit.peek();
}

interface StepKey {
  key?: string;
  gesture?: number;
}

function commitChange(label: string, change: LookChange, step: StepKey = {}, control: string | null = null): void {
  const { key } = step;
  if (change.patch.length === 0 || (!(key !== undefined && isViewSetting(key)) && rejectIfReadOnly())) return;
  commitPreview();
  applyChange(change, control);
  history.record({ kind: "look", label, ...step, ...change });
}

/** Replace the edited look, as one step. */
export function replaceLook(label: string, next: Look): void {
  if (look.value !== null) commitChange(label, changeToLook(look.value, next));
}

/** Set the value at a pointer of the look (undefined removes it), also in other selected materials that have it. Edits
 * of one gesture on one pointer are one step. */
export function editValue(action: string, path: string, value: unknown): void {
  if (look.value === null) return;
  const others = sharedPaths(look.value, path, selectedMaterials.peek());
  const change = others.reduce(
    (joined, other) => joinChanges(joined, changeValue(joined.after, other, value)),
    changeValue(look.value, path, value),
  );
  const control = others.length > 0 ? null : activePath(path, change.after);
  commitChange(labelOf(path, action, others.length), change, { key: path }, control);
}

/** Replace the look as an edit of the value at a pointer, by a gesture that may have ended (`history.continueGesture`);
 * all its edits are one step. */
export function editLook(action: string, path: string, next: Look, gesture: number, numOthers = 0): void {
  if (look.value === null) return;
  const change = changeToLook(look.value, next);
  const [first, second] = change.patch;
  const control = first === undefined || second !== undefined ? null : activePath(first.path, next);
  commitChange(labelOf(path, action, numOthers), change, { key: path, gesture }, control);
}

function labelOf(path: string, action: string, numOthers: number): string {
  const label = stepLabel(path, action, look.value as Look, models.value);
  return numOthers === 0 ? label : `${label} (${numOthers + 1} materials)`;
}
