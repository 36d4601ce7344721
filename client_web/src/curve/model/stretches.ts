/** Changes to a stretch of a curve, band by band: outside it nothing changes. Points come along as they are then. */
import { MAX_CURVE_VALUE } from "../../look.gen";
import type { Point } from "../../protocol";
import { MAX_DEGREES, valueAt, type Axes } from "./axes";
import type { Drawn } from "./channels";
import { applied, layerOf, valueOn, type Layer } from "./edited";
import { fitPoints, knotSamples, MAX_POINTS, outlineOf, tidyPoint, tidyValue, type Stroke } from "./fit";

/** What a stretch is cut out of: what is drawn of a channel, what that stands on, its points, and the plot's axes. */
export interface Cloth {
  drawn: Drawn | null;
  ground: number[];
  points: readonly Point[];
  axes: Axes;
}

/** Of what a document keeps of factors. */
const DIGITS = 9;

/** First and last band whose middle lies in a stretch; the last is before the first where there is none. */
export function bandsWithin(from: number, to: number, numBands: number): [first: number, last: number] {
  const place = (degrees: number) => (degrees / MAX_DEGREES) * numBands - 0.5;
  return [Math.max(0, Math.ceil(place(from) - 1e-9)), Math.min(numBands - 1, Math.floor(place(to) + 1e-9))];
}

/** Numbers of a layer as a document keeps them; undefined where they do nothing. */
function kept(numbers: readonly number[], plain: number): number[] | undefined {
  const tidy = numbers.map((v) => Math.min(MAX_CURVE_VALUE, Number(v.toPrecision(DIGITS))));
  return tidy.every((v) => v === plain) ? undefined : tidy;
}

const ENDS: readonly Point[] = [
  [0, 0],
  [MAX_DEGREES, 0],
];

/** The layer as part of a document, with handles that pull nothing at the angles of points. */
function drawnWith({ drawn, ground }: Cloth, layer: Layer, points: readonly Point[]): Drawn {
  const apart = outlineOf(points.length < 2 ? ENDS : points, applied(layer, ground));
  const [factors, offsets] = [kept(layer.factors, 1), kept(layer.offsets, 0)];
  return {
    ...(drawn?.points && { points: drawn.points }),
    ...(drawn?.bands && { bands: drawn.bands }),
    ...(factors && { factors }),
    ...(offsets && { offsets }),
    handles: apart.filter(([x], i) => i === 0 || x > (apart[i - 1] as Point)[0]).map(([x, y]) => [x, y, y]),
  };
}

/** `layer` with the bands from `first` on at these values, whatever they stand on. */
function withValues({ factors, offsets }: Layer, first: number, values: readonly number[]): Layer {
  const within = (j: number) => j >= first && j < first + values.length;
  return {
    factors: factors.map((factor, j) => (within(j) ? 0 : factor)),
    offsets: offsets.map((offset, j) => (within(j) ? tidyValue(values[j - first] as number) : offset)),
  };
}

/** Lay a freehand stroke over the curve: the bands it covers take its values, with points of their own. */
export function drawOver(cloth: Cloth, stroke: Stroke): Drawn | null {
  const range = stroke.range();
  if (range === null) return cloth.drawn;
  const { ground, axes } = cloth;
  const values = stroke.heights().map((height) => valueAt(axes, Math.max(0, height)));
  const layer = withValues(layerOf(cloth.drawn, ground), range[0], values);
  const samples = knotSamples(applied(layer, ground)).slice(range[0], range[1] + 1);
  const fitted = fitPoints(samples, axes, Math.min(MAX_POINTS / 2, Math.round(5 + 24 * stroke.share())));
  const band = MAX_DEGREES / ground.length;
  const [from, to] = [range[0] * band - band / 2, (range[1] + 1) * band + band / 2];
  const points = [...cloth.points.filter(([x]) => x < from || x > to), ...fitted].sort((a, b) => a[0] - b[0]);
  return drawnWith(cloth, layer, points.length <= MAX_POINTS ? points : fitPoints(points, axes, MAX_POINTS));
}

/** Points with one at each end of a stretch. */
function fenced(points: readonly Point[], from: number, to: number, band: number): Point[] {
  const hasRoom = points.length < MAX_POINTS - 1;
  const ends = [from, to].filter((end) => hasRoom && points.every(([x]) => Math.abs(x - end) >= band));
  return [...points, ...ends.map((x) => tidyPoint(x, 0))].sort((a, b) => a[0] - b[0]);
}

/** Multiply a stretch. */
export function scaleOver(cloth: Cloth, from: number, to: number, factor: number): Drawn {
  const { ground, points } = cloth;
  const layer = layerOf(cloth.drawn, ground);
  const values = applied(layer, ground);
  const [first, last] = bandsWithin(from, to, ground.length);
  // no value leaves what documents may hold
  const by = (j: number) => (j < first || j > last ? 1 : Math.min(factor, MAX_CURVE_VALUE / (values[j] as number)));
  const scaled = { factors: layer.factors.map((v, j) => v * by(j)), offsets: layer.offsets.map((v, j) => v * by(j)) };
  return drawnWith(cloth, scaled, fenced(points, from, to, MAX_DEGREES / ground.length));
}

/** Move a stretch along the angle. What it lays bare goes on at the value where it was torn off. */
export function shiftOver(cloth: Cloth, from: number, to: number, degrees: number): Drawn {
  const { ground, points } = cloth;
  const layer = layerOf(cloth.drawn, ground);
  const values = applied(layer, ground);
  const band = MAX_DEGREES / ground.length;
  const [first, last] = bandsWithin(Math.min(from, from + degrees), Math.max(to, to + degrees), ground.length);
  const moved = Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => {
    const origin = (first + i + 0.5) * band - degrees;
    return valueOn(values, Math.min(to, Math.max(from, origin)));
  });
  const all = fenced(points, from, to, band);
  const inside = ([x]: Point) => x >= from - band / 2 && x <= to + band / 2;
  const shifted = all.filter(inside).map(([x]) => tidyPoint(Math.min(MAX_DEGREES, Math.max(0, x + degrees)), 0));
  const [low, high] = [from + degrees - band, to + degrees + band];
  const kept = all.filter((p) => !inside(p) && (p[0] < low || p[0] > high));
  const knots = [...kept, ...shifted].sort((a, b) => a[0] - b[0]);
  return drawnWith(cloth, withValues(layer, first, moved), knots);
}
