/** The open curve as the editor shows it, channel by channel, and how to change it. Moving points bends the curve
 * instead of replacing it (docs/direct-light.md#curves-as-bands). */
import { editValue } from "../../edit/edit";
import type { CurveBody, CurveEdits, CurveMessage, Handle, Point } from "../../protocol";
import { niceTop, type CurveAxes } from "./axes";
import { joinChannels, readChannels, writeChannels, type Channels, type DrawnChannels } from "./channels";
import { applyLayer, bandsLayer, layerOf, applyPull, sampleBands } from "./edits";
import { bandSamples, fitPoints, knotSamples, outlinePoints, roundValue } from "./fit";
import { averageBands } from "./pchip";

export interface CurveModel {
  path: string;
  info: CurveBody;
  channels: Channels;
  /** Band values per channel: the curve under the edits, and the displayed one. Null until the server has sent the
   * generated curve, if it is needed. */
  baselines: (number[] | null)[];
  curves: (number[] | null)[];
  /** Displayed curves: samples per channel. */
  lines: Point[][];
  /** The generated curves, as bands and as samples; null until the server has sent them. */
  generated: number[][] | null;
  generatedLines: Point[][] | null;
  /** True if red, green and blue share one curve. */
  areJoined: boolean;
}

/** Differences below this come from the server's rounding to six digits. */
const ROUNDING = 1e-5;

function isNearby(a: number, b: number): boolean {
  return Math.abs(a - b) <= ROUNDING * Math.abs(a);
}

function areAlike([r, g, b]: readonly (number[] | null)[]): boolean {
  const same = (c: number[] | null | undefined) => !!r && !!c && r.every((v, i) => isNearby(v, c[i] ?? 0));
  return same(g) && same(b);
}

function baselineOf(drawn: DrawnChannels | null, generated: number[] | null, numBands: number): number[] | null {
  if (drawn?.points !== undefined) return averageBands(drawn.points, numBands);
  return (drawn?.bands as number[] | undefined) ?? generated;
}

/** A curve from the look and the server. Points just moved are drawn before the server answers. */
export function curveModel(
  path: string,
  info: CurveBody,
  edits: CurveEdits | undefined,
  shape: CurveMessage | null,
): CurveModel {
  const channels = readChannels(edits, info.bands);
  const baselines = channels.map((drawn, c) => baselineOf(drawn, shape?.generated[c] ?? null, info.bands));
  const curves = baselines.map(
    (baseline, c) => baseline && applyLayer(layerOf(channels[c] ?? null, baseline), baseline),
  );
  const lines = curves.map((bands) => (bands === null ? [] : bandSamples(bands)));
  const generated = shape?.generated ?? null;
  const generatedLines = generated?.map((bands) => bandSamples(bands)) ?? null;
  const areJoined = joinChannels(channels) && areAlike(curves);
  return { path, info, channels, baselines, curves, lines, generated, generatedLines, areJoined };
}

export function largestValue(model: CurveModel): number {
  let largest = 0;
  for (const line of [...model.lines, ...(model.generatedLines ?? [])]) {
    for (const [, value] of line) largest = Math.max(largest, value);
  }
  return largest;
}

/** The curve that a channel's handles change. */
function unpulledValue(model: CurveModel, channel: number): number[] | null {
  const baseline = model.baselines[channel] ?? null;
  return baseline && applyLayer(bandsLayer(model.channels[channel] ?? null, baseline.length), baseline);
}

/** The current value under a handle: parameters may have changed it since. */
function pullRange(model: CurveModel, channel: number, [degrees, was]: Handle): number {
  const { points, bands } = model.channels[channel] ?? {};
  const below = unpulledValue(model, channel);
  if (points !== undefined || bands !== undefined || below === null) return was;
  const value = roundValue(sampleBands(below, degrees));
  return isNearby(value, was) ? was : value;
}

function pointAt(model: CurveModel, channel: number, handle: Handle): Point {
  const foot = pullRange(model, channel, handle);
  return [handle[0], foot === handle[1] ? handle[2] : roundValue(applyPull(handle, foot))];
}

/** The editable points: moved or placed ones, or else points fitted to the curve. */
export function pointsOf(model: CurveModel, channel: number, axes: CurveAxes): Point[] {
  const drawn = model.channels[channel] ?? null;
  if (drawn?.handles !== undefined) return drawn.handles.map((handle) => pointAt(model, channel, handle));
  if (drawn?.points !== undefined) return drawn.points;
  const bands = model.curves[channel] ?? [];
  const top = niceTop(Math.max(0, ...bands), axes.log);
  return outlinePoints(fitPoints(knotSamples(bands), { ...axes, top }), bands);
}

/** The curve bent through the points `after`. Points also in `original` are fixed: between two fixed neighbors
 * nothing changes. */
export function bendCurve(
  model: CurveModel,
  channel: number,
  original: readonly Point[],
  after: readonly Point[],
): DrawnChannels {
  const drawn = model.channels[channel] ?? {};
  const handles0 = original.map(([x, y], i): Handle => drawn.handles?.[i] ?? [x, y, y]);
  const below = unpulledValue(model, channel) ?? [];
  const handles = after.map((point): Handle => {
    const storedHandle = handles0[original.indexOf(point)];
    if (storedHandle !== undefined) return storedHandle;
    const handleAtAngle = handles0.find(([x]) => x === point[0]);
    const foot = handleAtAngle ? pullRange(model, channel, handleAtAngle) : roundValue(sampleBands(below, point[0]));
    return [point[0], foot, point[1]];
  });
  return { ...drawn, handles };
}

/** A channel's edits in a form that gives the same curve to any channel. */
export function copyCurve(model: CurveModel, channel: number, axes: CurveAxes): DrawnChannels | null {
  const drawn = model.channels[channel] ?? null;
  const hasOwnBaseline = drawn?.points !== undefined || drawn?.bands !== undefined;
  if (hasOwnBaseline || areAlike(model.generated ?? [])) return drawn;
  const handles = pointsOf(model, channel, axes).map(([x, y]): Handle => [x, y, y]);
  return { factors: Array<number>(model.info.bands).fill(0), offsets: model.curves[channel] ?? [], handles };
}

/** Write the edits of some channels; null resets a channel to its generated curve. */
export function applyChannels(
  model: CurveModel,
  label: string,
  next: (channel: number) => DrawnChannels | null,
  channels: number[],
): void {
  const changed = model.channels.map((drawn, c) => (channels.includes(c) ? next(c) : drawn)) as unknown as Channels;
  editValue(label, model.path, writeChannels(changed));
}

/** Move, add or remove points of channels that share `original`. */
export function applyPoints(
  model: CurveModel,
  label: string,
  original: readonly Point[],
  after: readonly Point[],
  channels: number[],
): void {
  applyChannels(model, label, (c) => bendCurve(model, c, original, after), channels);
}
