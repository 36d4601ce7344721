/** Undo for everything: steps from a state to another, those of one drag as one. They are data, so that a reload can
 * keep them. */
import { signal } from "@preact/signals";
import { changeTo, joined, type Change } from "../document/change";
import type { Look } from "../protocol";

export interface LookStep extends Change {
  of: "look";
  label: string;
  /** Steps in a row with the same key, within one gesture, are one. */
  key?: string;
}

/** A look that was saved under a name; `created`: when it was saved first, which is its place among the others. */
export interface NamedLook {
  name: string;
  look: Partial<Look>;
  created?: string | undefined;
}

/** One on the time line; `eye`: from where it is seen on a way from key to key. Angles in degrees. */
export interface Keyframe extends NamedLook {
  eye?: { to_world: number[]; yfov: number } | null;
}

/** What became of a saved look; null where there is none. */
export interface ShelfStep {
  of: "shelf";
  label: string;
  before: NamedLook | null;
  after: NamedLook | null;
}

/** What became of the looks on the time line. */
export interface TimelineStep {
  of: "timeline";
  label: string;
  before: readonly Keyframe[];
  after: readonly Keyframe[];
}

export type Step = LookStep | ShelfStep | TimelineStep;

/** Makes a step happen again, or undoes it. */
export type Perform = (step: Step, back: boolean) => void | Promise<void>;

const MAX_STEPS = 200;
const IDLE_MS = 800;

/** Steps that lead from the end of some steps to their beginning; the looks are gone back over in one. */
function wayBack(steps: readonly Step[], label: string): Step[] {
  const looks = steps.filter((step) => step.of === "look");
  const others = steps.filter((step) => step.of !== "look").reverse();
  const back = others.map((step): Step => ({ ...step, label, before: step.after, after: step.before }) as Step);
  const [first, last] = [looks[0], looks.at(-1)];
  if (first !== undefined && last !== undefined) back.push({ of: "look", label, ...changeTo(last.after, first.before) });
  return back;
}

export class History {
  readonly steps = signal<readonly Step[]>([]);
  /** Number of steps that are done; the ones after it can be redone. */
  readonly cursor = signal(0);
  private sealed = true;
  private lastTime = 0;
  /** While steps are being undone or redone: how many shall be done in the end. */
  private target: number | null = null;

  constructor(private readonly now: () => number = () => performance.now()) {}

  get canUndo(): boolean {
    return this.cursor.value > 0;
  }

  get canRedo(): boolean {
    return this.cursor.value < this.steps.value.length;
  }

  /** Remember a step that has been done. */
  record(step: Step): void {
    const done = this.steps.value.slice(0, this.cursor.value);
    const last = done.at(-1);
    const idle = this.now() - this.lastTime > IDLE_MS;
    if (step.of === "look" && last?.of === "look" && step.key !== undefined && step.key === last.key && !this.sealed && !idle) {
      done[done.length - 1] = { ...step, ...joined(last, step) };
    } else done.push(step);
    this.steps.value = done.slice(-MAX_STEPS);
    this.cursor.value = this.steps.value.length;
    this.lastTime = this.now();
    this.sealed = false;
  }

  /** The gesture is over: what follows is another step. */
  seal(): void {
    this.sealed = true;
  }

  /** While a drag is held still, it stays one step. */
  hold(): void {
    this.lastTime = this.now();
  }

  /** Where undoing and redoing will end: the next press counts from there. */
  get heading(): number {
    return this.target ?? this.cursor.value;
  }

  /** Undo or redo until `count` steps are done; the cursor moves only after each has succeeded. Where that is going on
   * already, it goes on to `count`. */
  async goTo(count: number, perform: Perform): Promise<void> {
    const goes = this.target !== null;
    this.target = Math.min(Math.max(count, 0), this.steps.value.length);
    if (goes) return;
    this.sealed = true;
    try {
      while (this.cursor.value !== this.target) await this.move(this.cursor.value > this.target, perform);
    } finally {
      this.target = null;
    }
  }

  private async move(back: boolean, perform: Perform): Promise<void> {
    await perform(this.steps.value[this.cursor.value - (back ? 1 : 0)] as Step, back);
    this.cursor.value += back ? -1 : 1;
  }

  /** Make what was undone part of what was done, with the way back as its last step, so that the next step discards
   * nothing. Whether there was anything. */
  keepUndone(): boolean {
    const undone = this.steps.value.slice(this.cursor.value);
    if (undone.length === 0) return false;
    const last = this.steps.value[this.cursor.value - 1];
    const label = last === undefined ? "Back to the start" : `Back to “${last.label}”`;
    this.steps.value = [...this.steps.value, ...wayBack(undone, label)].slice(-MAX_STEPS);
    this.cursor.value = this.steps.value.length;
    this.sealed = true;
    return true;
  }

  /** The last step turned out impossible: forget it. */
  drop(): void {
    this.steps.value = this.steps.value.slice(0, Math.max(0, this.cursor.value - 1));
    this.cursor.value = this.steps.value.length;
    this.sealed = true;
  }

  clear(): void {
    this.restore([], 0);
  }

  /** Take up a history that was kept. */
  restore(steps: readonly Step[], cursor: number): void {
    this.steps.value = steps;
    this.cursor.value = cursor;
    this.sealed = true;
  }
}

export const history = new History();
