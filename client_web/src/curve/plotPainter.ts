/** Paints the plot: grid, contributions of a pixel, generated curves, edited curves, marks. One small canvas paints much
 * faster than many elements, and does not repaint its surroundings. */
import type { Point } from "../protocol";
import { tickLabel } from "../ui/scale";
import { MAX_DEGREES, xTicks, yTicks } from "./model/axes";
import { innerRect, plotX, plotY, type PlotFrame } from "./plotScale";

export interface PlotContent {
  lines: Point[][];
  generatedLines: Point[][] | null;
  /** Channels whose curve differs from the generated one. */
  drawn: boolean[];
  /** True if red, green and blue share one curve. */
  areJoined: boolean;
  active: number[];
  /** Contributions per channel and band to the pixel under the pointer. */
  contributions: number[][] | null;
  interval: [number, number] | null;
  /** Angle under the pointer. */
  cursor: number | null;
  /** Draggable points; `offered` ones are not part of the look yet. */
  points: Point[] | null;
  offered: boolean;
}

interface Palette {
  accent: string;
  quiet: string;
  channels: [string, string, string];
  font: string;
}

let palette: Palette | null = null;

/** The page's colors, read once. */
function readPalette(): Palette {
  if (palette !== null) return palette;
  const style = getComputedStyle(document.documentElement);
  const propertyValue = (name: string) => style.getPropertyValue(`--${name}`).trim();
  palette = {
    accent: propertyValue("accent"),
    quiet: propertyValue("quiet"),
    channels: [propertyValue("red"), propertyValue("green"), propertyValue("blue")],
    font: `10.5px ${style.fontFamily}`,
  };
  return palette;
}

function traceLine(ctx: CanvasRenderingContext2D, frame: PlotFrame, line: readonly Point[]): void {
  ctx.beginPath();
  for (const [x, y] of line) ctx.lineTo(plotX(frame, x), plotY(frame, y));
}

function drawRule(ctx: CanvasRenderingContext2D, x1: number, y1: number, x2: number, y2: number): void {
  ctx.beginPath();
  // at a pixel center a line is one pixel wide
  ctx.moveTo(Math.round(x1) + 0.5, Math.round(y1) + 0.5);
  ctx.lineTo(Math.round(x2) + 0.5, Math.round(y2) + 0.5);
  ctx.stroke();
}

function paintGrid(ctx: CanvasRenderingContext2D, frame: PlotFrame): void {
  const { quiet, font } = readPalette();
  const { left, right, top, base } = innerRect(frame);
  ctx.lineWidth = 1;
  ctx.strokeStyle = "#2b2b2b";
  ctx.fillStyle = quiet;
  ctx.font = font;
  ctx.textAlign = "right";
  for (const value of yTicks(frame.axes)) {
    drawRule(ctx, left, plotY(frame, value), right, plotY(frame, value));
    ctx.fillText(tickLabel(value), left - 5, plotY(frame, value) + 3.5);
  }
  for (const degrees of xTicks(frame.axes)) {
    drawRule(ctx, plotX(frame, degrees), top, plotX(frame, degrees), base);
    ctx.textAlign = degrees === MAX_DEGREES ? "right" : "center";
    ctx.fillText(`${degrees}°`, plotX(frame, degrees), base + 14);
  }
  ctx.strokeStyle = "#555";
  drawRule(ctx, left, base, right, base);
}

/** The contribution of each angle to the pixel under the pointer, relative to its largest band. */
function paintContributions(ctx: CanvasRenderingContext2D, frame: PlotFrame, bands: number[][]): void {
  const largest = Math.max(1e-12, ...bands.flat());
  const { left, top, base } = innerRect(frame);
  ctx.globalCompositeOperation = "screen";
  ctx.globalAlpha = 0.42;
  bands.forEach((channel, c) => {
    const width = MAX_DEGREES / channel.length;
    ctx.beginPath();
    ctx.moveTo(left, base);
    channel.forEach((value, j) => {
      const y = base - 0.92 * (base - top) * Math.max(0, value / largest);
      ctx.lineTo(plotX(frame, j * width), y);
      ctx.lineTo(plotX(frame, (j + 1) * width), y);
    });
    ctx.lineTo(plotX(frame, MAX_DEGREES), base);
    ctx.fillStyle = ["#b0473c", "#3f9a4c", "#4468c0"][c] as string;
    ctx.fill();
  });
  ctx.globalAlpha = 1;
  ctx.globalCompositeOperation = "source-over";
}

