/** Changes to an interval of a curve, band by band; outside it nothing changes. Points in it follow the curve. */
import { MAX_CURVE_VALUE } from "../../look.gen";
import type { Point } from "../../protocol";
import { MAX_DEGREES, valueAt, type CurveAxes } from "./axes";
import type { DrawnChannels } from "./channels";
import { applyLayer, layerOf, sampleBands, type CurveLayer } from "./edits";
import { fitPoints, knotSamples, MAX_POINTS, outlinePoints, roundPoint, roundValue, type BrushStroke } from "./fit";

/** Input of an interval edit: a channel's edits, the curve that they change, its points, and the plot's axes. */
export interface EditBase {
  curve: DrawnChannels | null;
  baseline: number[];
  points: readonly Point[];
  axes: CurveAxes;
}

/** Precision of stored factors. */
const DIGITS = 9;

/** First and last band with its center in an interval; the last precedes the first if there is none. */
export function bandsWithin(from: number, to: number, numBands: number): [first: number, last: number] {
  const bandPosition = (degrees: number) => (degrees / MAX_DEGREES) * numBands - 0.5;
  return [
    Math.max(0, Math.ceil(bandPosition(from) - 1e-9)),
    Math.min(numBands - 1, Math.floor(bandPosition(to) + 1e-9)),
  ];
}

/** Numbers of an edit layer as the look stores them; undefined if they change nothing. */
function roundNumbers(numbers: readonly number[], plain: number): number[] | undefined {
  const tidy = numbers.map((v) => Math.min(MAX_CURVE_VALUE, Number(v.toPrecision(DIGITS))));
  return tidy.every((v) => v === plain) ? undefined : tidy;
}

const ENDS: readonly Point[] = [
  [0, 0],
  [MAX_DEGREES, 0],
];

/** The layer as part of a document, with neutral handles at the points' angles. */
function rebuildCurve({ curve, baseline }: EditBase, layer: CurveLayer, points: readonly Point[]): DrawnChannels {
  const outline = outlinePoints(points.length < 2 ? ENDS : points, applyLayer(layer, baseline));
  const [factors, offsets] = [roundNumbers(layer.factors, 1), roundNumbers(layer.offsets, 0)];
  return {
    ...(curve?.points && { points: curve.points }),
    ...(curve?.bands && { bands: curve.bands }),
    ...(factors && { factors }),
    ...(offsets && { offsets }),
    handles: outline.filter(([x], i) => i === 0 || x > (outline[i - 1] as Point)[0]).map(([x, y]) => [x, y, y]),
  };
}

/** `layer` with the bands from `first` on set to these values. */
function layerWithValues({ factors, offsets }: CurveLayer, first: number, values: readonly number[]): CurveLayer {
  const within = (j: number) => j >= first && j < first + values.length;
  return {
    factors: factors.map((factor, j) => (within(j) ? 0 : factor)),
    offsets: offsets.map((offset, j) => (within(j) ? roundValue(values[j - first] as number) : offset)),
  };
}

/** Apply a freehand stroke: the covered bands take its values and get points of their own. */
export function drawInterval(base: EditBase, stroke: BrushStroke): DrawnChannels | null {
  const range = stroke.range();
  if (range === null) return base.curve;
  const { baseline, axes } = base;
  const values = stroke.heights().map((height) => valueAt(axes, Math.max(0, height)));
  const layer = layerWithValues(layerOf(base.curve, baseline), range[0], values);
  const samples = knotSamples(applyLayer(layer, baseline)).slice(range[0], range[1] + 1);
  const fitted = fitPoints(samples, axes, Math.min(MAX_POINTS / 2, Math.round(5 + 24 * stroke.mergeAxes())));
  const band = MAX_DEGREES / baseline.length;
  const [from, to] = [range[0] * band - band / 2, (range[1] + 1) * band + band / 2];
  const points = [...base.points.filter(([x]) => x < from || x > to), ...fitted].sort((a, b) => a[0] - b[0]);
  return rebuildCurve(base, layer, points.length <= MAX_POINTS ? points : fitPoints(points, axes, MAX_POINTS));
}

/** The points, plus one at each end of an interval. */
function addIntervalEnds(points: readonly Point[], from: number, to: number, band: number): Point[] {
  const hasRoom = points.length < MAX_POINTS - 1;
  const ends = [from, to].filter((end) => hasRoom && points.every(([x]) => Math.abs(x - end) >= band));
  return [...points, ...ends.map((x) => roundPoint(x, 0))].sort((a, b) => a[0] - b[0]);
}

/** Scale an interval. */
export function scaleInterval(base: EditBase, from: number, to: number, factor: number): DrawnChannels {
  const { baseline, points } = base;
  const layer = layerOf(base.curve, baseline);
  const values = applyLayer(layer, baseline);
  const [first, last] = bandsWithin(from, to, baseline.length);
  // values stay within the document's limits
  const factorAt = (j: number) =>
    j < first || j > last ? 1 : Math.min(factor, MAX_CURVE_VALUE / (values[j] as number));
  const scaled = {
    factors: layer.factors.map((v, j) => v * factorAt(j)),
    offsets: layer.offsets.map((v, j) => v * factorAt(j)),
  };
  return rebuildCurve(base, scaled, addIntervalEnds(points, from, to, MAX_DEGREES / baseline.length));
}

/** Move an interval along the angle. The uncovered bands take the value at the edge it left. */
export function shiftInterval(base: EditBase, from: number, to: number, degrees: number): DrawnChannels {
  const { baseline, points } = base;
  const layer = layerOf(base.curve, baseline);
  const values = applyLayer(layer, baseline);
  const band = MAX_DEGREES / baseline.length;
  const [first, last] = bandsWithin(Math.min(from, from + degrees), Math.max(to, to + degrees), baseline.length);
  const moved = Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => {
    const origin = (first + i + 0.5) * band - degrees;
    return sampleBands(values, Math.min(to, Math.max(from, origin)));
  });
  const all = addIntervalEnds(points, from, to, band);
  const inside = ([x]: Point) => x >= from - band / 2 && x <= to + band / 2;
  const shifted = all.filter(inside).map(([x]) => roundPoint(Math.min(MAX_DEGREES, Math.max(0, x + degrees)), 0));
  const [low, high] = [from + degrees - band, to + degrees + band];
  const remaining = all.filter((p) => !inside(p) && (p[0] < low || p[0] > high));
  const knots = [...remaining, ...shifted].sort((a, b) => a[0] - b[0]);
  return rebuildCurve(base, layerWithValues(layer, first, moved), knots);
}
