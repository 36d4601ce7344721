/** The plot's scale: from angles and values to CSS pixels and back. */
import { degreesAt, xFraction, yFraction, type CurveAxes } from "./model/axes";

export interface PlotFrame {
  width: number;
  height: number;
  axes: CurveAxes;
}

const MARGIN = { left: 40, right: 10, top: 10, bottom: 20 };

/** Edges of the area between the axes. */
export function innerRect(frame: PlotFrame): { left: number; right: number; top: number; base: number } {
  return {
    left: MARGIN.left,
    right: frame.width - MARGIN.right,
    top: MARGIN.top,
    base: frame.height - MARGIN.bottom,
  };
}

export function plotX(frame: PlotFrame, degrees: number): number {
  const { left, right } = innerRect(frame);
  return left + xFraction(frame.axes, degrees) * (right - left);
}

export function plotY(frame: PlotFrame, value: number): number {
  const { top, base } = innerRect(frame);
  return top + (1 - Math.min(1.02, yFraction(frame.axes, value))) * (base - top);
}

/** Angle, and fraction of the plot's height (may lie outside 0…1), at a position in the plot. */
export function degreesAndValueAt(frame: PlotFrame, x: number, y: number): { degrees: number; height: number } {
  const { left, right, top, base } = innerRect(frame);
  return { degrees: degreesAt(frame.axes, (x - left) / (right - left)), height: 1 - (y - top) / (base - top) };
}
