/** The pixel under the pointer, and the server's data about it. */
import { signal } from "@preact/signals";
import type { InspectAnswer } from "../protocol";

export const pixelProbe = signal<{ view: string; x: number; y: number; answer: InspectAnswer | null } | null>(null);
