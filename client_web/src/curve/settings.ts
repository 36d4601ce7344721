/** How the curve editor is set; kept for the whole visit. */
import { signal } from "@preact/signals";
import type { Active } from "./model/channels";

export type Tool = "draw" | "points" | "stretch";

export const tool = signal<Tool>("points");
export const active = signal<Active>("rgb");
export const logarithmic = signal(false);
/** Per curve name; highlights are stretched near zero unless somebody chose otherwise. */
export const stretched = signal<Record<string, boolean>>({});
export const tableOpen = signal(false);
/** Whether pointing at the curve tints the pixels it lights. */
export const lights = signal(true);

export function isStretched(curve: string, bands: number): boolean {
  return stretched.value[curve] ?? bands >= 256;
}
