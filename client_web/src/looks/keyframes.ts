/** Looks on the time line, which is kept for this tab. What becomes of them is a step of the history. */
import { computed, effect, signal } from "@preact/signals";
import { history, type Keyframe } from "../edit/history";
import type { LooksRequest } from "../protocol";
import { scene } from "../state/scene";
import { moves } from "../state/views";

export const MAX_KEYFRAMES = 24;
export const [MIN_SECONDS, MAX_SECONDS] = [0.5, 20];

export const keyframes = signal<readonly Keyframe[]>([]);
export const seconds = signal(4);
/** How materials go from one look to the next. */
export const between = signal<NonNullable<LooksRequest["between"]>>("parameters");
export const loops = signal(true);
/** What moves meanwhile: nothing; the eye, once around from where the first look is seen, or from key to key; or, before an
 * eye that stays, the object or the environment, once around. */
export type EyeWay = "still" | "around" | "along" | "object" | "environment";
export const eyeWay = signal<EyeWay>("still");
/** What can move in the view in hand: of one that was baked from one place the environment alone. */
export const wayNow = computed<EyeWay>(() => (moves.value || eyeWay.value === "environment" ? eyeWay.value : "still"));
/** How many looks there is something to play of. */
export const fewestKeyframes = computed(() => (wayNow.value === "still" || wayNow.value === "along" ? 2 : 1));

function put(label: string, after: readonly Keyframe[]): void {
  const before = keyframes.peek();
  keyframes.value = after;
  history.record({ of: "timeline", label, before, after });
  history.seal();
}

export function addKeyframe(of: Keyframe): void {
  if (keyframes.peek().length < MAX_KEYFRAMES) put(`${of.name} to the time line`, [...keyframes.peek(), of]);
}

export function removeKeyframe(index: number): void {
  const name = keyframes.peek()[index]?.name ?? "";
  put(`${name} off the time line`, keyframes.peek().toSpliced(index, 1));
}

/** One place earlier or later. */
export function moveKeyframe(index: number, by: -1 | 1): void {
  const [moved, to] = [keyframes.peek()[index], index + by];
  if (moved === undefined || to < 0 || to >= keyframes.peek().length) return;
  put(`${moved.name} ${by < 0 ? "earlier" : "later"}`, keyframes.peek().toSpliced(index, 1).toSpliced(to, 0, moved));
}

/** See one from somewhere else on a way from key to key. */
export function seeKeyframeFrom(index: number, eye: NonNullable<Keyframe["eye"]>): void {
  const moved = keyframes.peek()[index];
  if (moved !== undefined) put(`${moved.name} from elsewhere`, keyframes.peek().with(index, { ...moved, eye }));
}

/** A name for a look that has none: keyframes are told apart. */
export function freeKeyframeName(): string {
  const taken = new Set(keyframes.peek().map(({ name }) => name));
  let number = keyframes.peek().length + 1;
  while (taken.has(`Key ${number}`)) number += 1;
  return `Key ${number}`;
}

interface Kept {
  keyframes: readonly Keyframe[];
  seconds: number;
  between: typeof between.value;
  eyeWay?: EyeWay;
}

const keptKey = (id: string) => `relume.timeline.${id}`;

function recall(id: string): void {
  let kept: Kept | null = null;
  try {
    kept = JSON.parse(sessionStorage.getItem(keptKey(id)) ?? "null") as Kept | null;
  } catch {
    // forbidden or not ours: the time line is empty
  }
  keyframes.value = kept?.keyframes ?? [];
  seconds.value = kept?.seconds ?? 4;
  between.value = kept?.between ?? "parameters";
  eyeWay.value = kept?.eyeWay ?? "still";
}

/** Keep the time line of each scene for a reload. */
export function followTimeline(): void {
  let shown: string | null = null;
  effect(() => {
    const id = scene.value?.id ?? null;
    const [shownKeys, way] = [keyframes.value, eyeWay.value];
    const kept: Kept = { keyframes: shownKeys, seconds: seconds.value, between: between.value, eyeWay: way };
    if (id === null) return;
    if (id !== shown) {
      shown = id;
      recall(id);
      return;
    }
    try {
      sessionStorage.setItem(keptKey(id), JSON.stringify(kept));
    } catch {
      // storage is full or forbidden: a reload then begins with an empty time line
    }
  });
}
