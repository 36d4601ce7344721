/** Keyframes of the timeline, stored in this tab. Their changes are history steps. */
import { computed, effect, signal } from "@preact/signals";
import { history, type Keyframe } from "../../edit/history";
import type { LooksRequest } from "../../protocol";
import { scene } from "../../state/scene";
import { hasFreeCamera } from "../../state/views";
import { showNote } from "../../ui/toasts";

export const MAX_KEYFRAMES = 24;
export const [MIN_SECONDS, MAX_SECONDS] = [0.5, 20];

export const keyframes = signal<readonly Keyframe[]>([]);
export const seconds = signal(4);
/** Interpolation of materials between looks. */
export const interpolation = signal<NonNullable<LooksRequest["interpolation"]>>("parameters");
export const isLooping = signal(true);
/** Motion during playback: none; the camera, once around or through the keyframes; or, with a fixed camera, the object or
 * the environment, once around. */
export type CameraPathMode = "still" | "around" | "along" | "object" | "environment";
export const cameraPathMode = signal<CameraPathMode>("still");
/** The motion possible in the active view: with a fixed camera, only of the environment. */
export const currentPath = computed<CameraPathMode>(() =>
  hasFreeCamera.value || cameraPathMode.value === "environment" ? cameraPathMode.value : "still",
);
/** Minimum number of looks for playback. */
export const fewestKeyframes = computed(() => (currentPath.value === "still" || currentPath.value === "along" ? 2 : 1));

function replaceKeyframes(label: string, after: readonly Keyframe[]): void {
  const before = keyframes.peek();
  keyframes.value = after;
  history.record({ kind: "timeline", label, before, after });
  history.endGesture();
}

export const [MIN_DURATION, MAX_DURATION] = [0.1, 100];

/** Relative times from each keyframe to the next. */
export const durations = computed(() => keyframes.value.slice(0, -1).map(({ duration }) => duration ?? 1));

/** Time of each keyframe, as a fraction of the whole. */
export const keyTimes = computed(() => {
  const times = durations.value.reduce((sums, duration) => [...sums, (sums.at(-1) ?? 0) + duration], [0]);
  const total = times.at(-1) || 1;
  return times.map((time) => time / total);
});

/** Add keyframes in one step; false, with a note, if there is no room for all. */
export function addKeyframes(label: string, added: readonly Keyframe[]): boolean {
  const room = MAX_KEYFRAMES - keyframes.peek().length;
  if (added.length <= room) replaceKeyframes(label, [...keyframes.peek(), ...added]);
  else showNote(`The timeline has room for ${room} more looks, and ${added.length} were to be added.`);
  return added.length <= room;
}

export function addKeyframe(keyframe: Keyframe): void {
  addKeyframes(`Add ${keyframe.name} to timeline`, [keyframe]);
}

export function setKeyframeDuration(index: number, duration: number): void {
  const timed = keyframes.peek()[index];
  if (timed !== undefined)
    replaceKeyframes(`Time after ${timed.name}`, keyframes.peek().with(index, { ...timed, duration }));
}

export function removeKeyframe(index: number): void {
  const name = keyframes.peek()[index]?.name ?? "";
  replaceKeyframes(`Remove ${name} from timeline`, keyframes.peek().toSpliced(index, 1));
}

/** Move a keyframe by one position. */
export function moveKeyframe(index: number, offset: -1 | 1): void {
  const [moved, to] = [keyframes.peek()[index], index + offset];
  if (moved === undefined || to < 0 || to >= keyframes.peek().length) return;
  replaceKeyframes(
    `Move ${moved.name} ${offset < 0 ? "earlier" : "later"}`,
    keyframes.peek().toSpliced(index, 1).toSpliced(to, 0, moved),
  );
}

/** Change a keyframe's camera on the camera path. */
export function setKeyframeCamera(index: number, camera: NonNullable<Keyframe["camera"]>): void {
  const moved = keyframes.peek()[index];
  if (moved !== undefined)
    replaceKeyframes(`Camera of ${moved.name}`, keyframes.peek().with(index, { ...moved, camera }));
}

/** A name for an unsaved look. */
export function nextKeyframeName(): string {
  const usedNames = new Set(keyframes.peek().map(({ name }) => name));
  let number = keyframes.peek().length + 1;
  while (usedNames.has(`Key ${number}`)) number += 1;
  return `Key ${number}`;
}

interface StoredTimeline {
  keyframes: readonly Keyframe[];
  seconds: number;
  interpolation: typeof interpolation.value;
  cameraPath?: CameraPathMode;
}

const storageKey = (id: string) => `relume.timeline.${id}`;

function loadTimeline(id: string): void {
  let stored: StoredTimeline | null = null;
  try {
    stored = JSON.parse(sessionStorage.getItem(storageKey(id)) ?? "null") as StoredTimeline | null;
  } catch {
    // storage is forbidden or invalid: the timeline is empty
  }
  keyframes.value = stored?.keyframes ?? [];
  seconds.value = stored?.seconds ?? 4;
  interpolation.value = stored?.interpolation ?? "parameters";
  cameraPathMode.value = stored?.cameraPath ?? "still";
}

/** Store the timeline of each scene for a reload. */
export function trackTimeline(): void {
  let displayedScene: string | null = null;
  effect(() => {
    const id = scene.value?.id ?? null;
    const [shownKeys, cameraPath] = [keyframes.value, cameraPathMode.value];
    const stored: StoredTimeline = {
      keyframes: shownKeys,
      seconds: seconds.value,
      interpolation: interpolation.value,
      cameraPath,
    };
    if (id === null) return;
    if (id !== displayedScene) {
      displayedScene = id;
      loadTimeline(id);
      return;
    }
    try {
      sessionStorage.setItem(storageKey(id), JSON.stringify(stored));
    } catch {
      // storage is full or forbidden: a reload starts with an empty timeline
    }
  });
}
