/** The curve's points; each is a slider for keyboards and screen readers. */
import type { Point } from "../protocol";
import { formatNumber } from "../ui/scale";
import { sampleBands } from "./model/edits";
import { applyPoints } from "./model/model";
import { movePoint, removePoint } from "./model/points";
import { plotX, plotY, type PlotFrame } from "./plotScale";
import { bandOf, pickedPoint, type CurveContext } from "./curveTools";

interface Props {
  frame: PlotFrame;
  context: CurveContext;
  points: Point[];
}

const FINE = 0.1;
/** Factors by which keys multiply a point's value. */
const STEP = 1.02;
const LARGE_STEP = 1.25;
/** Fractions of the plot's maximum: the first step from zero, and the threshold below which a value is zero. */
const FIRST_VALUE = 1e-3;
const MIN_VALUE = 1e-9;
const DIGITS = 6;

/** A value after relative key steps: a point in the tail of a highlight moves as far as one at its peak. */
export function steppedValue(value: number, factor: number, top: number): number {
  if (value <= 0) return factor > 1 ? FIRST_VALUE * top : 0;
  const next = Number((value * factor).toPrecision(DIGITS));
  return next < MIN_VALUE * top ? 0 : next;
}

/** The generated curve's value at a point's angle. */
function generatedValueAt(context: CurveContext, degrees: number): number | null {
  const generated = context.model.generated?.[context.channels[0] ?? 0];
  return generated === undefined ? null : sampleBands(generated, degrees);
}

export function resetPoint(context: CurveContext, points: Point[], index: number): void {
  const value = generatedValueAt(context, points[index]?.[0] ?? 0);
  if (value !== null) movePointTo(context, points, index, points[index]?.[0] ?? 0, value, "Reset point");
}

export function deletePoint(context: CurveContext, points: Point[], index: number): void {
  applyPoints(context.model, "Delete point", points, removePoint(points, index), context.channels);
  pickedPoint.value = null;
}

export function movePointTo(
  context: CurveContext,
  points: Point[],
  index: number,
  degrees: number,
  value: number,
  label = "Move point",
): void {
  const moved = movePoint(points, index, degrees, value, bandOf(context));
  if (String(moved[index]) === String(points[index])) return; // unchanged: no step of the history
  applyPoints(context.model, label, points, moved, context.channels);
}

function nudgePoint(context: CurveContext, points: Point[], index: number, dx: number, factor: number): void {
  const [x, y] = points[index] as Point;
  movePointTo(context, points, index, x + dx, factor === 1 ? y : steppedValue(y, factor, context.axes.top));
}

function onHandleKey(event: KeyboardEvent, context: CurveContext, points: Point[], index: number): void {
  const step = event.shiftKey ? FINE : 1;
  const degrees = Math.max(0.5, 90 / context.model.info.bands) * step;
  const moves: Record<string, [number, number]> = {
    ArrowLeft: [-degrees, 1],
    ArrowRight: [degrees, 1],
    ArrowUp: [0, STEP ** step],
    ArrowDown: [0, STEP ** -step],
    PageUp: [0, LARGE_STEP],
    PageDown: [0, 1 / LARGE_STEP],
  };
  const move = moves[event.key];
  if (move !== undefined) nudgePoint(context, points, index, ...move);
  else if (event.key === "Delete" || event.key === "Backspace") deletePoint(context, points, index);
  else if (event.key === "r" || event.key === "R") resetPoint(context, points, index);
  else if (event.key === "Enter" || event.key === " ")
    pickedPoint.value = { index, carried: !pickedPoint.value?.carried };
  else if (event.key === "Escape" && pickedPoint.value !== null) pickedPoint.value = null;
  else return;
  event.preventDefault();
  event.stopPropagation();
}

export function PointHandles({ frame, context, points }: Props) {
  return (
    <g>
      {points.map(([degrees, value], index) => (
        <g
          key={index}
          data-index={index}
          role="slider"
          tabindex={0}
          class={
            pickedPoint.value?.index === index
              ? `handle picked ${pickedPoint.value.carried ? "carried" : ""}`
              : "handle"
          }
          aria-label={`Point ${index + 1} of ${points.length}`}
          aria-orientation="vertical"
          aria-valuemin={0}
          aria-valuemax={1e6}
          aria-valuenow={value}
          aria-valuetext={`${degrees.toFixed(2)} degrees, value ${formatNumber(value)}`}
          transform={`translate(${plotX(frame, degrees).toFixed(1)} ${plotY(frame, value).toFixed(1)})`}
          onFocus={() => {
            if (pickedPoint.value?.index !== index) pickedPoint.value = { index, carried: false };
          }}
          onKeyDown={(event: KeyboardEvent) => onHandleKey(event, context, points, index)}
        >
          <circle class="reach" r="11" />
          <circle class="mark" r="4" />
        </g>
      ))}
    </g>
  );
}