function paintCurves(ctx: CanvasRenderingContext2D, frame: PlotFrame, content: PlotContent): void {
  const { lines, generatedLines, drawn, areJoined, active } = content;
  const { channels } = readPalette();
  const displayedChannels = areJoined ? [0] : [0, 1, 2];
  ctx.globalCompositeOperation = "screen";
  ctx.lineJoin = "round";
  ctx.setLineDash([3, 3]);
  ctx.lineWidth = 1.2;
  for (const c of displayedChannels) {
    const generatedLine = generatedLines?.[c];
    if (generatedLine === undefined || !drawn[c]) continue;
    ctx.strokeStyle = areJoined ? "#8c8c8c" : (["#a05550", "#4c8753", "#5475a5"][c] as string);
    traceLine(ctx, frame, generatedLine);
    ctx.stroke();
  }
  ctx.setLineDash([]);
  ctx.lineWidth = 1.6;
  for (const c of displayedChannels) {
    ctx.globalAlpha = active.includes(c) ? 1 : 0.45;
    ctx.strokeStyle = areJoined ? "#f2f2f2" : (channels[c] as string);
    traceLine(ctx, frame, lines[c] ?? []);
    ctx.stroke();
  }
  ctx.globalAlpha = 1;
  ctx.globalCompositeOperation = "source-over";
}

function paintInterval(ctx: CanvasRenderingContext2D, frame: PlotFrame, [from, to]: [number, number]): void {
  const { top, base } = innerRect(frame);
  const { accent } = readPalette();
  const x = Math.round(plotX(frame, from)) + 0.5;
  const width = Math.max(1, Math.round(plotX(frame, to) - plotX(frame, from)));
  ctx.fillStyle = `${accent}24`;
  ctx.fillRect(x, top, width, base - top);
  ctx.strokeStyle = accent;
  ctx.lineWidth = 1;
  ctx.strokeRect(x, top + 0.5, width, base - top);
}

function paintMarks(ctx: CanvasRenderingContext2D, frame: PlotFrame, points: Point[], offered: boolean): void {
  ctx.lineWidth = 1.6;
  ctx.fillStyle = "#171717";
  ctx.strokeStyle = offered ? "#9a9a9a" : "#fff";
  for (const [degrees, value] of points) {
    ctx.beginPath();
    ctx.arc(plotX(frame, degrees), plotY(frame, value), 4, 0, 2 * Math.PI);
    ctx.fill();
    ctx.stroke();
  }
}

/** Paint everything; lengths are CSS pixels. */
export function paintPlot(canvas: HTMLCanvasElement, frame: PlotFrame, content: PlotContent): void {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [Math.round(frame.width * ratio), Math.round(frame.height * ratio)];
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  const ctx = canvas.getContext("2d", { alpha: false });
  if (ctx === null) return;
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.fillStyle = "#171717";
  ctx.fillRect(0, 0, frame.width, frame.height);
  if (content.interval !== null) paintInterval(ctx, frame, content.interval);
  if (content.contributions !== null) paintContributions(ctx, frame, content.contributions);
  paintGrid(ctx, frame);
  paintCurves(ctx, frame, content);
  if (content.cursor !== null) {
    const { top, base } = innerRect(frame);
    ctx.strokeStyle = "#6a6a6a";
    ctx.lineWidth = 1;
    drawRule(ctx, plotX(frame, content.cursor), top, plotX(frame, content.cursor), base);
  }
  if (content.points !== null) paintMarks(ctx, frame, content.points, content.offered);
}
