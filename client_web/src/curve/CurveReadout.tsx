/** One line under the plot: where the pointer is, where a pixel's light comes from, or what to do. */
import { formatNumber } from "../ui/scale";
import { valueAt, type CurveAxes } from "./model/axes";
import type { CurveModel } from "./model/model";
import { mainInterval } from "./model/interval";
import { curveTool } from "./curveView";
import { pickedPoint, selectedInterval, type PlotSpot } from "./curveTools";

const HINTS = {
  draw: "Draw over the curve. By keys: use points.",
  points: "Click to add a point, drag to move it. Delete removes, R resets.",
  stretch: "Drag across to select a stretch, then drag it up or along.",
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
  if (!ready) return "Waiting for the curve from the server…";
  if (spot !== null && !blocked) {
    const value = formatNumber(valueAt(axes, Math.max(0, spot.height)));
    return `${spot.degrees.toFixed(2)}°  ·  ${value}`;
  }
  if (contributions !== null) {
    const main = contributions.fraction === 0 ? null : mainInterval(contributions.bands);
    if (main === null) return "Next to none of this pixel's light comes through this curve.";
    const percent = Math.max(1, Math.round(100 * contributions.fraction));
    return `${percent} % of this pixel comes through here, most from ${main[0].toFixed(1)}° to ${main[1].toFixed(1)}°`;
  }
  if (blocked) return "Red, green and blue differ: choose one of them, or join them.";
  if (curveTool.value === "points" && pickedPoint.value?.carried) return "Now click where this point goes. Escape leaves it.";
  if (curveTool.value === "stretch" && selectedInterval.value !== null) return "↑ ↓ scale, ← → shift, Shift for fine steps.";
  return HINTS[curveTool.value];
}

export function CurveReadout(props: Props) {
  return <p class="readout">{readoutText(props)}</p>;
}
