/** The undo history: steps between states; a drag is one step. Steps are plain data, so that they survive a reload. */
import { signal } from "@preact/signals";
import { changeToLook, joinChanges, type LookChange } from "../state/document/jsonPatch";
import type { Look, LookView } from "../protocol";

export interface LookStep extends LookChange {
  kind: "look";
  label: string;
  /** Consecutive steps of a gesture with the same key are merged. */
  key?: string;
  /** Steps of the same gesture and key are merged also after its end, for changes that the server computes. */
  gesture?: number;
}

/** A saved look; `created`: time of its first save, by which saved looks are sorted; `view`: the view saved with it. */
export interface NamedLook {
  name: string;
  look: Partial<Look>;
  created?: string | undefined;
  view?: LookView | null;
}

/** A keyframe of the timeline; `camera`: its pose on a camera path through the keyframes, angles in degrees; `duration`:
 * relative time to the next keyframe, by default 1. */
export interface Keyframe extends NamedLook {
  duration?: number | undefined;
  camera?: { to_world: number[]; yfov: number; near?: number } | null;
}

/** Change of a saved look; null: none before or after. */
export interface SavedLookStep {
  kind: "savedLook";
  label: string;
  before: NamedLook | null;
  after: NamedLook | null;
}

/** Change of the timeline's keyframes. */
export interface TimelineStep {
  kind: "timeline";
  label: string;
  before: readonly Keyframe[];
  after: readonly Keyframe[];
}

export type Step = LookStep | SavedLookStep | TimelineStep;

/** Redoes or undoes a step. */
export type PerformStep = (step: Step, isUndo: boolean) => void | Promise<void>;

const MAX_STEPS = 200;
const IDLE_MS = 800;

/** Steps that reverse the given ones; their look changes are merged into one. */
function reverseSteps(steps: readonly Step[], label: string): Step[] {
  const lookSteps = steps.filter((step) => step.kind === "look");
  const otherSteps = steps.filter((step) => step.kind !== "look").reverse();
  const reversed = otherSteps.map((step): Step => ({ ...step, label, before: step.after, after: step.before }) as Step);
  const [first, lastStep] = [lookSteps[0], lookSteps.at(-1)];
  if (first !== undefined && lastStep !== undefined)
    reversed.push({ kind: "look", label, ...changeToLook(lastStep.after, first.before) });
  return reversed;
}

export class History {
  readonly steps = signal<readonly Step[]>([]);
  /** Number of done steps; the later ones can be redone. */
  readonly cursor = signal(0);
  private isGestureEnded = true;
  private gesture = 0;
  private lastTime = 0;
  /** Target of a running undo or redo: number of done steps at its end. */
  private target: number | null = null;

  constructor(private readonly now: () => number = () => performance.now()) {}

  get canUndo(): boolean {
    return this.cursor.value > 0;
  }

  get canRedo(): boolean {
    return this.cursor.value < this.steps.value.length;
  }

  /** Record a step that has been done. */
  record(step: Step): void {
    const done = this.steps.value.slice(0, this.cursor.value);
    const last = done.at(-1);
    const gesture = step.kind === "look" ? step.gesture : undefined;
    const isSameGesture =
      gesture === undefined
        ? !this.isGestureEnded && !this.isIdle()
        : last?.kind === "look" && gesture === last.gesture;
    if (
      step.kind === "look" &&
      last?.kind === "look" &&
      step.key !== undefined &&
      step.key === last.key &&
      isSameGesture
    ) {
      done[done.length - 1] = { ...step, ...joinChanges(last, step) };
    } else done.push(step);
    this.steps.value = done.slice(-MAX_STEPS);
    this.cursor.value = this.steps.value.length;
    this.lastTime = this.now();
    if (gesture === undefined) this.isGestureEnded = false; // else it may have ended
  }

  private isIdle(): boolean {
    return this.now() - this.lastTime > IDLE_MS;
  }

  /** The number of the running gesture, or of a new one, for the `gesture` of later steps. */
  continueGesture(): number {
    if (this.isGestureEnded || this.isIdle()) this.gesture += 1;
    this.isGestureEnded = false;
    this.lastTime = this.now();
    return this.gesture;
  }

  /** End the gesture: the next change is another step. */
  endGesture(): void {
    this.isGestureEnded = true;
  }

  /** Keep the gesture open while a drag pauses. */
  extendGesture(): void {
    this.lastTime = this.now();
  }

  /** The cursor at the end of a running undo or redo: the next key press counts from there. */
  get targetCursor(): number {
    return this.target ?? this.cursor.value;
  }

  /** Undo or redo until `count` steps are done; the cursor moves after each success. A running call continues to the new
   * `count`. */
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

  /** Turn undone steps into done ones, followed by a step that reverses them, so that the next step discards nothing.
   * True if there were any. */
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

  /** Remove the last step, which has failed. */
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
