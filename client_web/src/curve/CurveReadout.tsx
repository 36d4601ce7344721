/** The line under the plot: pointer position, the curve's contribution to a pixel, or a hint. */
import { formatNumber } from "../ui/scale";
import { valueAt, type CurveAxes } from "./model/axes";
import type { CurveModel } from "./model/model";
import { mainInterval } from "./model/interval";
import { curveTool } from "./curveView";
import { pickedPoint, selectedInterval, type PlotSpot } from "./curveTools";

const HINTS = {
  draw: "Draw over the curve. With the keyboard, use points.",
  points: "Click to add a point, drag to move it. Delete removes, R resets.",
  stretch: "Drag to select a range, then drag it up or sideways.",
};

export interface Contributions {
  /** Per channel and band, radiance. */
  bands: number[][];
  /** Of the pixel's radiance, 0…1. */
  fraction: number;
}

interface Props {
  model: CurveModel;
  axes: CurveAxes;
  spot: PlotSpot | null;
  ready: boolean;
  blocked: boolean;
  contributions: Contributions | null;
}

function readoutText({ axes, spot, ready, blocked, contributions }: Props): string {
  if (!ready) return "Loading curve…";
  if (spot !== null && !blocked) {
    const value = formatNumber(valueAt(axes, Math.max(0, spot.height)));
    return `${spot.degrees.toFixed(2)}°  ·  ${value}`;
  }
  if (contributions !== null) {
    const main = contributions.fraction === 0 ? null : mainInterval(contributions.bands);
    if (main === null) return "This curve barely affects this pixel.";
    const percent = Math.max(1, Math.round(100 * contributions.fraction));
    return `This curve makes ${percent} % of the pixel, mostly ${main[0].toFixed(1)}°–${main[1].toFixed(1)}°`;
  }
  if (blocked) return "R, G and B differ: pick one or Link them.";
  if (curveTool.value === "points" && pickedPoint.value?.carried) return "Click to place the point. Escape cancels.";
  if (curveTool.value === "stretch" && selectedInterval.value !== null)
    return "↑ ↓ scale, ← → move, Shift for fine steps.";
  return HINTS[curveTool.value];
}

export function CurveReadout(props: Props) {
  return <p class="readout">{readoutText(props)}</p>;
}
