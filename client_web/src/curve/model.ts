/** The open curve as the editor shows it: the look's points, the server's bands, and how to change them. */
import type { CurveEdits, CurveBody, CurveMessage, Point } from "../protocol";
import { edit } from "../state/edit";
import { niceTop, type Axes } from "./axes";
import { joined, readChannels, writeChannels, type Channels } from "./channels";
import { bandSamples, fitPoints } from "./fit";
import { pchip } from "./pchip";

export interface CurveModel {
  path: string;
  info: CurveBody;
  channels: Channels;
  /** Curves to draw: samples per channel. */
  lines: Point[][];
  /** The generator's own curves; null until the server has sent them. */
  ghosts: Point[][] | null;
  /** Whether red, green and blue are one curve. */
  together: boolean;
}

const SAMPLES = 181;

function sampled(points: Point[]): Point[] {
  const curve = pchip(points);
  const xs = new Set([
    ...Array.from({ length: SAMPLES }, (_, i) => 90 * (i / (SAMPLES - 1)) ** 2),
    ...points.map((p) => p[0]),
  ]);
  return [...xs].sort((a, b) => a - b).map((x) => [x, curve(x)]);
}

function same(a: readonly number[] | undefined, b: readonly number[] | undefined): boolean {
  return a !== undefined && b !== undefined && a.every((v, i) => Math.abs(v - (b[i] ?? 0)) <= 1e-6 * Math.abs(v));
}

/** What the look and the server say about a curve. Points that were just moved are drawn before the server answers. */
export function curveModel(
  path: string,
  info: CurveBody,
  edits: CurveEdits | undefined,
  shape: CurveMessage | null,
): CurveModel {
  const channels = readChannels(edits, info.bands);
  const ghosts = shape?.generated.map((bands) => bandSamples(bands)) ?? null;
  const lines = channels.map((points, c) => (points === null ? (ghosts?.[c] ?? []) : sampled(points)));
  const generated = shape?.generated;
  const alike = same(generated?.[0], generated?.[1]) && same(generated?.[1], generated?.[2]);
  return { path, info, channels, lines, ghosts, together: joined(channels) && (channels[0] !== null || alike) };
}

export function largestValue(model: CurveModel): number {
  let largest = 0;
  for (const line of [...model.lines, ...(model.ghosts ?? [])]) {
    for (const [, value] of line) largest = Math.max(largest, value);
  }
  return largest;
}

/** A channel's points; where it is the generator's, points that follow it. */
export function pointsOf(model: CurveModel, channel: number, axes: Axes): Point[] {
  const points = model.channels[channel] ?? null;
  if (points !== null) return points;
  const ghost = model.ghosts?.[channel] ?? [];
  const top = niceTop(Math.max(0, ...ghost.map((p) => p[1])), axes.log);
  return fitPoints(ghost, { ...axes, top });
}

/** Write new points for some channels; null gives a channel back to its generator. */
export function put(
  model: CurveModel,
  label: string,
  next: (channel: number) => Point[] | null,
  channels: number[],
): void {
  const changed = model.channels.map((points, c) => (channels.includes(c) ? next(c) : points)) as unknown as Channels;
  edit(label, model.path, writeChannels(changed));
}
