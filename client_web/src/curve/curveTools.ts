/** Pointer tools of the plot: draw, move points, or scale and move an interval. */
import { signal } from "@preact/signals";
import type { Point } from "../protocol";
import { MAX_DEGREES, valueAt, yFraction, type CurveAxes } from "./model/axes";
import { BrushStroke } from "./model/fit";
import { pointsOf, applyChannels, applyPoints, type CurveModel } from "./model/model";
import { addPoint, movePoint } from "./model/points";
import { drawInterval, scaleInterval, shiftInterval, type EditBase } from "./model/intervalEdits";

/** A point in the plot. */
export interface PlotSpot {
  degrees: number;
  /** Fraction of the plot's height; may lie outside 0…1. */
  height: number;
  /** Screen pixels. */
  x: number;
  y: number;
}

/** The selected point; `carried`: the next click places it. */
export const pickedPoint = signal<{ index: number; carried: boolean } | null>(null);
/** The selected interval, degrees. */
export const selectedInterval = signal<[from: number, to: number] | null>(null);

/** The gesture in progress; `model` is always the newest. */
export interface PlotGesture {
  move: (spot: PlotSpot) => void;
  up: (spot: PlotSpot) => void;
}

export interface CurveContext {
  model: CurveModel;
  axes: CurveAxes;
  channels: number[];
}

const CLICK_PX = 3;

/** Width of a band in degrees, the resolution of a curve. */
export function bandOf(context: CurveContext): number {
  return MAX_DEGREES / context.model.info.bands;
}

function editBaseOf({ model, axes }: CurveContext, channel: number): EditBase {
  const [drawn, ground] = [model.channels[channel] ?? null, model.baselines[channel] ?? []];
  return { curve: drawn, baseline: ground, points: pointsOf(model, channel, axes), axes };
}

export function drawGesture(context: CurveContext, start: PlotSpot): PlotGesture {
  const stroke = new BrushStroke(context.model.info.bands, context.axes);
  const bases = context.channels.map((c) => editBaseOf(context, c));
  const move = (spot: PlotSpot) => {
    stroke.add(spot.degrees, Math.max(0, spot.height));
    applyChannels(context.model, "Draw curve", (c) => drawInterval(bases[context.channels.indexOf(c)] as EditBase, stroke), context.channels);
  };
  stroke.add(start.degrees, Math.max(0, start.height));
  return { move, up: () => undefined };
}

function valueOf(context: CurveContext, spot: PlotSpot): number {
  return valueAt(context.axes, Math.max(0, spot.height));
}

/** Drag the point under the pointer, place the carried point, or add a point. */
export function pointsGesture(context: CurveContext, start: PlotSpot, hit: number): PlotGesture {
  const first = context.channels[0] ?? 0;
  const draggedPoints = pickedPoint.value?.carried ? pickedPoint.value.index : -1;
  const original = pointsOf(context.model, first, context.axes);
  const band = bandOf(context);
  let base = original;
  let index = hit;
  const write = (points: Point[], label: string) => applyPoints(context.model, label, original, points, context.channels);
  if (hit < 0 && draggedPoints >= 0) {
    index = draggedPoints;
    write(movePoint(base, index, start.degrees, valueOf(context, start), band), "Move point");
  } else if (hit < 0) {
    ({ points: base, index } = addPoint(base, start.degrees, valueOf(context, start), band));
    if (index >= 0) write(base, "Add point");
  }
  if (hit < 0) pickedPoint.value = index < 0 ? null : { index, carried: false };
  const from = base[index];
  const [dx, dy] =
    from === undefined ? [0, 0] : [from[0] - start.degrees, yFraction(context.axes, from[1]) - start.height];
  let moved = false;
  return {
    move(spot) {
      if (index < 0 || (!moved && Math.hypot(spot.x - start.x, spot.y - start.y) < CLICK_PX)) return;
      moved = true;
      // a dragged point keeps its offset from the pointer, so pressing does not move it
      const [ox, oy] = hit >= 0 ? [dx, dy] : [0, 0];
      const value = valueAt(context.axes, Math.max(0, spot.height + oy));
      write(movePoint(base, index, spot.degrees + ox, value, band), "Move point");
      pickedPoint.value = { index, carried: false };
    },
    up() {
      if (hit < 0 || moved) return;
      const refitted = pickedPoint.value?.index === hit && pickedPoint.value.carried;
      pickedPoint.value = { index: hit, carried: !refitted };
    },
  };
}

export function applyScale(context: CurveContext, [from, to]: [number, number], factor: number): void {
  applyChannels(context.model, "Scale range", (c) => scaleInterval(editBaseOf(context, c), from, to, factor), context.channels);
}

export function applyShift(context: CurveContext, [from, to]: [number, number], degrees: number): [number, number] {
  const shift = Math.min(MAX_DEGREES - to, Math.max(-from, degrees));
  applyChannels(context.model, "Move range", (c) => shiftInterval(editBaseOf(context, c), from, to, shift), context.channels);
  return [from + shift, to + shift];
}

/** Outside the selection: select. Inside: a vertical drag scales, a horizontal one moves; its start decides. */
export function intervalGesture(context: CurveContext, start: PlotSpot): PlotGesture {
  const interval = selectedInterval.value;
  if (interval === null || start.degrees < interval[0] || start.degrees > interval[1]) return selectGesture(start);
  let action: "scale" | "shift" | null = null;
  return {
    move(spot) {
      const [dx, dy] = [spot.x - start.x, spot.y - start.y];
      if (action === null && Math.hypot(dx, dy) >= CLICK_PX) action = Math.abs(dx) > Math.abs(dy) ? "shift" : "scale";
      if (action === "scale") applyScale(context, interval, 2 ** (-dy / 50));
      if (action === "shift") selectedInterval.value = applyShift(context, interval, spot.degrees - start.degrees);
    },
    up() {
      if (action === null) selectedInterval.value = null;
    },
  };
}

function selectGesture(start: PlotSpot): PlotGesture {
  selectedInterval.value = null;
  return {
    move(spot) {
      const [a, b] = [Math.min(start.degrees, spot.degrees), Math.max(start.degrees, spot.degrees)];
      if (b - a > 0.1) selectedInterval.value = [Number(a.toFixed(2)), Number(b.toFixed(2))];
    },
    up: () => undefined,
  };
}
