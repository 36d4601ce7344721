/** Preview balls of the scene's materials, rendered by the server: one at a time, when edits of a material pause. */
import { effect, signal } from "@preact/signals";
import { renderMaterialBall } from "../../session/net/api";
import type { Term } from "../../protocol";
import { look } from "../../state/look";
import { materialOf, scene } from "../../state/scene";

/** Pause of edits before a material's ball is rendered again. */
const IDLE_MS = 800;
const MAX_STORED = 200;

/** Image URLs by material content; null if the server cannot render it. */
const materialBalls = new Map<string, string | null>();
/** The displayed ball of each material. */
export const displayedBalls = signal<ReadonlyMap<string, string>>(new Map());

let timer: ReturnType<typeof setTimeout> | undefined;
let isBusy = false;

const keyOf = (sceneId: string, material: string, terms: readonly Term[]): string => JSON.stringify([sceneId, material, terms]);

function store(key: string, ball: string | null): void {
  materialBalls.set(key, ball);
  const [oldest] = materialBalls.keys();
  if (materialBalls.size <= MAX_STORED || oldest === undefined) return;
  const url = materialBalls.get(oldest);
  if (url != null) URL.revokeObjectURL(url);
  materialBalls.delete(oldest);
}

/** Show the available balls, and render the first missing one. */
async function requestBalls(): Promise<void> {
  const [sceneId, materials] = [scene.peek()?.id, look.peek()?.materials];
  if (sceneId === undefined || materials === undefined) return;
  // a ball shows only reflection, not the transmission of glass
  const renderable = Object.entries(materials).filter(([name]) => materialOf(name)?.is_glass !== true);
  const keys = renderable.map(([name, { terms }]) => [name, keyOf(sceneId, name, terms), terms] as const);
  displayedBalls.value = new Map(keys.flatMap(([name, key]) => (materialBalls.get(key) == null ? [] : [[name, materialBalls.get(key) as string]])));
  const next = keys.find(([, key]) => !materialBalls.has(key));
  if (next === undefined || isBusy) return;
  const [name, key, terms] = next;
  isBusy = true;
  try {
    store(key, URL.createObjectURL(await renderMaterialBall(sceneId, name, terms)));
  } catch {
    store(key, null); // only its colors are shown
  } finally {
    isBusy = false;
  }
  await requestBalls();
}

/** Render balls from now on. */
export function watchBalls(): () => void {
  return effect(() => {
    void scene.value;
    void look.value;
    clearTimeout(timer);
    timer = setTimeout(() => void requestBalls(), IDLE_MS);
  });
}
