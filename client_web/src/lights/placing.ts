/** Placing a new light: a kind is chosen, then a surface in the picture, or what the picture has in its middle. */
import { signal } from "@preact/signals";
import { luminance } from "../color/tonemap";
import { askProbe } from "../live/probing";
import { MAX_LIGHTS } from "../look.gen";
import type { Picture } from "../picture/picture";
import { stage } from "../picture/stage";
import type { ProbeAnswer } from "../protocol";
import { views } from "../state/views";
import { attempt, note } from "../ui/toasts";
import { cameraOf } from "./camera";
import { freeLightName, labelOf, lightFor, type AddedKind } from "./kinds";
import { addLight, lightNames } from "./lights";
import { length, subtract } from "./vector";

/** Whether the kinds are offered, and that of which a light is being placed. */
export const adding = signal(false);
export const placing = signal<AddedKind | null>(null);

export function stopAdding(): void {
  adding.value = false;
  placing.value = null;
}

const GRID = 32;

/** Mean radiance of a picture, by some of its pixels. */
function meanRadiance(picture: Picture): number {
  const { width, height } = picture.pixels;
  const at = (k: number, size: number) => Math.floor(((k + 0.5) / GRID) * size);
  const seen = Array.from({ length: GRID * GRID }, (_, k) =>
    picture.radiance(at(k % GRID, width), at(Math.floor(k / GRID), height)),
  );
  return seen.reduce((sum, rgb) => sum + (rgb === null ? 0 : luminance(rgb)), 0) / seen.length;
}

function put(kind: AddedKind, view: string, found: ProbeAnswer): void {
  const { position, normal } = found;
  const info = views.peek().find(({ name }) => name === view);
  if (position === null || normal === null || info === undefined) {
    note("There is no surface in that place; choose one that there is.");
    return;
  }
  const distance = length(subtract(position, cameraOf(info).eye));
  const radiance = meanRadiance(stage.of(view));
  stopAdding();
  addLight(freeLightName(labelOf(kind), lightNames.peek()), lightFor(kind, { position, normal, distance, radiance }));
}

/** Put the light where this pixel of a view is. */
export async function placeAt(view: string, x: number, y: number): Promise<void> {
  const kind = placing.peek();
  if (kind === null) return;
  await attempt(async () => {
    const found = await askProbe(view, x, y);
    if (placing.peek() === kind) put(kind, view, found);
  });
}

/** Put the light where the middle of the active view's picture is. */
export function placeInTheMiddle(): Promise<void> {
  const { view, pixels } = stage.active;
  return placeAt(view, Math.floor(pixels.width / 2), Math.floor(pixels.height / 2));
}

export function startPlacing(kind: AddedKind): void {
  if (lightNames.value.length >= MAX_LIGHTS) note(`A scene has at most ${MAX_LIGHTS} lights; remove one first.`);
  else placing.value = placing.value === kind ? null : kind;
}
