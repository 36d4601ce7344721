/** The open curve as the editor shows it, channel by channel, and how to change it. What is not changed stays as it is:
 * points that are moved bend the curve, they do not replace it (docs/adr/0029). */
import { edit } from "../../edit/edit";
import type { CurveBody, CurveEdits, CurveMessage, Handle, Point } from "../../protocol";
import { niceTop, type Axes } from "./axes";
import { joined, readChannels, writeChannels, type Channels, type Drawn } from "./channels";
import { applied, bandsLayer, layerOf, pulled, valueOn } from "./edited";
import { bandSamples, fitPoints, knotSamples, outlineOf, tidyValue } from "./fit";
import { bandsOfPoints } from "./pchip";

export interface CurveModel {
  path: string;
  info: CurveBody;
  channels: Channels;
  /** Band values per channel: what edits stand on, and what is displayed. Null until the server has sent the
   * generator's own curve, where that is needed. */
  grounds: (number[] | null)[];
  curves: (number[] | null)[];
  /** Curves to draw: samples per channel. */
  lines: Point[][];
  /** The generator's own curves, as bands and to draw; null until the server has sent them. */
  generated: number[][] | null;
  ghosts: Point[][] | null;
  /** Whether red, green and blue are one curve. */
  together: boolean;
}

/** Of a difference as small as this, the server's six digits are the reason. */
const ROUNDING = 1e-5;

function near(a: number, b: number): boolean {
  return Math.abs(a - b) <= ROUNDING * Math.abs(a);
}

function alike([r, g, b]: readonly (number[] | null)[]): boolean {
  const same = (c: number[] | null | undefined) => !!r && !!c && r.every((v, i) => near(v, c[i] ?? 0));
  return same(g) && same(b);
}

function groundOf(drawn: Drawn | null, generated: number[] | null, numBands: number): number[] | null {
  if (drawn?.points !== undefined) return bandsOfPoints(drawn.points, numBands);
  return (drawn?.bands as number[] | undefined) ?? generated;
}

/** What the look and the server say about a curve. Points that were just moved are drawn before the server answers. */
export function curveModel(
  path: string,
  info: CurveBody,
  edits: CurveEdits | undefined,
  shape: CurveMessage | null,
): CurveModel {
  const channels = readChannels(edits, info.bands);
  const grounds = channels.map((drawn, c) => groundOf(drawn, shape?.generated[c] ?? null, info.bands));
  const curves = grounds.map((ground, c) => ground && applied(layerOf(channels[c] ?? null, ground), ground));
  const lines = curves.map((bands) => (bands === null ? [] : bandSamples(bands)));
  const generated = shape?.generated ?? null;
  const ghosts = generated?.map((bands) => bandSamples(bands)) ?? null;
  const together = joined(channels) && alike(curves);
  return { path, info, channels, grounds, curves, lines, generated, ghosts, together };
}

export function largestValue(model: CurveModel): number {
  let largest = 0;
  for (const line of [...model.lines, ...(model.ghosts ?? [])]) {
    for (const [, value] of line) largest = Math.max(largest, value);
  }
  return largest;
}

/** What a channel's handles stand on. */
function unbent(model: CurveModel, channel: number): number[] | null {
  const ground = model.grounds[channel] ?? null;
  return ground && applied(bandsLayer(model.channels[channel] ?? null, ground.length), ground);
}

/** The value under a handle as it is now: parameters may have moved it since. */
function footOf(model: CurveModel, channel: number, [degrees, was]: Handle): number {
  const { points, bands } = model.channels[channel] ?? {};
  const below = unbent(model, channel);
  if (points !== undefined || bands !== undefined || below === null) return was;
  const value = tidyValue(valueOn(below, degrees));
  return near(value, was) ? was : value;
}

function pointAt(model: CurveModel, channel: number, handle: Handle): Point {
  const foot = footOf(model, channel, handle);
  return [handle[0], foot === handle[1] ? handle[2] : tidyValue(pulled(handle, foot))];
}

/** The points to take hold of: those that a hand has moved or placed; before that, some that outline the curve. */
export function pointsOf(model: CurveModel, channel: number, axes: Axes): Point[] {
  const drawn = model.channels[channel] ?? null;
  if (drawn?.handles !== undefined) return drawn.handles.map((handle) => pointAt(model, channel, handle));
  if (drawn?.points !== undefined) return drawn.points;
  const bands = model.curves[channel] ?? [];
  const top = niceTop(Math.max(0, ...bands), axes.log);
  return outlineOf(fitPoints(knotSamples(bands), { ...axes, top }), bands);
}

/** The curve bent to go through `after`. Points that stand in `before` too are held as they were: where both
 * neighbours are, nothing changes. */
export function bentCurve(
  model: CurveModel,
  channel: number,
  before: readonly Point[],
  after: readonly Point[],
): Drawn {
  const drawn = model.channels[channel] ?? {};
  const held = before.map(([x, y], i): Handle => drawn.handles?.[i] ?? [x, y, y]);
  const below = unbent(model, channel) ?? [];
  const handles = after.map((point): Handle => {
    const kept = held[before.indexOf(point)];
    if (kept !== undefined) return kept;
    const there = held.find(([x]) => x === point[0]);
    const foot = there ? footOf(model, channel, there) : tidyValue(valueOn(below, point[0]));
    return [point[0], foot, point[1]];
  });
  return { ...drawn, handles };
}

/** What is drawn of a channel, so that it gives the same curve to any. */
export function copyOf(model: CurveModel, channel: number, axes: Axes): Drawn | null {
  const drawn = model.channels[channel] ?? null;
  const hasOwnGround = drawn?.points !== undefined || drawn?.bands !== undefined;
  if (hasOwnGround || alike(model.generated ?? [])) return drawn;
  const handles = pointsOf(model, channel, axes).map(([x, y]): Handle => [x, y, y]);
  return { factors: Array<number>(model.info.bands).fill(0), offsets: model.curves[channel] ?? [], handles };
}

/** Write what is drawn of some channels; null gives a channel back to its generator. */
export function put(
  model: CurveModel,
  label: string,
  next: (channel: number) => Drawn | null,
  channels: number[],
): void {
  const changed = model.channels.map((drawn, c) => (channels.includes(c) ? next(c) : drawn)) as unknown as Channels;
  edit(label, model.path, writeChannels(changed));
}

/** Move, add or remove points of some channels, which have `before` in common. */
export function putPoints(
  model: CurveModel,
  label: string,
  before: readonly Point[],
  after: readonly Point[],
  channels: number[],
): void {
  put(model, label, (c) => bentCurve(model, c, before, after), channels);
}
