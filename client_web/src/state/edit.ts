/** The one way to change the look: an undoable operation, and the newest look to the server. */
import type { Look } from "../protocol";
import { diffLooks } from "./diff";
import { setAt } from "./pointer";
import { stepName } from "./step";
import { history, look, models } from "./store";

type Listener = (look: Look, inputTime: number) => void;
let listener: Listener = () => undefined;

/** Who takes the looks to the server. */
export function onLook(take: Listener): void {
  listener = take;
}

/** When the hand moved, on the clock of performance.now; inside an event handler the event's own time. */
export function inputNow(): number {
  const event = window.event;
  return event !== undefined && event.timeStamp > 0 ? event.timeStamp : performance.now();
}

export function showLook(next: Look): void {
  look.value = next;
  listener(next, inputNow());
}

/** Replace the whole look as one step of the history. */
export function commit(label: string, next: Look, key?: string): void {
  const before = look.value;
  if (before === null || diffLooks(before, next).length === 0) return;
  showLook(next);
  history.record({ of: "look", label, ...(key === undefined ? {} : { key }), before, after: next });
}

/** Set the value at a pointer of the look (undefined removes it). Edits of one gesture on one pointer are one step. */
export function edit(deed: string, path: string, value: unknown): void {
  if (look.value === null) return;
  commit(stepName(path, deed, look.value, models.value), setAt(look.value, path, value), path);
}
