/** The history as text for a reload: the first look, then the changes between looks, with their thumbnails. */
import { changeByPatch } from "../state/document/jsonPatch";
import { diffLooks, isDeepEqual } from "../state/document/difference";
import type { Look, PatchOp } from "../protocol";
import type { LookStep, SavedLookStep, Step, TimelineStep } from "./history";

export interface HistorySnapshot {
  steps: readonly Step[];
  cursor: number;
}

/** The thumbnail of a look, or null. */
export type ThumbnailOf = (look: Look) => string | null;

interface StoredLookStep {
  label: string;
  key?: string | undefined;
  /** Change from the previous step's look; they differ only if a step was rejected. */
  gap?: PatchOp[];
  change: readonly PatchOp[];
  thumbnail: string | null;
}

interface StoredHistory {
  /** The first look. */
  start: Look | null;
  thumbnail: string | null;
  steps: (StoredLookStep | SavedLookStep | TimelineStep)[];
  cursor: number;
}

function isLookStep(step: Step): step is LookStep {
  return step.kind === "look";
}

function stringifyHistory({ steps, cursor }: HistorySnapshot, thumbnailOf: ThumbnailOf): string {
  const start = steps.find(isLookStep)?.before ?? null;
  let last = start;
  const storedSteps = steps.map((step) => {
    if (!isLookStep(step)) return step;
    const { label, key, before, after, patch } = step;
    const gap = last === null ? [] : diffLooks(last, before);
    last = after;
    return { label, key, ...(gap.length > 0 && { gap }), change: patch, thumbnail: thumbnailOf(after) };
  });
  const stored: StoredHistory = { start, thumbnail: start && thumbnailOf(start), steps: storedSteps, cursor };
  return JSON.stringify(stored);
}

/** The history without a tenth of its steps: the oldest done ones, else the last undone ones. */
function truncateHistory({ steps, cursor }: HistorySnapshot): HistorySnapshot {
  const numDropped = Math.ceil(steps.length / 10);
  const first = Math.min(numDropped, cursor);
  return { steps: steps.slice(first, steps.length - (numDropped - first)), cursor: cursor - first };
}

/** As many steps as fit into `maxLength` characters. */
export function serializeHistory(history: HistorySnapshot, maxLength: number, thumbnailOf: ThumbnailOf): string {
  let snapshot = history;
  let text = stringifyHistory(snapshot, thumbnailOf);
  while (text.length > maxLength && snapshot.steps.length > 0) {
    snapshot = truncateHistory(snapshot);
    text = stringifyHistory(snapshot, thumbnailOf);
  }
  return text;
}

/** The current look of a history; null if no step has it. */
function currentLookOf({ steps, cursor }: HistorySnapshot): Look | null {
  return steps.slice(0, cursor).findLast(isLookStep)?.after ?? steps.slice(cursor).find(isLookStep)?.before ?? null;
}

/** Parse a history; null if it does not lead to `look`. In a room `look` is null: the history then has only this user's
 * edits. `addThumbnail` receives the thumbnails of its looks. */
export function parseHistory(
  text: string,
  look: Look | null,
  addThumbnail: (snapshotLook: Look, thumbnail: string) => void,
): HistorySnapshot | null {
  const stored = JSON.parse(text) as StoredHistory;
  const thumbnails: [Look, string | null][] = [];
  let last = stored.start as Look;
  thumbnails.push([last, stored.thumbnail]);
  const steps = stored.steps.map((step): Step => {
    if (!("change" in step)) return step;
    const { label, key, gap, change, thumbnail } = step;
    const lookChange = changeByPatch(gap === undefined ? last : changeByPatch(last, gap).after, change);
    last = lookChange.after;
    thumbnails.push([last, thumbnail]);
    return { kind: "look", label, ...(key !== undefined && { key }), ...lookChange };
  });
  const snapshot = { steps, cursor: stored.cursor };
  const currentLook = currentLookOf(snapshot);
  if (currentLook !== null && look !== null && !isDeepEqual(currentLook, look)) return null;
  for (const [snapshotLook, thumbnail] of thumbnails) if (thumbnail !== null) addThumbnail(snapshotLook, thumbnail);
  return snapshot;
}
