/** The bakes of a scene, and the settings of a new one. */
import { listBakes } from "../net/api";
import { MAX_VISIBLE_VIEWS, type BakeBody, type SceneBody } from "../../protocol";
import type { BakeMethod } from "./bakeMethods";
import type { BakeSize } from "./recipe";

export type BakePreset = "preview" | "good" | "final";
export interface BakeSettings {
  method: BakeMethod;
  views: string[];
  /** Preset for the size and number of lights if not given. */
  preset?: BakePreset;
  /** Aspect ratio of the preset's image. */
  aspect?: number;
  size?: BakeSize;
  lights?: number;
  patches?: number;
  gather_rays?: number;
  /** Optimized for rotating or replacing the environment. */
  relightable?: boolean;
}

/** The default views: as many as can be shown at once. */
export function viewsToBake(scene: SceneBody): string[] {
  return scene.views.slice(0, MAX_VISIBLE_VIEWS).map((view) => view.name);
}

/** Fineness of a bake: pixels times lights. */
export function quality({ recipe }: BakeBody): number {
  return recipe.size[0] * recipe.size[1] * recipe.lights;
}

/** A scene's bakes, finest first; among equals, those of the current relume version first. */
export async function listBakesByQuality(scene: SceneBody): Promise<BakeBody[]> {
  const sceneBakes = await listBakes(scene.id);
  return sceneBakes.sort((a, b) => quality(b) - quality(a) || Number(b.is_current) - Number(a.is_current));
}
