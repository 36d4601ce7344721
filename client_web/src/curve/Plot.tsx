/** The plot itself, without hands: grid, contributions of a pixel, ghost, curves. */
import type { ComponentChildren } from "preact";
import type { Point } from "../protocol";
import { tickLabel } from "../ui/scale";
import { MAX_DEGREES, xFraction, xTicks, yFraction, yTicks, type Axes } from "./axes";

export interface Frame {
  width: number;
  height: number;
  axes: Axes;
}

export const MARGIN = { left: 40, right: 10, top: 10, bottom: 20 };
const CHANNEL_CLASSES = ["red", "green", "blue"];

export function plotX(frame: Frame, degrees: number): number {
  return MARGIN.left + xFraction(frame.axes, degrees) * (frame.width - MARGIN.left - MARGIN.right);
}

export function plotY(frame: Frame, value: number): number {
  const height = frame.height - MARGIN.top - MARGIN.bottom;
  return MARGIN.top + (1 - Math.min(1.02, yFraction(frame.axes, value))) * height;
}

function pathOf(frame: Frame, line: readonly Point[]): string {
  return line
    .map(([x, y], i) => `${i === 0 ? "M" : "L"}${plotX(frame, x).toFixed(1)} ${plotY(frame, y).toFixed(1)}`)
    .join("");
}

function Grid({ frame }: { frame: Frame }) {
  const right = frame.width - MARGIN.right;
  const base = frame.height - MARGIN.bottom;
  return (
    <g class="grid">
      {yTicks(frame.axes).map((value) => (
        <g key={value}>
          <line x1={MARGIN.left} x2={right} y1={plotY(frame, value)} y2={plotY(frame, value)} />
          <text x={MARGIN.left - 5} y={plotY(frame, value) + 3.5} text-anchor="end">
            {tickLabel(value)}
          </text>
        </g>
      ))}
      {xTicks(frame.axes).map((degrees) => (
        <g key={degrees}>
          <line x1={plotX(frame, degrees)} x2={plotX(frame, degrees)} y1={MARGIN.top} y2={base} />
          <text x={plotX(frame, degrees)} y={base + 14} text-anchor={degrees === 90 ? "end" : "middle"}>
            {degrees}°
          </text>
        </g>
      ))}
      <line class="axis" x1={MARGIN.left} x2={right} y1={base} y2={base} />
    </g>
  );
}

/** How much each angle contributes to the pixel under the pointer, relative to its largest band. */
function Contributions({ frame, bands }: { frame: Frame; bands: number[][] }) {
  const largest = Math.max(1e-12, ...bands.flat());
  const base = frame.height - MARGIN.bottom;
  const height = frame.height - MARGIN.top - MARGIN.bottom;
  return (
    <g class="contributions">
      {bands.map((channel, c) => {
        const width = MAX_DEGREES / channel.length;
        const steps = channel.map((value, j) => {
          const y = base - 0.92 * height * Math.max(0, value / largest);
          return `L${plotX(frame, j * width).toFixed(1)} ${y.toFixed(1)}L${plotX(frame, (j + 1) * width).toFixed(1)} ${y.toFixed(1)}`;
        });
        return (
          <path
            key={c}
            class={CHANNEL_CLASSES[c]}
            d={`M${MARGIN.left} ${base}${steps.join("")}L${plotX(frame, MAX_DEGREES)} ${base}Z`}
          />
        );
      })}
    </g>
  );
}

interface Props {
  frame: Frame;
  lines: Point[][];
  ghosts: Point[][] | null;
  /** Channels whose own curve differs from the ghost. */
  drawn: boolean[];
  together: boolean;
  active: number[];
  contributions: number[][] | null;
  stretch: [number, number] | null;
  stretchKind: "selected" | "lit";
  children?: ComponentChildren;
}

export function Plot({
  frame,
  lines,
  ghosts,
  drawn,
  together,
  active,
  contributions,
  stretch,
  stretchKind,
  children,
}: Props) {
  const shown = together ? [0] : [0, 1, 2];
  const name = (c: number) => (together ? "all" : CHANNEL_CLASSES[c]);
  return (
    <>
      {stretch !== null && (
        <rect
          class={`stretch ${stretchKind}`}
          x={plotX(frame, stretch[0])}
          width={Math.max(1, plotX(frame, stretch[1]) - plotX(frame, stretch[0]))}
          y={MARGIN.top}
          height={frame.height - MARGIN.top - MARGIN.bottom}
        />
      )}
      {contributions !== null && <Contributions frame={frame} bands={contributions} />}
      <Grid frame={frame} />
      <g class="curves">
        {shown.map(
          (c) =>
            ghosts?.[c] &&
            drawn[c] && <path key={`ghost${c}`} class={`ghost ${name(c)}`} d={pathOf(frame, ghosts[c])} />,
        )}
        {shown.map((c) => (
          <path
            key={`line${c}`}
            class={`line ${name(c)} ${active.includes(c) ? "active" : ""}`}
            d={pathOf(frame, lines[c] ?? [])}
          />
        ))}
      </g>
      {children}
    </>
  );
}
