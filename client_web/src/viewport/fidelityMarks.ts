/** How near the picture is to its look, in the picture's corner: said where it is not exact for longer than a blink, so
 * that nothing flickers while a hand drags. */
import { computed, effect, signal, untracked } from "@preact/signals";
import type { Fidelity } from "../protocol";
import { DEFAULT_METHOD, wordsOf } from "../scene/methods";
import { method } from "../state/bakes";
import { bakedError, fidelity, isOutdated, movingError, settled } from "../state/fidelity";
import { bakedLight } from "../state/look";
import { moves } from "../state/views";
import { playing } from "../timeline/play";

export interface Mark {
  words: string;
  title: string;
}

const MARKS: Record<Exclude<Fidelity, "exact">, Mark> = {
  preview: { words: "Preview", title: "A few points are shaded, the others guessed from them. All are shaded next." },
  approximate: { words: "Updating…", title: "The picture is of a moment ago; what the new one needs is being made." },
  followed: { words: "Followed closely", title: "What the hand changes is followed roughly. Exact at rest." },
  near: { words: "Nearly exact", title: "What the hand changes is followed closely. Exact at rest." },
};
const OTHER_LIGHT: Mark = {
  words: "Baked for other light",
  title: "Shadows were baked before this light was known: those of small lamps are approximate. A new bake mends it.",
};

const DIRECT_ONLY: Mark = {
  words: "Direct light only",
  title: `Objects are not reflected, in metal and glass neither, and do not light each other. A bake “${wordsOf(DEFAULT_METHOD).label}” shows both.`,
};

const PLAYING: Mark = {
  words: "Playing",
  title: "Frames of the time line, as near to it as each comes in time. Exact where it is paused.",
};

const WHY_MOVING = "Light is kept at points of the surfaces: fine shadows and sharp highlights are softer.";
const THEN = "Where the eye rests the exact picture follows.";

const percents = (share: number) => (share < 0.095 ? (100 * share).toFixed(1) : `${Math.round(100 * share)}`);

/** With how far it is off: where the eye rested last, else as it was measured in the bake. */
function movingMark(): Mark {
  const [rested, baked] = [movingError.value, bakedError.value];
  const off = rested ?? baked?.value ?? null;
  if (off === null) return { words: "Moving view, approximate", title: `${WHY_MOVING} ${THEN}` };
  const measured =
    baked === null ? "" : ` In the bake, in the scene's own look, it was ${percents(baked.value)} ± ${percents(baked.standard_error)} % off (RMS of surfaces, standard error).`;
  const here = rested === null ? "" : ` Where the eye rested last this was ${percents(rested)} % of the picture (RMS).`;
  return { words: `Moving view, about ${percents(off)} % off`, title: `${WHY_MOVING}${measured}${here} ${THEN}` };
}

const SHOWN_AFTER_MS = 300;
const rough = signal<Exclude<Fidelity, "exact"> | null>(null);

function say(): void {
  const now = fidelity.peek();
  if (now !== "exact") rough.value = now;
}

const isRough = computed(() => fidelity.value !== "exact");
effect(() => {
  if (settled.value) rough.value = null;
});
effect(() => {
  const timer = isRough.value ? setTimeout(say, SHOWN_AFTER_MS) : undefined;
  return () => clearTimeout(timer);
});
/** The picture is of before the newest edit, for longer than a blink. */
const isLate = signal(false);
effect(() => {
  const timer = isOutdated.value ? setTimeout(() => (isLate.value = true), SHOWN_AFTER_MS) : undefined;
  if (!isOutdated.value && isLate.peek()) {
    isLate.value = false;
    untracked(say); // the word that was there goes on with the next, which is not waited for
  }
  return () => clearTimeout(timer);
});

// a word that is there changes when another one has held
effect(() => {
  const timer = fidelity.value !== rough.peek() && rough.peek() !== null ? setTimeout(say, SHOWN_AFTER_MS) : undefined;
  return () => clearTimeout(timer);
});

function markOf(now: Exclude<Fidelity, "exact">): Mark {
  return moves.value && now === "approximate" ? movingMark() : MARKS[now];
}

/** What is said now: of the picture, and of what its bake cannot know. */
export function marks(): Mark[] {
  const word = isLate.value ? "approximate" : rough.value;
  const ofPicture = word === null ? [] : [playing.value ? PLAYING : markOf(word)];
  const ofBake = [...(bakedLight.value ? [] : [OTHER_LIGHT]), ...(method.value === "direct" ? [DIRECT_ONLY] : [])];
  return [...ofPicture, ...ofBake];
}
