/** A curve's edits: from the look to channels, and back in the shortest form. */
import type { CurveEdits, DrawnCurve } from "../../protocol";

export type ChannelName = "r" | "g" | "b";
export const CHANNELS: readonly ChannelName[] = ["r", "g", "b"];
/** The edits of one channel: `bands`, `factors` and `offsets` are its own J numbers. */
export type DrawnChannels = Omit<DrawnCurve, "channels">;
/** Null if the model generates the curve. */
export type Channels = readonly [DrawnChannels | null, DrawnChannels | null, DrawnChannels | null];
export type ActiveChannels = "rgb" | ChannelName;

const CHANNELS_OF: Record<ActiveChannels, number[]> = { rgb: [0, 1, 2], r: [0], g: [1], b: [2] };

export function channelsOf(active: ActiveChannels): number[] {
  return CHANNELS_OF[active];
}

/** A channel's J numbers, from J numbers for all channels, 3 · J flat, or three lists of J. */
function rowOf(rows: number[] | number[][], channel: number, numBands: number): number[] {
  if (Array.isArray(rows[0])) return (rows as number[][])[channel] ?? [];
  const flat = rows as number[];
  return flat.length === 3 * numBands ? flat.slice(channel * numBands, (channel + 1) * numBands) : flat;
}

function drawnOf(
  { points, bands, factors, offsets, handles }: DrawnCurve,
  channel: number,
  num: number,
): DrawnChannels {
  return {
    ...(points && { points }),
    ...(bands && { bands: rowOf(bands, channel, num) }),
    ...(factors && { factors: rowOf(factors, channel, num) }),
    ...(offsets && { offsets: rowOf(offsets, channel, num) }),
    ...(handles && { handles }),
  };
}

export function readChannels(edits: CurveEdits | undefined, numBands: number): Channels {
  const result: [DrawnChannels | null, DrawnChannels | null, DrawnChannels | null] = [null, null, null];
  const list = edits === undefined ? [] : Array.isArray(edits) ? edits : [edits];
  for (const override of list) {
    CHANNELS.forEach((name, channel) => {
      if ((override.channels ?? "rgb").includes(name)) result[channel] = drawnOf(override, channel, numBands);
    });
  }
  return result;
}

/** Channels with equal edits share one object; undefined without edits. */
export function writeChannels(channels: Channels): CurveEdits | undefined {
  const groups = new Map<string, DrawnCurve & { channels: string }>();
  channels.forEach((drawn, channel) => {
    if (drawn === null) return;
    const key = JSON.stringify(drawn);
    const group = groups.get(key) ?? { ...drawn, channels: "" };
    group.channels += CHANNELS[channel] as ChannelName;
    groups.set(key, group);
  });
  const list = [...groups.values()];
  return list.length === 0 ? undefined : list.length === 1 ? list[0] : list;
}

/** True if all three channels have the same edits, or none. */
export function joinChannels(channels: Channels): boolean {
  const [r, g, b] = channels.map((drawn) => JSON.stringify(drawn));
  return r === g && g === b;
}
