/** The bakes of the scene: the one that the picture shows, and one that is on its way. */
import { signal } from "@preact/signals";
import type { BakeBody, HelloMessage } from "../protocol";

/** What is known of a bake that is not ready yet. */
export type Baking = Pick<BakeBody, "id" | "state" | "progress" | "phase" | "seconds_left" | "problem"> &
  Partial<Pick<BakeBody, "phase_seconds" | "ahead">>;

export const bakes = signal<BakeBody[]>([]);
/** The bake that the picture shows, which light it has, and what can be changed in its pictures. */
export const bake = signal<string | null>(null);
export const method = signal<string | null>(null);
export const axes = signal<HelloMessage["axes"]>([]);
export const coming = signal<Baking | null>(null);
