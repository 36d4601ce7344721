/** Undo and redo for buttons and keys: what cannot be undone now is said, and stays to be undone later. */
import { exchange } from "../looks/shelf";
import { attempt } from "../ui/toasts";
import { showLook } from "./edit";
import type { Step } from "./history";
import { history } from "./store";

function perform(step: Step, back: boolean): void | Promise<void> {
  if (step.of === "look") return showLook(back ? step.before : step.after);
  return back ? exchange(step.after, step.before) : exchange(step.before, step.after);
}

export const goTo = (count: number) => void attempt(() => history.goTo(count, perform));
export const undo = () => goTo(history.heading - 1);
export const redo = () => goTo(history.heading + 1);
