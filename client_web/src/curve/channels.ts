/** A curve's edits in the look, seen per channel, and back in the shortest form. */
import type { CurveEdits, CurveOverride, Point } from "../protocol";
import { niceTop, type Axes } from "./axes";
import { bandSamples, fitPoints } from "./fit";

export type ChannelName = "r" | "g" | "b";
export const CHANNELS: readonly ChannelName[] = ["r", "g", "b"];
/** Points per channel; null where the model's parameters make the curve. */
export type Channels = readonly [Point[] | null, Point[] | null, Point[] | null];
export type Active = "rgb" | ChannelName;

const CHANNELS_OF: Record<Active, number[]> = { rgb: [0, 1, 2], r: [0], g: [1], b: [2] };

export function channelsOf(active: Active): number[] {
  return CHANNELS_OF[active];
}

function bandsOf(bands: number[] | number[][], channel: number, numBands: number): number[] {
  if (Array.isArray(bands[0])) return (bands as number[][])[channel] ?? [];
  const flat = bands as number[];
  return flat.length === 3 * numBands ? flat.slice(channel * numBands, (channel + 1) * numBands) : flat;
}

function pointsOf(override: CurveOverride, channel: number, numBands: number): Point[] | null {
  if (override.points !== undefined) return override.points;
  if (override.bands === undefined) return null;
  const bands = bandsOf(override.bands, channel, numBands);
  const axes: Axes = { stretched: false, log: false, top: niceTop(Math.max(...bands), false) };
  return fitPoints(bandSamples(bands), axes, 48);
}

export function readChannels(edits: CurveEdits | undefined, numBands: number): Channels {
  const result: [Point[] | null, Point[] | null, Point[] | null] = [null, null, null];
  const list = edits === undefined ? [] : Array.isArray(edits) ? edits : [edits];
  for (const override of list) {
    CHANNELS.forEach((name, channel) => {
      if ((override.channels ?? "rgb").includes(name)) result[channel] = pointsOf(override, channel, numBands);
    });
  }
  return result;
}

/** Channels with the same points share one object; undefined where nothing is drawn. */
export function writeChannels(channels: Channels): CurveEdits | undefined {
  const groups = new Map<string, { points: Point[]; channels: string }>();
  channels.forEach((points, channel) => {
    if (points === null) return;
    const key = JSON.stringify(points);
    const group = groups.get(key) ?? { points, channels: "" };
    group.channels += CHANNELS[channel] as ChannelName;
    groups.set(key, group);
  });
  const list = [...groups.values()];
  return list.length === 0 ? undefined : list.length === 1 ? list[0] : list;
}

/** Whether all three channels hold the same points (or none). */
export function joined(channels: Channels): boolean {
  const [r, g, b] = channels.map((points) => JSON.stringify(points));
  return r === g && g === b;
}
