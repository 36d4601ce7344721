/** What the pointer does in the plot: draw, move points, or scale and shift a stretch. */
import { signal } from "@preact/signals";
import type { Point } from "../protocol";
import { MAX_DEGREES, valueAt, yFraction, type Axes } from "./model/axes";
import { Stroke } from "./model/fit";
import { pointsOf, put, putPoints, type CurveModel } from "./model/model";
import { addPoint, movePoint } from "./model/points";
import { drawOver, scaleOver, shiftOver, type Cloth } from "./model/stretches";

/** A place in the plot. */
export interface Spot {
  degrees: number;
  /** Fraction of the plot's height; may leave 0…1. */
  height: number;
  /** Screen pixels. */
  x: number;
  y: number;
}

/** The selected point, and whether it waits for the click that says where it goes. */
export const picked = signal<{ index: number; carried: boolean } | null>(null);
/** The selected stretch, degrees. */
export const selection = signal<[from: number, to: number] | null>(null);

/** A gesture under way; `model` is always the newest. */
export interface Gesture {
  move(spot: Spot): void;
  up(spot: Spot): void;
}

export interface Hand {
  model: CurveModel;
  axes: Axes;
  channels: number[];
}

const CLICK_PX = 3;

/** Width of a band, degrees: nothing finer is resolved. */
export function bandOf(hand: Hand): number {
  return MAX_DEGREES / hand.model.info.bands;
}

function clothOf({ model, axes }: Hand, channel: number): Cloth {
  const [drawn, ground] = [model.channels[channel] ?? null, model.grounds[channel] ?? []];
  return { drawn, ground, points: pointsOf(model, channel, axes), axes };
}

export function drawGesture(hand: Hand, start: Spot): Gesture {
  const stroke = new Stroke(hand.model.info.bands, hand.axes);
  const cloths = hand.channels.map((c) => clothOf(hand, c));
  const move = (spot: Spot) => {
    stroke.add(spot.degrees, Math.max(0, spot.height));
    put(hand.model, "Draw curve", (c) => drawOver(cloths[hand.channels.indexOf(c)] as Cloth, stroke), hand.channels);
  };
  stroke.add(start.degrees, Math.max(0, start.height));
  return { move, up: () => undefined };
}

function valueOf(hand: Hand, spot: Spot): number {
  return valueAt(hand.axes, Math.max(0, spot.height));
}

/** Drag the point that was hit; or put the carried point here; or add one here. */
export function pointsGesture(hand: Hand, start: Spot, hit: number): Gesture {
  const first = hand.channels[0] ?? 0;
  const carried = picked.value?.carried ? picked.value.index : -1;
  const before = pointsOf(hand.model, first, hand.axes);
  const band = bandOf(hand);
  let base = before;
  let index = hit;
  const write = (points: Point[], label: string) => putPoints(hand.model, label, before, points, hand.channels);
  if (hit < 0 && carried >= 0) {
    index = carried;
    write(movePoint(base, index, start.degrees, valueOf(hand, start), band), "Move point");
  } else if (hit < 0) {
    ({ points: base, index } = addPoint(base, start.degrees, valueOf(hand, start), band));
    if (index >= 0) write(base, "Add point");
  }
  if (hit < 0) picked.value = index < 0 ? null : { index, carried: false };
  const from = base[index];
  const [dx, dy] =
    from === undefined ? [0, 0] : [from[0] - start.degrees, yFraction(hand.axes, from[1]) - start.height];
  let moved = false;
  return {
    move(spot) {
      if (index < 0 || (!moved && Math.hypot(spot.x - start.x, spot.y - start.y) < CLICK_PX)) return;
      moved = true;
      // a hit point keeps its distance to the pointer, so taking hold of it does not move it
      const [ox, oy] = hit >= 0 ? [dx, dy] : [0, 0];
      const value = valueAt(hand.axes, Math.max(0, spot.height + oy));
      write(movePoint(base, index, spot.degrees + ox, value, band), "Move point");
      picked.value = { index, carried: false };
    },
    up() {
      if (hit < 0 || moved) return;
      const again = picked.value?.index === hit && picked.value.carried;
      picked.value = { index: hit, carried: !again };
    },
  };
}

export function applyScale(hand: Hand, [from, to]: [number, number], factor: number): void {
  put(hand.model, "Scale stretch", (c) => scaleOver(clothOf(hand, c), from, to, factor), hand.channels);
}

export function applyShift(hand: Hand, [from, to]: [number, number], degrees: number): [number, number] {
  const shift = Math.min(MAX_DEGREES - to, Math.max(-from, degrees));
  put(hand.model, "Shift stretch", (c) => shiftOver(clothOf(hand, c), from, to, shift), hand.channels);
  return [from + shift, to + shift];
}

/** Outside the selection: select. Inside: up and down scale, left and right shift, whichever the hand begins with. */
export function stretchGesture(hand: Hand, start: Spot): Gesture {
  const chosen = selection.value;
  if (chosen === null || start.degrees < chosen[0] || start.degrees > chosen[1]) return selectGesture(start);
  let way: "scale" | "shift" | null = null;
  return {
    move(spot) {
      const [dx, dy] = [spot.x - start.x, spot.y - start.y];
      if (way === null && Math.hypot(dx, dy) >= CLICK_PX) way = Math.abs(dx) > Math.abs(dy) ? "shift" : "scale";
      if (way === "scale") applyScale(hand, chosen, 2 ** (-dy / 50));
      if (way === "shift") selection.value = applyShift(hand, chosen, spot.degrees - start.degrees);
    },
    up() {
      if (way === null) selection.value = null;
    },
  };
}

function selectGesture(start: Spot): Gesture {
  selection.value = null;
  return {
    move(spot) {
      const [a, b] = [Math.min(start.degrees, spot.degrees), Math.max(start.degrees, spot.degrees)];
      if (b - a > 0.1) selection.value = [Number(a.toFixed(2)), Number(b.toFixed(2))];
    },
    up: () => undefined,
  };
}
