/** The one way to change the look: an undoable step, and its patch to the server. What is shown in passing, as while looks
 * play, is no step until somebody keeps it or changes it. */
import { signal } from "@preact/signals";
import { changeAt, changeTo, type Change } from "../document/change";
import { isWayOfLooking } from "../document/pointer";
import type { Look } from "../protocol";
import { look } from "../state/look";
import { mayEdit, refusals } from "../state/me";
import { models } from "../state/scene";
import { hand, heldAt } from "./hand";
import { history } from "./history";
import { stepName } from "./step";

type Listener = (change: Change, inputTime: number) => void;
let listener: Listener = () => undefined;

/** Who takes changes of the look to the server. */
export function onChange(take: Listener): void {
  listener = take;
}

/** When the hand moved, on the clock of performance.now; inside an event handler the event's own time. */
function inputNow(): number {
  const event = window.event;
  return event !== undefined && event.timeStamp > 0 ? event.timeStamp : performance.now();
}

/** Make a change without a step of the history, by a hand that is on `held`. */
export function show(change: Change, held: string | null = null): void {
  hand.value = held;
  look.value = change.after;
  listener(change, inputNow());
}

/** What was there before something was shown in passing, and what a step of it is called; null where nothing is. */
export const passing = signal<{ before: Look; label: string } | null>(null);

/** Show a look in passing. */
export function showPassing(label: string, next: Look): void {
  if (isRefused()) return;
  const current = look.peek();
  if (current === null) return;
  passing.value = { before: passing.peek()?.before ?? current, label };
  const change = changeTo(current, next);
  const [first, more] = change.patch;
  if (first === undefined) return;
  show(change, more === undefined ? heldAt(first.path, next) : null); // what changes alone is followed as under a hand
}

/** Go back to what was there before. */
export function leavePassing(): void {
  const [passed, current] = [passing.peek(), look.peek()];
  passing.value = null;
  if (passed !== null && current !== null && current !== passed.before) show(changeTo(current, passed.before));
}

/** Make what is shown in passing a step. */
export function keepPassing(): void {
  const [passed, current] = [passing.peek(), look.peek()];
  passing.value = null;
  if (passed === null || current === null || current === passed.before) return;
  history.record({ of: "look", label: passed.label, ...changeTo(passed.before, current) });
  history.seal();
}

/** Whoever may not edit is told so. */
function isRefused(): boolean {
  if (!mayEdit.peek()) refusals.value += 1;
  return !mayEdit.peek();
}

function commit(label: string, change: Change, key?: string): void {
  if (change.patch.length === 0 || (!(key !== undefined && isWayOfLooking(key)) && isRefused())) return;
  keepPassing();
  show(change, key === undefined ? null : heldAt(key, change.after));
  history.record({ of: "look", label, ...(key === undefined ? {} : { key }), ...change });
}

/** Put another look in the place of the one that is edited, as one step. */
export function replaceLook(label: string, next: Look): void {
  if (look.value !== null) commit(label, changeTo(look.value, next));
}

/** Set the value at a pointer of the look (undefined removes it). Edits of one gesture on one pointer are one step. */
export function edit(deed: string, path: string, value: unknown): void {
  if (look.value === null) return;
  commit(stepName(path, deed, look.value, models.value), changeAt(look.value, path, value), path);
}
