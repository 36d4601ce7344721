/** Settings of the curve editor, for the session. */
import { signal } from "@preact/signals";
import type { ActiveChannels } from "./model/channels";

export type Tool = "draw" | "points" | "stretch";

export const curveTool = signal<Tool>("points");
export const activeChannels = signal<ActiveChannels>("rgb");
export const logarithmic = signal(false);
/** Per curve name; by default highlights are stretched near zero. */
export const stretchedCurves = signal<Record<string, boolean>>({});
export const tableOpen = signal(false);
/** True if pointing at the curve tints the pixels that it lights. */
export const isIntervalLit = signal(true);

export function isStretched(curve: string, bands: number): boolean {
  return stretchedCurves.value[curve] ?? bands >= 256;
}
