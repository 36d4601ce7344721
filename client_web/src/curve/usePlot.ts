/** Pointer and keyboard input of the plot: position, dragged point, current gesture. */
import { useMemo, useRef, useState } from "preact/hooks";
import { history } from "../edit/history";
import { useDrag } from "../ui/drag";
import { requestBrush, clearBrush } from "./curveBrush";
import { niceTop, type CurveAxes } from "./model/axes";
import { channelsOf } from "./model/channels";
import { largestValue, pointsOf, type CurveModel } from "./model/model";
import { degreesAndValueAt, plotX, plotY, type PlotFrame } from "./plotScale";
import { activeChannels, isStretched, logarithmic, curveTool } from "./curveView";
import {
  applyScale,
  applyShift,
  drawGesture,
  pickedPoint,
  pointsGesture,
  selectedInterval,
  intervalGesture,
  type PlotGesture,
  type CurveContext,
  type PlotSpot,
} from "./curveTools";

const HIT_PX = 11;
const MIN_BRUSH_DEGREES = 0.75;

function spotOf(frame: PlotFrame, svg: SVGSVGElement, event: PointerEvent): PlotSpot {
  const box = svg.getBoundingClientRect();
  const [x, y] = [event.clientX - box.left, event.clientY - box.top];
  return { ...degreesAndValueAt(frame, x, y), x, y };
}

function hitPoint(frame: PlotFrame, context: CurveContext, spot: PlotSpot): number {
  let [best, hitIndex] = [HIT_PX, -1];
  pointsOf(context.model, context.channels[0] ?? 0, context.axes).forEach(([x, y], i) => {
    const distance = Math.hypot(plotX(frame, x) - spot.x, plotY(frame, y) - spot.y);
    if (distance < best) [best, hitIndex] = [distance, i];
  });
  return hitIndex;
}

/** Keys of a selected interval: arrows scale and move it. */
export function onIntervalKey(event: KeyboardEvent, context: CurveContext): void {
  const interval = selectedInterval.value;
  if (curveTool.value !== "stretch" || interval === null) return;
  const fine = event.shiftKey ? 0.1 : 1;
  if (event.key === "ArrowUp") applyScale(context, interval, 1 + 0.05 * fine);
  else if (event.key === "ArrowDown") applyScale(context, interval, 1 / (1 + 0.05 * fine));
  else if (event.key === "ArrowLeft") selectedInterval.value = applyShift(context, interval, -fine);
  else if (event.key === "ArrowRight") selectedInterval.value = applyShift(context, interval, fine);
  else if (event.key === "Escape") selectedInterval.value = null;
  else return;
  event.preventDefault();
  event.stopPropagation();
}

function gestureAt(context: CurveContext, frame: PlotFrame, spot: PlotSpot): PlotGesture {
  if (curveTool.value === "draw") return drawGesture(context, spot);
  if (curveTool.value === "stretch") return intervalGesture(context, spot);
  return pointsGesture(context, spot, hitPoint(frame, context, spot));
}

/** The plot's frame, the editing context, and the pointer's handlers. */
export function usePlot(model: CurveModel, width: number, ready: boolean) {
  const [frozenAxes, setFrozenAxes] = useState<CurveAxes | null>(null);
  const gesture = useRef<PlotGesture | null>(null);
  const [spot, setSpot] = useState<PlotSpot | null>(null);
  const log = logarithmic.value;
  const fittedAxes = useMemo<CurveAxes>(() => {
    const top = niceTop(largestValue(model), log);
    return { stretched: isStretched(model.info.name, model.info.bands), log, top };
  }, [model, log]);
  const axes = frozenAxes ?? fittedAxes;
  const frame: PlotFrame = { width, height: Math.round(Math.min(460, Math.max(190, width * 0.66))), axes };
  const context: CurveContext = { model, axes, channels: channelsOf(activeChannels.value) };
  const pointsBlocked = curveTool.value === "points" && activeChannels.value === "rgb" && !model.areJoined;

  const begin = (event: PointerEvent) => {
    if (event.button !== 0 || !ready || pointsBlocked) return false;
    const svg = event.currentTarget as SVGSVGElement;
    clearBrush();
    history.endGesture();
    setFrozenAxes(axes);
    gesture.current = gestureAt(context, frame, spotOf(frame, svg, event));
    event.preventDefault();
    return true;
  };
  const move = (event: PointerEvent) => {
    const svg = event.currentTarget as SVGSVGElement;
    setSpot(spotOf(frame, svg, event));
    // Safari has them since version 18.2
    const events = curveTool.value === "draw" && "getCoalescedEvents" in event ? event.getCoalescedEvents() : [];
    for (const sample of events.length > 0 ? events : [event]) gesture.current?.move(spotOf(frame, svg, sample));
  };
  const hover = (event: PointerEvent) => {
    const hoverSpot = spotOf(frame, event.currentTarget as SVGSVGElement, event);
    setSpot(hoverSpot);
    const half = Math.max(MIN_BRUSH_DEGREES, 90 / model.info.bands, hoverSpot.degrees * 0.06);
    const interval = curveTool.value === "stretch" ? selectedInterval.value : null;
    requestBrush(...(interval ?? [hoverSpot.degrees - half, hoverSpot.degrees + half]));
  };
  const end = (event: PointerEvent, released: boolean) => {
    const svg = event.currentTarget as SVGSVGElement;
    if (released) gesture.current?.up(spotOf(frame, svg, event));
    gesture.current = null;
    setFrozenAxes(null);
    // keys continue from the end of the drag
    const index = curveTool.value === "points" ? pickedPoint.value?.index : undefined;
    if (index === undefined) svg.focus();
    else requestAnimationFrame(() => svg.querySelector<SVGGElement>(`[data-index="${index}"]`)?.focus());
  };
  const leave = () => {
    setSpot(null);
    clearBrush();
  };
  return {
    frame,
    context,
    spot,
    pointsBlocked,
    dragging: gesture.current !== null,
    handlers: { ...useDrag({ begin, move, hover, end }), onPointerLeave: leave },
  };
}
