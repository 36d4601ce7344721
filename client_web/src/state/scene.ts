/** The open page, the edited scene, and the available term models. */
import { computed, signal } from "@preact/signals";
import type { ModelBody, SceneBody, SceneMaterial, Term } from "../protocol";
import { look } from "./look";

export const page = signal<"start" | "editor">("start");
export const models = signal<ModelBody[]>([]);
export const scene = signal<SceneBody | null>(null);
/** Aspect ratio of the first bake of a scene that has none yet: clay pictures stand in for it. Null: there is a bake. */
export const unbakedAspect = signal<number | null>(null);
export const materialNames = computed(() => scene.value?.materials.map((m) => m.name) ?? []);
/** Names of the scene's materials, each before those that the look gives to some of its objects. */
export const shownMaterialNames = computed(() => {
  const added = Object.entries(look.value?.materials ?? {}).filter(([, { base }]) => base != null);
  return materialNames.value.flatMap((name) => [
    name,
    ...added.filter(([, { base }]) => base === name).map(([objectMaterial]) => objectMaterial),
  ]);
});
/** Names of the scene's objects; empty if there are too many to list. */
export const objectNames = computed(() => [...new Set(scene.value?.objects ?? [])]);

/** The scene's info on a material; on the base material, for a material of some objects. */
export function materialOf(name: string): SceneMaterial | undefined {
  const sceneName = look.value?.materials[name]?.base ?? name;
  return scene.value?.materials.find((material) => material.name === sceneName);
}

export function modelOf(term: Term): ModelBody | undefined {
  return models.value.find((model) => model.model === term.model);
}
