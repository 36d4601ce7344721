/** The open page, the edited scene, and the available term models. */
import { computed, signal } from "@preact/signals";
import type { ModelBody, SceneBody, SceneMaterial, Term } from "../protocol";

export const page = signal<"start" | "editor">("start");
export const models = signal<ModelBody[]>([]);
export const scene = signal<SceneBody | null>(null);
/** Aspect ratio of the first bake of a scene that has none yet: clay pictures stand in for it. Null: there is a bake. */
export const unbakedAspect = signal<number | null>(null);
export const materialNames = computed(() => scene.value?.materials.map((m) => m.name) ?? []);
/** Names of the scene's objects; empty if there are too many to list. */
export const objectNames = computed(() => [...new Set(scene.value?.objects ?? [])]);

/** The scene's info on a material. */
export function materialOf(name: string): SceneMaterial | undefined {
  return scene.value?.materials.find((material) => material.name === name);
}

export function modelOf(term: Term): ModelBody | undefined {
  return models.value.find((model) => model.model === term.model);
}
