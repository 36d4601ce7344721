/** The pixel that the pointer is over, and what the server has said of it. */
import { signal } from "@preact/signals";
import type { InspectAnswer } from "../protocol";

export const pixelProbe = signal<{ view: string; x: number; y: number; answer: InspectAnswer | null } | null>(null);
