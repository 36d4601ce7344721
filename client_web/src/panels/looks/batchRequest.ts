/** Requests of batches: looks, views, size, format and names as chosen in the render dialog. */
import type { Look, RenderRequest } from "../../protocol";
import type { CameraPose } from "../../viewport/cameras/orbit";

export type BatchFormat = "png" | "exr" | "exr_layers" | "webp";

export interface BatchChoice {
  /** The look that is shown, and names of saved ones. */
  hasCurrent: boolean;
  saved: readonly string[];
  views: readonly string[];
  /** Render each saved look in the view saved with it. */
  usesSavedViews: boolean;
  /** Null: as baked. */
  size: readonly [width: number, height: number] | null;
  format: BatchFormat;
  hasSheet: boolean;
  fileName: string;
  start: number;
  priority: number;
}

/** The document of the current look, the bake, the active view, and the pose of its free camera; null: as baked. */
export interface BatchContext {
  bake: string;
  look: Look;
  activeView: string;
  pose: CameraPose | null;
  colorSpace: string | null;
}

const LONG_SIDE_4K = 3840;

/** 4K with the aspect ratio of an image. */
export function size4K(width: number, height: number): [number, number] {
  const scale = LONG_SIDE_4K / Math.max(width, height);
  return [Math.round(width * scale), Math.round(height * scale)];
}

/** Message about a choice that cannot be rendered; null: none. */
export function choiceProblem({ hasCurrent, saved, views, usesSavedViews, size }: BatchChoice): string | null {
  if (!hasCurrent && saved.length === 0) return "Choose a look.";
  if (views.length === 0 && !usesSavedViews) return "Choose a view.";
  if (size?.some((side) => !(Number.isInteger(side) && side >= 1 && side <= 16384)))
    return "Enter a width and height in pixels (1–16,384).";
  return null;
}

export function batchRequest(choice: BatchChoice, context: BatchContext): RenderRequest {
  const isExr = choice.format === "exr" || choice.format === "exr_layers";
  const format = isExr ? "exr" : (choice.format as "png" | "webp");
  const isSingleView = choice.views.length === 1 && choice.views[0] === context.activeView;
  const hasPose = context.pose !== null && isSingleView && !choice.usesSavedViews;
  return {
    bake: context.bake,
    looks: choice.hasCurrent ? [context.look as unknown as Record<string, unknown>] : [],
    look_names: choice.hasCurrent ? ["Current"] : [],
    saved_looks: [...choice.saved],
    ...(choice.usesSavedViews
      ? { view: context.activeView, saved_views: true }
      : { views: choice.views.map((view) => ({ view })) }),
    ...(hasPose ? { path: { cameras: [context.pose as CameraPose] } } : {}),
    size: choice.size === null ? null : [...choice.size],
    rebake: choice.size !== null,
    format: choice.format === "png" && choice.hasSheet ? "contact_sheet" : format,
    file_name: choice.fileName,
    start_frame: choice.start,
    priority: choice.priority,
    ...(isExr ? { layers: choice.format === "exr_layers", color_space: context.colorSpace } : {}),
  };
}

/** The first names of the images, and how many there are. */
export function namesText(names: readonly string[], total: number): string {
  const shown = names.slice(0, 3);
  const more = total - shown.length;
  const count = `${total} ${total === 1 ? "image" : "images"}`;
  return `${count}: ${shown.join(", ")}${more > 0 ? ` and ${more} more` : ""}`;
}

/** The file of a finished batch: one image, or all with their contact sheet. */
export function batchFile({ format }: RenderRequest, total: number): string {
  return total === 1 && format !== "contact_sheet" ? "frames/0" : "archive.zip";
}
