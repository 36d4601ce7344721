/** Undo for everything: steps from a state to another, those of one drag as one. They are data, so that they can be
 * stored over a reload. */
import { signal } from "@preact/signals";
import { changeToLook, joinChanges, type LookChange } from "../state/document/jsonPatch";
import type { Look } from "../protocol";

export interface LookStep extends LookChange {
  kind: "look";
  label: string;
  /** Steps in a row with the same key, within one gesture, are one. */
  key?: string;
}

/** A saved look; `created`: when it was saved first, which orders the saved looks. */
export interface NamedLook {
  name: string;
  look: Partial<Look>;
  created?: string | undefined;
}

/** One on the timeline; `camera`: its pose on a camera path from key to key. Angles in degrees. */
export interface Keyframe extends NamedLook {
  camera?: { to_world: number[]; yfov: number } | null;
}

/** What became of a saved look; null where there is none. */
export interface SavedLookStep {
  kind: "shelf";
  label: string;
  before: NamedLook | null;
  after: NamedLook | null;
}

/** What became of the looks on the timeline. */
export interface TimelineStep {
  kind: "timeline";
  label: string;
  before: readonly Keyframe[];
  after: readonly Keyframe[];
}

export type Step = LookStep | SavedLookStep | TimelineStep;

/** Makes a step happen again, or undoes it. */
export type PerformStep = (step: Step, isUndo: boolean) => void | Promise<void>;

const MAX_STEPS = 200;
const IDLE_MS = 800;

/** Steps that reverse some steps; all their look changes are reversed in one. */
function reverseSteps(steps: readonly Step[], label: string): Step[] {
  const lookSteps = steps.filter((step) => step.kind === "look");
  const otherSteps = steps.filter((step) => step.kind !== "look").reverse();
  const reversed = otherSteps.map((step): Step => ({ ...step, label, before: step.after, after: step.before }) as Step);
  const [first, lastStep] = [lookSteps[0], lookSteps.at(-1)];
  if (first !== undefined && lastStep !== undefined) reversed.push({ kind: "look", label, ...changeToLook(lastStep.after, first.before) });
  return reversed;
}

export class History {
  readonly steps = signal<readonly Step[]>([]);
  /** Number of steps that are done; the ones after it can be redone. */
  readonly cursor = signal(0);
  private isGestureEnded = true;
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
    if (step.kind === "look" && last?.kind === "look" && step.key !== undefined && step.key === last.key && !this.isGestureEnded && !idle) {
      done[done.length - 1] = { ...step, ...joinChanges(last, step) };
    } else done.push(step);
    this.steps.value = done.slice(-MAX_STEPS);
    this.cursor.value = this.steps.value.length;
    this.lastTime = this.now();
    this.isGestureEnded = false;
  }

  /** The gesture is over: what follows is another step. */
  endGesture(): void {
    this.isGestureEnded = true;
  }

  /** While a drag is held still, it stays one step. */
  extendGesture(): void {
    this.lastTime = this.now();
  }

  /** Where undoing and redoing will end: the next press counts from there. */
  get targetCursor(): number {
    return this.target ?? this.cursor.value;
  }

  /** Undo or redo until `count` steps are done; the cursor moves only after each has succeeded. Where that is going on
   * already, it goes on to `count`. */
  async goTo(count: number, perform: PerformStep): Promise<void> {
    const isRunning = this.target !== null;
    this.target = Math.min(Math.max(count, 0), this.steps.value.length);
    if (isRunning) return;
    this.isGestureEnded = true;
    try {
      while (this.cursor.value !== this.target) await this.move(this.cursor.value > this.target, perform);
    } finally {
      this.target = null;
    }
  }

  private async move(isUndo: boolean, perform: PerformStep): Promise<void> {
    await perform(this.steps.value[this.cursor.value - (isUndo ? 1 : 0)] as Step, isUndo);
    this.cursor.value += isUndo ? -1 : 1;
  }

  /** Make what was undone part of what was done, with the way back as its last step, so that the next step discards
   * nothing. Whether there was anything. */
  commitUndone(): boolean {
    const undone = this.steps.value.slice(this.cursor.value);
    if (undone.length === 0) return false;
    const last = this.steps.value[this.cursor.value - 1];
    const label = last === undefined ? "Back to the start" : `Back to “${last.label}”`;
    this.steps.value = [...this.steps.value, ...reverseSteps(undone, label)].slice(-MAX_STEPS);
    this.cursor.value = this.steps.value.length;
    this.isGestureEnded = true;
    return true;
  }

  /** The last step turned out impossible: forget it. */
  dropLastStep(): void {
    this.steps.value = this.steps.value.slice(0, Math.max(0, this.cursor.value - 1));
    this.cursor.value = this.steps.value.length;
    this.isGestureEnded = true;
  }

  clear(): void {
    this.restore([], 0);
  }

  /** Restore a stored history. */
  restore(steps: readonly Step[], cursor: number): void {
    this.steps.value = steps;
    this.cursor.value = cursor;
    this.isGestureEnded = true;
  }
}

export const history = new History();
