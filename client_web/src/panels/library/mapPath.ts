/** A path drawn on the material map: its points become keyframes of the timeline (Sun 2007, section 5). */
import { signal } from "@preact/signals";
import type { Keyframe } from "../../edit/history";
import type { Look, Term } from "../../protocol";
import { getMaterialAt, type MapTable } from "../../session/net/api";
import { look } from "../../state/look";
import { timelineOpen } from "../../state/panels";
import { currentPose } from "../looks/exportImage";
import { addKeyframes, interpolation, MAX_KEYFRAMES } from "../looks/keyframes";
import { highlightAt, positionOf, type Highlight, type HighlightRange, type MapPosition } from "./navigationMap";

const STEPS = 12; // lines per segment of the plot

export const mapTable = signal<MapTable>("ngan");
export const isDrawingPath = signal(false);
export const pathPoints = signal<readonly Highlight[]>([]);

/** Points are only added to a path that the timeline can hold. */
export function addPathPoint(position: MapPosition, range: HighlightRange): void {
  if (pathPoints.peek().length < MAX_KEYFRAMES) pathPoints.value = [...pathPoints.peek(), highlightAt(position, range)];
}

/** The way on the plot that materials take between points: straight in reflectance and log roughness, which is slightly
 * curved here, where reflectance has a square root. */
export function pathLine(points: readonly Highlight[], range: HighlightRange): MapPosition[] {
  return points.flatMap((point, k) => {
    const next = points[k + 1];
    if (next === undefined) return [positionOf(point, range)];
    return Array.from({ length: STEPS }, (_, step) => {
      const weight = step / STEPS;
      const f0 = (1 - weight) * point.f0 + weight * next.f0;
      return positionOf({ f0, sigma: point.sigma ** (1 - weight) * next.sigma ** weight }, range);
    });
  });
}

/** Lengths of a path's segments on the plot over their mean: durations at constant speed. */
export function pathDurations(points: readonly Highlight[], range: HighlightRange): number[] {
  const positions = points.map((point) => positionOf(point, range));
  const lengths = positions
    .slice(1)
    .map(({ x, y }, k) => Math.hypot(x - (positions[k]?.x ?? x), y - (positions[k]?.y ?? y)));
  const mean = lengths.reduce((sum, length) => sum + length, 0) / lengths.length;
  return lengths.map((length) => (mean > 0 ? Math.max(0.1, Math.round((100 * length) / mean) / 100) : 1));
}

const withTerms = (from: Look, material: string, terms: readonly Term[]): Look => {
  const materialLook = from.materials[material];
  if (materialLook === undefined) return from;
  const bare = terms.map((term) => ({ ...term, texture: null }));
  return { ...from, materials: { ...from.materials, [material]: { ...materialLook, terms: bare } } };
};

/** Add the drawn path of a material to the timeline, one keyframe a point, moving at constant speed. */
export async function addPathToTimeline(material: string, range: HighlightRange): Promise<void> {
  const [from, points, table] = [look.peek(), pathPoints.peek(), mapTable.peek()];
  if (from === null || points.length < 2) return;
  const durations = pathDurations(points, range);
  const pathTerms = await Promise.all(points.map(({ f0, sigma }) => getMaterialAt(f0, sigma, table)));
  const keys = pathTerms.map((terms, k): Keyframe => ({
    name: `${material} ${k + 1}`,
    look: withTerms(from, material, terms),
    camera: currentPose(),
    duration: durations[k],
  }));
  if (!addKeyframes(`Add path of ${material} to timeline`, keys)) return;
  interpolation.value = table === "ngan" ? "map" : "map_low";
  [pathPoints.value, isDrawingPath.value, timelineOpen.value] = [[], false, true];
}
