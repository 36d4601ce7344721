/** The curve's points: each a slider for keyboard and screen reader. */
import type { Point } from "../protocol";
import { formatNumber } from "../ui/scale";
import { valueOn } from "./model/edited";
import { putPoints } from "./model/model";
import { movePoint, removePoint } from "./model/points";
import { plotX, plotY, type Frame } from "./plotScale";
import { bandOf, picked, type Hand } from "./tools";

interface Props {
  frame: Frame;
  hand: Hand;
  points: Point[];
}

const FINE = 0.1;
/** What keys multiply a point's value by. */
const STEP = 1.02;
const LARGE_STEP = 1.25;
/** Of the top of the plot: what a point at zero begins with, and what is as good as zero. */
const FIRST_VALUE = 1e-3;
const LEAST_VALUE = 1e-9;
const DIGITS = 6;

/** A value after key steps, as a share of itself: a point in the tail of a highlight moves as far as one at its peak. */
export function steppedValue(value: number, factor: number, top: number): number {
  if (value <= 0) return factor > 1 ? FIRST_VALUE * top : 0;
  const next = Number((value * factor).toPrecision(DIGITS));
  return next < LEAST_VALUE * top ? 0 : next;
}

/** The generator's value at a point's angle. */
function generatorAt(hand: Hand, degrees: number): number | null {
  const generated = hand.model.generated?.[hand.channels[0] ?? 0];
  return generated === undefined ? null : valueOn(generated, degrees);
}

export function resetPoint(hand: Hand, points: Point[], index: number): void {
  const value = generatorAt(hand, points[index]?.[0] ?? 0);
  if (value !== null) moveTo(hand, points, index, points[index]?.[0] ?? 0, value, "Reset point");
}

export function deletePoint(hand: Hand, points: Point[], index: number): void {
  putPoints(hand.model, "Delete point", points, removePoint(points, index), hand.channels);
  picked.value = null;
}

export function moveTo(
  hand: Hand,
  points: Point[],
  index: number,
  degrees: number,
  value: number,
  label = "Move point",
): void {
  const moved = movePoint(points, index, degrees, value, bandOf(hand));
  if (String(moved[index]) === String(points[index])) return; // where it was already: not a step of the history
  putPoints(hand.model, label, points, moved, hand.channels);
}

function nudge(hand: Hand, points: Point[], index: number, dx: number, factor: number): void {
  const [x, y] = points[index] as Point;
  moveTo(hand, points, index, x + dx, factor === 1 ? y : steppedValue(y, factor, hand.axes.top));
}

function onKey(event: KeyboardEvent, hand: Hand, points: Point[], index: number): void {
  const step = event.shiftKey ? FINE : 1;
  const degrees = Math.max(0.5, 90 / hand.model.info.bands) * step;
  const moves: Record<string, [number, number]> = {
    ArrowLeft: [-degrees, 1],
    ArrowRight: [degrees, 1],
    ArrowUp: [0, STEP ** step],
    ArrowDown: [0, STEP ** -step],
    PageUp: [0, LARGE_STEP],
    PageDown: [0, 1 / LARGE_STEP],
  };
  const move = moves[event.key];
  if (move !== undefined) nudge(hand, points, index, ...move);
  else if (event.key === "Delete" || event.key === "Backspace") deletePoint(hand, points, index);
  else if (event.key === "r" || event.key === "R") resetPoint(hand, points, index);
  else if (event.key === "Enter" || event.key === " ") picked.value = { index, carried: !picked.value?.carried };
  else if (event.key === "Escape" && picked.value !== null) picked.value = null;
  else return;
  event.preventDefault();
  event.stopPropagation();
}

export function Handles({ frame, hand, points }: Props) {
  return (
    <g>
      {points.map(([degrees, value], index) => (
        <g
          key={index}
          data-index={index}
          role="slider"
          tabindex={0}
          class={picked.value?.index === index ? `handle picked ${picked.value.carried ? "carried" : ""}` : "handle"}
          aria-label={`Point ${index + 1} of ${points.length}`}
          aria-orientation="vertical"
          aria-valuemin={0}
          aria-valuemax={1e6}
          aria-valuenow={value}
          aria-valuetext={`${degrees.toFixed(2)} degrees, value ${formatNumber(value)}`}
          transform={`translate(${plotX(frame, degrees).toFixed(1)} ${plotY(frame, value).toFixed(1)})`}
          onFocus={() => {
            if (picked.value?.index !== index) picked.value = { index, carried: false };
          }}
          onKeyDown={(event: KeyboardEvent) => onKey(event, hand, points, index)}
        >
          <circle class="reach" r="11" />
          <circle class="mark" r="4" />
        </g>
      ))}
    </g>
  );
}
