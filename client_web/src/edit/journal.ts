/** The history as text that a reload finds again: a look, then from one to the next what changed. The pictures of its
 * looks go with it. */
import { changeBy } from "../document/change";
import { differenceOf, isSame } from "../document/difference";
import type { Look, PatchOp } from "../protocol";
import type { LookStep, ShelfStep, Step, TimelineStep } from "./history";

export interface Story {
  steps: readonly Step[];
  cursor: number;
}

/** A picture of a look, null where there is none. */
export type PictureOf = (look: Look) => string | null;

interface KeptLookStep {
  label: string;
  key?: string | undefined;
  /** From the look that the step before led to; it is the same but for steps that were refused. */
  gap?: PatchOp[];
  change: readonly PatchOp[];
  picture: string | null;
}

interface KeptStory {
  /** The first look. */
  start: Look | null;
  picture: string | null;
  steps: (KeptLookStep | ShelfStep | TimelineStep)[];
  cursor: number;
}

function isLookStep(step: Step): step is LookStep {
  return step.of === "look";
}

function written({ steps, cursor }: Story, pictureOf: PictureOf): string {
  const start = steps.find(isLookStep)?.before ?? null;
  let last = start;
  const kept = steps.map((step) => {
    if (!isLookStep(step)) return step;
    const { label, key, before, after, patch } = step;
    const gap = last === null ? [] : differenceOf(last, before);
    last = after;
    return { label, key, ...(gap.length > 0 && { gap }), change: patch, picture: pictureOf(after) };
  });
  const story: KeptStory = { start, picture: start && pictureOf(start), steps: kept, cursor };
  return JSON.stringify(story);
}

/** Without a tenth of its steps: the oldest that are done, else the farthest that are not. */
function shortened({ steps, cursor }: Story): Story {
  const fewer = Math.ceil(steps.length / 10);
  const first = Math.min(fewer, cursor);
  return { steps: steps.slice(first, steps.length - (fewer - first)), cursor: cursor - first };
}

/** As many steps as fit into `maxLength` characters. */
export function toText(story: Story, maxLength: number, pictureOf: PictureOf): string {
  let short = story;
  let text = written(short, pictureOf);
  while (text.length > maxLength && short.steps.length > 0) {
    short = shortened(short);
    text = written(short, pictureOf);
  }
  return text;
}

/** The look that a story has come to; null where none of its steps says so. */
function present({ steps, cursor }: Story): Look | null {
  return steps.slice(0, cursor).findLast(isLookStep)?.after ?? steps.slice(cursor).find(isLookStep)?.before ?? null;
}

/** The story of a text, null where it does not lead to `look`; where that is null others edit it as well, and the story is
 * of what this one did. `give` takes the pictures of its looks. */
export function fromText(text: string, look: Look | null, give: (of: Look, picture: string) => void): Story | null {
  const kept = JSON.parse(text) as KeptStory;
  const pictures: [Look, string | null][] = [];
  let last = kept.start as Look;
  pictures.push([last, kept.picture]);
  const steps = kept.steps.map((step): Step => {
    if (!("change" in step)) return step;
    const { label, key, gap, change, picture } = step;
    const made = changeBy(gap === undefined ? last : changeBy(last, gap).after, change);
    last = made.after;
    pictures.push([last, picture]);
    return { of: "look", label, ...(key !== undefined && { key }), ...made };
  });
  const story = { steps, cursor: kept.cursor };
  const now = present(story);
  if (now !== null && look !== null && !isSame(now, look)) return null;
  for (const [of, picture] of pictures) if (picture !== null) give(of, picture);
  return story;
}
