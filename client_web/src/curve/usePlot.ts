/** Pointer and keys in the plot: where they are, what they take hold of, which gesture is under way. */
import { useRef, useState } from "preact/hooks";
import { history } from "../edit/history";
import { useDrag } from "../ui/drag";
import { brush, clearBrush } from "./brush";
import { niceTop, type Axes } from "./model/axes";
import { channelsOf } from "./model/channels";
import { largestValue, pointsOf, type CurveModel } from "./model/model";
import { plotAt, plotX, plotY, type Frame } from "./plotScale";
import { active, isStretched, logarithmic, tool } from "./settings";
import {
  applyScale,
  applyShift,
  drawGesture,
  picked,
  pointsGesture,
  selection,
  stretchGesture,
  type Gesture,
  type Hand,
  type Spot,
} from "./tools";

const HIT_PX = 11;
const MIN_BRUSH_DEGREES = 0.75;

function spotOf(frame: Frame, svg: SVGSVGElement, event: PointerEvent): Spot {
  const box = svg.getBoundingClientRect();
  const [x, y] = [event.clientX - box.left, event.clientY - box.top];
  return { ...plotAt(frame, x, y), x, y };
}

function hitPoint(frame: Frame, hand: Hand, spot: Spot): number {
  let [best, at] = [HIT_PX, -1];
  pointsOf(hand.model, hand.channels[0] ?? 0, hand.axes).forEach(([x, y], i) => {
    const distance = Math.hypot(plotX(frame, x) - spot.x, plotY(frame, y) - spot.y);
    if (distance < best) [best, at] = [distance, i];
  });
  return at;
}

/** Keys on a selected stretch: arrows scale and shift it. */
export function stretchKey(event: KeyboardEvent, hand: Hand): void {
  const chosen = selection.value;
  if (tool.value !== "stretch" || chosen === null) return;
  const fine = event.shiftKey ? 0.1 : 1;
  if (event.key === "ArrowUp") applyScale(hand, chosen, 1 + 0.05 * fine);
  else if (event.key === "ArrowDown") applyScale(hand, chosen, 1 / (1 + 0.05 * fine));
  else if (event.key === "ArrowLeft") selection.value = applyShift(hand, chosen, -fine);
  else if (event.key === "ArrowRight") selection.value = applyShift(hand, chosen, fine);
  else if (event.key === "Escape") selection.value = null;
  else return;
  event.preventDefault();
  event.stopPropagation();
}

function gestureAt(hand: Hand, frame: Frame, spot: Spot): Gesture {
  if (tool.value === "draw") return drawGesture(hand, spot);
  if (tool.value === "stretch") return stretchGesture(hand, spot);
  return pointsGesture(hand, spot, hitPoint(frame, hand, spot));
}

/** The plot's frame, what the hand may change, and the pointer's handlers. */
export function usePlot(model: CurveModel, width: number, ready: boolean) {
  const [held, setHeld] = useState<Axes | null>(null);
  const gesture = useRef<Gesture | null>(null);
  const [spot, setSpot] = useState<Spot | null>(null);
  const axes: Axes = held ?? {
    stretched: isStretched(model.info.name, model.info.bands),
    log: logarithmic.value,
    top: niceTop(largestValue(model), logarithmic.value),
  };
  const frame: Frame = { width, height: Math.round(Math.min(460, Math.max(190, width * 0.66))), axes };
  const hand: Hand = { model, axes, channels: channelsOf(active.value) };
  const pointsBlocked = tool.value === "points" && active.value === "rgb" && !model.together;

  const begin = (event: PointerEvent) => {
    if (event.button !== 0 || !ready || pointsBlocked) return false;
    const svg = event.currentTarget as SVGSVGElement;
    clearBrush();
    history.seal();
    setHeld(axes);
    gesture.current = gestureAt(hand, frame, spotOf(frame, svg, event));
    event.preventDefault();
    return true;
  };
  const move = (event: PointerEvent) => {
    const svg = event.currentTarget as SVGSVGElement;
    setSpot(spotOf(frame, svg, event));
    const events = tool.value === "draw" ? event.getCoalescedEvents?.() : undefined;
    for (const each of events?.length ? events : [event]) gesture.current?.move(spotOf(frame, svg, each));
  };
  const hover = (event: PointerEvent) => {
    const here = spotOf(frame, event.currentTarget as SVGSVGElement, event);
    setSpot(here);
    const half = Math.max(MIN_BRUSH_DEGREES, 90 / model.info.bands, here.degrees * 0.06);
    const chosen = tool.value === "stretch" ? selection.value : null;
    brush(...(chosen ?? [here.degrees - half, here.degrees + half]));
  };
  const end = (event: PointerEvent, released: boolean) => {
    const svg = event.currentTarget as SVGSVGElement;
    if (released) gesture.current?.up(spotOf(frame, svg, event));
    gesture.current = null;
    setHeld(null);
    // the keys go on where the hand let go
    const index = tool.value === "points" ? picked.value?.index : undefined;
    if (index === undefined) svg.focus();
    else requestAnimationFrame(() => svg.querySelector<SVGGElement>(`[data-index="${index}"]`)?.focus());
  };
  const leave = () => {
    setSpot(null);
    clearBrush();
  };
  return {
    frame,
    hand,
    spot,
    pointsBlocked,
    dragging: gesture.current !== null,
    handlers: { ...useDrag({ begin, move, hover, end }), onPointerLeave: leave },
  };
}
