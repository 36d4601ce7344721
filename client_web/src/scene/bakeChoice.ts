/** Which bakes of a scene there are, and what may be asked of a new one. */
import { bakesOfScene } from "../net/api";
import { MAX_VIEWS_SHOWN, type BakeBody, type SceneBody } from "../protocol";
import type { Method } from "./methods";
import type { Size } from "./recipe";

export type Preset = "preview" | "good" | "final";
export interface BakeChoice {
  method: Method;
  views: string[];
  /** Gives the size and the number of lights that are not named beside it. */
  preset?: Preset;
  /** Width ÷ height of the preset's picture. */
  aspect?: number;
  size?: Size;
  lights?: number;
  gather_samples?: number;
  gather_rays?: number;
  /** Divided for light that will be turned or exchanged. */
  relightable?: boolean;
}

/** The views that are baked where nobody chooses: as many as can be seen at once. */
export function viewsToBake(scene: SceneBody): string[] {
  return scene.views.slice(0, MAX_VIEWS_SHOWN).map((view) => view.name);
}

/** How fine a bake is: pixels times lights. */
export function fineness({ recipe }: BakeBody): number {
  return recipe.size[0] * recipe.size[1] * recipe.lights;
}

/** A scene's bakes, finest first; of equally fine ones first what this version of relume made. */
export async function bakesOf(scene: SceneBody): Promise<BakeBody[]> {
  const found = await bakesOfScene(scene.id);
  return found.sort((a, b) => fineness(b) - fineness(a) || Number(b.is_current) - Number(a.is_current));
}
