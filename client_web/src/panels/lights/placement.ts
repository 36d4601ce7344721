/** Places a new light: choose a kind, then click a surface in the image or use the image's center. */
import { signal } from "@preact/signals";
import { luminance } from "../../render/color/tonemap";
import { requestPixelProbe } from "../../session/pixelProbe";
import { MAX_LIGHTS } from "../../look.gen";
import type { ViewImage } from "../../render/viewImage";
import { stage } from "../../render/renderStage";
import type { InspectAnswer } from "../../protocol";
import { views } from "../../state/views";
import { reportErrors, showNote } from "../../ui/toasts";
import { projectionCameraOf } from "./lightProjection";
import { nextLightName, labelOf, createLight, type AddedKind } from "./lightKinds";
import { addLight, lightNames } from "./lightEdits";
import { length, subtract } from "./vector";

/** Whether the menu of kinds is open, and the kind being placed. */
export const isAddMenuOpen = signal(false);
export const placingKind = signal<AddedKind | null>(null);

export function stopPlacement(): void {
  isAddMenuOpen.value = false;
  placingKind.value = null;
}

const SAMPLE_GRID = 32;

/** Mean radiance of an image, estimated from a subset of its pixels. */
function meanRadiance(image: ViewImage): number {
  const { width, height } = image.pixels;
  const pixelIndex = (k: number, size: number) => Math.floor(((k + 0.5) / SAMPLE_GRID) * size);
  const samples = Array.from({ length: SAMPLE_GRID * SAMPLE_GRID }, (_, k) =>
    image.radiance(pixelIndex(k % SAMPLE_GRID, width), pixelIndex(Math.floor(k / SAMPLE_GRID), height)),
  );
  return samples.reduce((sum, rgb) => sum + (rgb === null ? 0 : luminance(rgb)), 0) / samples.length;
}

function addPlacedLight(kind: AddedKind, view: string, probed: InspectAnswer): void {
  const { position, normal } = probed;
  const info = views.peek().find(({ name }) => name === view);
  if (position === null || normal === null || info === undefined) {
    showNote("No surface here. Click on an object.");
    return;
  }
  const distance = length(subtract(position, projectionCameraOf(info).position));
  const radiance = meanRadiance(stage.imageOf(view));
  stopPlacement();
  addLight(
    nextLightName(labelOf(kind), lightNames.peek()),
    createLight(kind, { position, normal, distance, radiance }),
  );
}

/** Place the light at the surface under this pixel of a view. */
export async function placeLightAt(view: string, x: number, y: number): Promise<void> {
  const kind = placingKind.peek();
  if (kind === null) return;
  await reportErrors(async () => {
    const probed = await requestPixelProbe(view, x, y);
    if (placingKind.peek() === kind) addPlacedLight(kind, view, probed);
  });
}

/** Place the light at the surface in the center of the active view's image. */
export function placeAtCenterOf(): Promise<void> {
  const { view, pixels } = stage.active;
  return placeLightAt(view, Math.floor(pixels.width / 2), Math.floor(pixels.height / 2));
}

export function startPlacement(kind: AddedKind): void {
  if (lightNames.value.length >= MAX_LIGHTS) showNote(`Limit of ${MAX_LIGHTS} lights reached. Remove one first.`);
  else placingKind.value = placingKind.value === kind ? null : kind;
}
