/** The curve editor for a term's one-dimensional factor. */
import { useEffect, useMemo, useState } from "preact/hooks";
import { beginCurveDrag } from "../session/prepare";
import type { CurveEdits, CurveBody } from "../protocol";
import { curvePreview } from "../state/curvePreview";
import { pixelProbe } from "../state/pointerPixel";
import { curvePath } from "../state/selection";
import { CurveBar, CurveTools } from "./CurveBar";
import { PointHandles } from "./PointHandles";
import { Plot } from "./Plot";
import { PointTable } from "./PointTable";
import { CurveReadout, type Contributions } from "./CurveReadout";
import { IntervalBar } from "./IntervalBar";
import { clearBrush } from "./curveBrush";
import { curveModel, pointsOf } from "./model/model";
import { outputShares } from "./model/interval";
import { activeChannels, tableOpen, curveTool } from "./curveView";
import { pickedPoint, selectedInterval } from "./curveTools";
import { onIntervalKey, usePlot } from "./usePlot";

/** Width of an element, updated when it changes. */
function useElementWidth(): [(element: HTMLElement | null) => void, number] {
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

/** A pixel's contributions if they belong to this curve. */
function loadContributions(path: string): Contributions | null {
  const answer = pixelProbe.value?.answer;
  if (answer?.curve !== path || answer.bands === null) return null;
  return { bands: answer.bands, fraction: outputShares(answer.bands, answer.radiance) };
}

/** `edits`: the look's edits of this curve; undefined if the model generates it. */
export function CurveEditor({ info, edits }: { info: CurveBody; edits: CurveEdits | undefined }) {
  const [measure, width] = useElementWidth();
  const path = curvePath.value ?? "";
  const shape = curvePreview.value;
  const model = useMemo(() => curveModel(path, info, edits, shape), [path, info, edits, shape]);
  const ready = model.curves.every((bands) => bands !== null);
  const { frame, context, spot, pointsBlocked, dragging, handlers } = usePlot(model, width, ready);
  const channels = activeChannels.value;
  useEffect(() => {
    pickedPoint.value = null;
    selectedInterval.value = null;
    return clearBrush;
  }, [path, channels]);
  const first = context.channels[0] ?? 0;
  const handledPoints = curveTool.value === "points" && ready && !pointsBlocked;
  const points = useMemo(
    () => (handledPoints ? pointsOf(model, first, frame.axes) : null),
    [handledPoints, model, first, frame.axes],
  );
  const drawn = useMemo(() => model.channels.map((channel) => channel !== null), [model]);
  const contributions = loadContributions(path);
  return (
    <div class="curve" ref={measure} onKeyDown={(event) => onIntervalKey(event, context)}>
      <CurveTools context={context} />
      <div
        class={`plot ${curveTool.value}`}
        style={{ width: `${frame.width}px`, height: `${frame.height}px` }}
        onPointerEnter={beginCurveDrag}
      >
        <Plot
          frame={frame}
          lines={model.lines}
          generatedLines={model.generatedLines}
          drawn={drawn}
          areJoined={model.areJoined}
          active={context.channels}
          contributions={contributions !== null && contributions.fraction > 0 ? contributions.bands : null}
          interval={curveTool.value === "stretch" ? selectedInterval.value : null}
          cursor={spot !== null && !dragging ? spot.degrees : null}
          points={points}
          offered={!context.channels.some((c) => drawn[c])}
        />
        <svg
          width={frame.width}
          height={frame.height}
          tabindex={curveTool.value === "stretch" ? 0 : -1}
          role="group"
          aria-label={`${info.label} curve`}
          {...handlers}
        >
          {points !== null && <PointHandles frame={frame} context={context} points={points} />}
        </svg>
      </div>
      <CurveReadout
        model={model}
        axes={context.axes}
        spot={spot}
        ready={ready}
        blocked={pointsBlocked}
        contributions={contributions}
      />
      {curveTool.value === "stretch" && <IntervalBar context={context} />}
      <CurveBar context={context} />
      {tableOpen.value && points !== null && <PointTable context={context} points={points} />}
    </div>
  );
}
