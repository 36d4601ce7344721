/** The curve editor: a term's one-dimensional factor, under the hand. */
import { useEffect, useRef, useState } from "preact/hooks";
import type { CurveInfo, Term } from "../protocol";
import { history, curvePath, curveShape, probe } from "../state/store";
import { degreesAt, niceTop, type Axes } from "./axes";
import { brush, clearBrush } from "./brush";
import { channelsOf } from "./channels";
import { CurveBar, CurveTools } from "./CurveBar";
import { Handles } from "./Handles";
import { curveModel, largestValue, pointsOf, type CurveModel } from "./model";
import { MARGIN, Plot, plotX, plotY, type Frame } from "./Plot";
import { PointTable } from "./PointTable";
import { Readout, type Contributions } from "./Readout";
import { active, isStretched, logarithmic, tableOpen, tool } from "./settings";
import { shareOf } from "./stretch";
import { StretchBar } from "./StretchBar";
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

/** Width of an element, followed. */
function useWidth(): [(element: HTMLElement | null) => void, number] {
  const [element, setElement] = useState<HTMLElement | null>(null);
  const [width, setWidth] = useState(288);
  useEffect(() => {
    if (element === null) return;
    const observer = new ResizeObserver(
      ([entry]) => entry && setWidth(Math.max(200, Math.round(entry.contentRect.width))),
    );
    observer.observe(element);
    return () => observer.disconnect();
  }, [element]);
  return [setElement, width];
}

function spotOf(frame: Frame, svg: SVGSVGElement, event: PointerEvent): Spot {
  const box = svg.getBoundingClientRect();
  const [x, y] = [event.clientX - box.left, event.clientY - box.top];
  const u = (x - MARGIN.left) / (frame.width - MARGIN.left - MARGIN.right);
  const height = 1 - (y - MARGIN.top) / (frame.height - MARGIN.top - MARGIN.bottom);
  return { degrees: degreesAt(frame.axes, u), height, x, y };
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
function stretchKey(event: KeyboardEvent, hand: Hand): void {
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

function begin(hand: Hand, frame: Frame, spot: Spot): Gesture {
  if (tool.value === "draw") return drawGesture(hand, spot);
  if (tool.value === "stretch") return stretchGesture(hand, spot);
  return pointsGesture(hand, spot, hitPoint(frame, hand, spot));
}

/** A pixel's contributions, where they are of this curve. */
function contributionsTo(path: string): Contributions | null {
  const answer = probe.value?.answer;
  if (answer?.curve !== path || answer.bands === null) return null;
  return { bands: answer.bands, share: shareOf(answer.bands, answer.radiance) };
}

function usePlot(model: CurveModel, width: number, ready: boolean) {
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

  const down = (event: PointerEvent) => {
    if (event.button !== 0 || !ready || pointsBlocked) return;
    const svg = event.currentTarget as SVGSVGElement;
    svg.setPointerCapture(event.pointerId);
    clearBrush();
    history.seal();
    setHeld(axes);
    gesture.current = begin(hand, frame, spotOf(frame, svg, event));
    event.preventDefault();
  };
  const move = (event: PointerEvent) => {
    const svg = event.currentTarget as SVGSVGElement;
    const here = spotOf(frame, svg, event);
    setSpot(here);
    if (gesture.current !== null) {
      history.hold();
      const events = tool.value === "draw" ? event.getCoalescedEvents?.() : undefined;
      for (const each of events?.length ? events : [event]) gesture.current.move(spotOf(frame, svg, each));
      return;
    }
    const half = Math.max(MIN_BRUSH_DEGREES, 90 / model.info.bands, here.degrees * 0.06);
    const chosen = tool.value === "stretch" ? selection.value : null;
    brush(...(chosen ?? [here.degrees - half, here.degrees + half]));
  };
  const up = (event: PointerEvent) => {
    const svg = event.currentTarget as SVGSVGElement;
    gesture.current?.up(spotOf(frame, svg, event));
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
    handlers: { onPointerDown: down, onPointerMove: move, onPointerUp: up, onPointerCancel: up, onPointerLeave: leave },
  };
}

export function CurveEditor({ info, term }: { info: CurveInfo; term: Term }) {
  const [measure, width] = useWidth();
  const path = curvePath.value ?? "";
  const shape = curveShape.value;
  const model = curveModel(path, info, term, shape);
  const ready = shape !== null || model.channels.every((points) => points !== null);
  const { frame, hand, spot, pointsBlocked, dragging, handlers } = usePlot(model, width, ready);
  useEffect(() => {
    picked.value = null;
    selection.value = null;
    return clearBrush;
  }, [path, active.value]);
  const points =
    tool.value === "points" && ready && !pointsBlocked ? pointsOf(model, hand.channels[0] ?? 0, hand.axes) : null;
  const contributions = contributionsTo(path);
  const light = spot !== null && !dragging ? spot.degrees : null;
  return (
    <div class="curve" ref={measure} onKeyDown={(event) => stretchKey(event, hand)}>
      <CurveTools hand={hand} />
      <svg
        class={`plot ${tool.value}`}
        width={frame.width}
        height={frame.height}
        tabIndex={tool.value === "stretch" ? 0 : -1}
        role="group"
        aria-label={`${info.label} curve`}
        {...handlers}
      >
        <Plot
          frame={frame}
          lines={model.lines}
          ghosts={model.ghosts}
          drawn={model.channels.map((channel) => channel !== null)}
          together={model.together}
          active={hand.channels}
          contributions={contributions !== null && contributions.share > 0 ? contributions.bands : null}
          stretch={tool.value === "stretch" ? selection.value : null}
          stretchKind="selected"
        >
          {light !== null && (
            <line
              class="cursor"
              x1={plotX(frame, light)}
              x2={plotX(frame, light)}
              y1={MARGIN.top}
              y2={frame.height - MARGIN.bottom}
            />
          )}
          {points !== null && <Handles frame={frame} hand={hand} points={points} />}
        </Plot>
      </svg>
      <Readout
        model={model}
        axes={hand.axes}
        spot={spot}
        ready={ready}
        blocked={pointsBlocked}
        contributions={contributions}
      />
      {tool.value === "stretch" && <StretchBar hand={hand} />}
      <CurveBar hand={hand} />
      {tableOpen.value && points !== null && <PointTable hand={hand} points={points} />}
    </div>
  );
}
