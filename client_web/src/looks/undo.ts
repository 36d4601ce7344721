/** Undo and redo for buttons and keys: what cannot be undone now is said, and stays to be undone later. */
import { changeBy, changeTo, type Change } from "../document/change";
import { isSame } from "../document/difference";
import { getAt } from "../document/pointer";
import { leavePassing, show } from "../edit/edit";
import { history, type LookStep, type Step } from "../edit/history";
import type { Look } from "../protocol";
import { look } from "../state/look";
import { isTogether } from "../state/together";
import { attempt, note } from "../ui/toasts";
import { keyframes } from "./keyframes";
import { exchange, settled } from "./shelf";

function reversed({ before, after, patch, inverse }: LookStep): Change {
  return { before: after, after: before, patch: inverse, inverse: patch };
}

/** Of a change what nobody else has come to since: each undoes their own edits. */
function stillOwn(change: Change, step: LookStep, current: Look): Change {
  const patch = change.patch.filter(({ path }) => isSame(getAt(current, path), getAt(change.before, path)));
  if (patch.length < change.patch.length) note(`Others have edited what “${step.label}” changed. That stays as they made it.`);
  return changeBy(current, patch);
}

/** Make a change of the look that is there: where that is not what the change begins with, because the server refused
 * an edit in between, the way to its end is another. */
function perform(step: Step, back: boolean): void | Promise<void> {
  if (step.of === "timeline") return void (keyframes.value = back ? step.before : step.after);
  if (step.of === "shelf") return back ? exchange(step.after, step.before) : exchange(step.before, step.after);
  const change = back ? reversed(step) : step;
  const current = look.peek();
  if (isTogether.peek() && current !== null) return show(stillOwn(change, step, current));
  show(current === null || current === change.before ? change : changeTo(current, change.after));
}

export function goTo(count: number): void {
  leavePassing();
  void attempt(() => history.goTo(count, perform));
}

/** A look that is being saved, renamed or deleted is a step when that is done: the press is of what was seen by then. */
async function move(by: 1 | -1): Promise<void> {
  const pending = settled();
  if (pending !== null) await pending;
  goTo(history.heading + by);
}
export const undo = () => move(-1);
export const redo = () => move(1);
