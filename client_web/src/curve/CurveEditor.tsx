/** The curve editor: a term's one-dimensional factor, under the hand. */
import { useEffect, useMemo, useState } from "preact/hooks";
import { holdCurve } from "../live/touch";
import type { CurveEdits, CurveBody } from "../protocol";
import { curveShape } from "../state/curveShape";
import { probe } from "../state/probe";
import { curvePath } from "../state/selection";
import { CurveBar, CurveTools } from "./CurveBar";
import { Handles } from "./Handles";
import { Plot } from "./Plot";
import { PointTable } from "./PointTable";
import { Readout, type Contributions } from "./Readout";
import { StretchBar } from "./StretchBar";
import { clearBrush } from "./brush";
import { curveModel, pointsOf } from "./model/model";
import { shareOf } from "./model/stretch";
import { active, tableOpen, tool } from "./settings";
import { picked, selection } from "./tools";
import { stretchKey, usePlot } from "./usePlot";

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

/** A pixel's contributions, where they are of this curve. */
function contributionsTo(path: string): Contributions | null {
  const answer = probe.value?.answer;
  if (answer?.curve !== path || answer.bands === null) return null;
  return { bands: answer.bands, share: shareOf(answer.bands, answer.radiance) };
}

/** `edits` is what the look says of this curve, undefined where the model's parameters make it. */
export function CurveEditor({ info, edits }: { info: CurveBody; edits: CurveEdits | undefined }) {
  const [measure, width] = useWidth();
  const path = curvePath.value ?? "";
  const shape = curveShape.value;
  const model = useMemo(() => curveModel(path, info, edits, shape), [path, info, edits, shape]);
  const ready = model.curves.every((bands) => bands !== null);
  const { frame, hand, spot, pointsBlocked, dragging, handlers } = usePlot(model, width, ready);
  useEffect(() => {
    picked.value = null;
    selection.value = null;
    return clearBrush;
  }, [path, active.value]);
  const { axes } = frame;
  const first = hand.channels[0] ?? 0;
  const handled = tool.value === "points" && ready && !pointsBlocked;
  const points = useMemo(
    () => (handled ? pointsOf(model, first, axes) : null),
    [handled, model, first, axes.stretched, axes.log, axes.top],
  );
  const drawn = useMemo(() => model.channels.map((channel) => channel !== null), [model]);
  const contributions = contributionsTo(path);
  return (
    <div class="curve" ref={measure} onKeyDown={(event) => stretchKey(event, hand)}>
      <CurveTools hand={hand} />
      <div
        class={`plot ${tool.value}`}
        style={{ width: `${frame.width}px`, height: `${frame.height}px` }}
        onPointerEnter={holdCurve}
      >
        <Plot
          frame={frame}
          lines={model.lines}
          ghosts={model.ghosts}
          drawn={drawn}
          together={model.together}
          active={hand.channels}
          contributions={contributions !== null && contributions.share > 0 ? contributions.bands : null}
          stretch={tool.value === "stretch" ? selection.value : null}
          cursor={spot !== null && !dragging ? spot.degrees : null}
          points={points}
          offered={!hand.channels.some((c) => drawn[c])}
        />
        <svg
          width={frame.width}
          height={frame.height}
          tabindex={tool.value === "stretch" ? 0 : -1}
          role="group"
          aria-label={`${info.label} curve`}
          {...handlers}
        >
          {points !== null && <Handles frame={frame} hand={hand} points={points} />}
        </svg>
      </div>
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
