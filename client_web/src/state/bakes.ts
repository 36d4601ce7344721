/** The bakes of the scene: the shown one and a pending one. */
import { signal } from "@preact/signals";
import type { BakeBody, HelloMessage } from "../protocol";

/** Status of a bake that is not ready yet. */
export type BakeStatus = Pick<BakeBody, "id" | "state" | "progress" | "phase" | "seconds_left" | "problem"> &
  Partial<Pick<BakeBody, "phase_seconds" | "queue_position">>;

export const bakes = signal<BakeBody[]>([]);
/** The shown bake, its method, and its editable parts. */
export const bake = signal<string | null>(null);
export const method = signal<string | null>(null);
export const axes = signal<HelloMessage["axes"]>([]);
export const pendingBake = signal<BakeStatus | null>(null);

/** The bake of a running render of this tab, which does not replace the shown one; null: none. */
export const renderedBake = signal<string | null>(null);
