/** Which bakes of a scene there are, and what may be asked of a new one. */
import { listBakes } from "../net/api";
import { MAX_VISIBLE_VIEWS, type BakeBody, type SceneBody } from "../../protocol";
import type { BakeMethod } from "./bakeMethods";
import type { BakeSize } from "./recipe";

export type BakePreset = "preview" | "good" | "final";
export interface BakeSettings {
  method: BakeMethod;
  views: string[];
  /** Gives the size and the number of lights that are not named beside it. */
  preset?: BakePreset;
  /** Width ÷ height of the preset's image. */
  aspect?: number;
  size?: BakeSize;
  lights?: number;
  patches?: number;
  gather_rays?: number;
  /** Divided for light that will be turned or exchanged. */
  relightable?: boolean;
}

/** The views that are baked where nobody chooses: as many as can be shown at once. */
export function viewsToBake(scene: SceneBody): string[] {
  return scene.views.slice(0, MAX_VISIBLE_VIEWS).map((view) => view.name);
}

/** How fine a bake is: pixels times lights. */
export function quality({ recipe }: BakeBody): number {
  return recipe.size[0] * recipe.size[1] * recipe.lights;
}

/** A scene's bakes, finest first; of equally fine ones first what this version of relume made. */
export async function listBakesByQuality(scene: SceneBody): Promise<BakeBody[]> {
  const sceneBakes = await listBakes(scene.id);
  return sceneBakes.sort((a, b) => quality(b) - quality(a) || Number(b.is_current) - Number(a.is_current));
}
