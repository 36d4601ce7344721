/** Balls of the scene's materials, rendered by the server as the library's are: one at a time, once a material rests. */
import { effect, signal } from "@preact/signals";
import { ballOf } from "../net/api";
import type { Term } from "../protocol";
import { look } from "../state/look";
import { materialOf, scene } from "../state/scene";

/** A material rests so long before its ball is rendered anew. */
const REST_MS = 800;
const MAX_STORED = 200;

/** Addresses of pictures, by what they show; null where the server has none to give. */
const balls = new Map<string, string | null>();
/** Of each material: the ball that is shown. */
export const shownBalls = signal<ReadonlyMap<string, string>>(new Map());

let timer: ReturnType<typeof setTimeout> | undefined;
let isBusy = false;

const keyOf = (of: string, material: string, terms: readonly Term[]): string => JSON.stringify([of, material, terms]);

function store(key: string, ball: string | null): void {
  balls.set(key, ball);
  const [oldest] = balls.keys();
  if (balls.size <= MAX_STORED || oldest === undefined) return;
  const url = balls.get(oldest);
  if (url != null) URL.revokeObjectURL(url);
  balls.delete(oldest);
}

/** Show what there is, and render the first ball that there is not. */
async function follow(): Promise<void> {
  const [of, materials] = [scene.peek()?.id, look.peek()?.materials];
  if (of === undefined || materials === undefined) return;
  // light passes glass, and a ball shows reflection alone
  const wanted = Object.entries(materials).filter(([name]) => materialOf(name)?.is_glass !== true);
  const keys = wanted.map(([name, { terms }]) => [name, keyOf(of, name, terms), terms] as const);
  shownBalls.value = new Map(keys.flatMap(([name, key]) => (balls.get(key) == null ? [] : [[name, balls.get(key) as string]])));
  const next = keys.find(([, key]) => !balls.has(key));
  if (next === undefined || isBusy) return;
  const [name, key, terms] = next;
  isBusy = true;
  try {
    store(key, URL.createObjectURL(await ballOf(of, name, terms)));
  } catch {
    store(key, null); // its colors alone are shown
  } finally {
    isBusy = false;
  }
  await follow();
}

/** Render balls from now on. */
export function followBalls(): () => void {
  return effect(() => {
    scene.value;
    look.value;
    clearTimeout(timer);
    timer = setTimeout(() => void follow(), REST_MS);
  });
}
