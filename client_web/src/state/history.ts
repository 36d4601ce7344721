/** Undo for everything: operations with do and undo; those of one drag become one. */
import { signal } from "@preact/signals";
import type { Look } from "../protocol";

export interface Operation {
  label: string;
  /** Operations in a row with the same key, within one gesture, are one step. */
  key?: string;
  /** The looks it leads from and to, for steps that change the look. */
  before?: Look;
  after?: Look;
  redo(): void | Promise<void>;
  undo(): void | Promise<void>;
}

const MAX_STEPS = 200;
const IDLE_MS = 800;

export class History {
  readonly steps = signal<readonly Operation[]>([]);
  /** Number of steps that are done; the ones after it can be redone. */
  readonly cursor = signal(0);
  private sealed = true;
  private lastTime = 0;
  private busy = false;

  constructor(private readonly now: () => number = () => performance.now()) {}

  get canUndo(): boolean {
    return this.cursor.value > 0;
  }

  get canRedo(): boolean {
    return this.cursor.value < this.steps.value.length;
  }

  /** Remember an operation that has been done. */
  record(operation: Operation): void {
    const done = this.steps.value.slice(0, this.cursor.value);
    const last = done.at(-1);
    const idle = this.now() - this.lastTime > IDLE_MS;
    if (last?.key !== undefined && last.key === operation.key && !this.sealed && !idle) {
      done[done.length - 1] = { ...operation, undo: last.undo, ...(last.before ? { before: last.before } : {}) };
    } else done.push(operation);
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

  async undo(): Promise<void> {
    await this.goTo(this.cursor.value - 1);
  }

  async redo(): Promise<void> {
    await this.goTo(this.cursor.value + 1);
  }

  /** Undo or redo until `count` steps are done; the cursor moves only after each has succeeded. */
  async goTo(count: number): Promise<void> {
    if (this.busy) return;
    this.busy = true;
    this.sealed = true;
    try {
      const target = Math.min(Math.max(count, 0), this.steps.value.length);
      while (this.cursor.value > target) {
        await this.steps.value[this.cursor.value - 1]?.undo();
        this.cursor.value -= 1;
      }
      while (this.cursor.value < target) {
        await this.steps.value[this.cursor.value]?.redo();
        this.cursor.value += 1;
      }
    } finally {
      this.busy = false;
    }
  }

  /** The last step turned out impossible: forget it. */
  drop(): void {
    this.steps.value = this.steps.value.slice(0, Math.max(0, this.cursor.value - 1));
    this.cursor.value = this.steps.value.length;
    this.sealed = true;
  }

  clear(): void {
    this.steps.value = [];
    this.cursor.value = 0;
    this.sealed = true;
  }
}
