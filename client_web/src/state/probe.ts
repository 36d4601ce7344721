/** The pixel that the pointer is over, and what the server has said of it. */
import { signal } from "@preact/signals";
import type { ProbeAnswer } from "../protocol";

export const probe = signal<{ view: string; x: number; y: number; answer: ProbeAnswer | null } | null>(null);
