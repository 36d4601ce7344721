/** Histogram of the displayed image, computed when input pauses. */
import { useEffect, useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import { computeHistogram, MAX_STOP, MIN_STOP, NUM_BINS, percentile, type Histogram } from "../render/histogram";
import { stage } from "../render/renderStage";
import { bake } from "../state/bakes";
import { displayedFrames } from "../state/display";
import { isFrameExact } from "../state/fidelity";
import { displayGain } from "../state/look";
import { histogramOpen } from "../state/panels";

const WIDTH = 252;
const HEIGHT = 84;
const AXIS = 14;

function formatStop(stop: number): string {
  return `${stop < 0 ? "−" : "+"}${Math.abs(stop).toFixed(1)}`;
}

function summarize(histogram: Histogram): string {
  const [low, middle, high] = [0.01, 0.5, 0.99].map((fraction) => formatStop(percentile(histogram, fraction)));
  return `Median ${middle}, 98 % in ${low} to ${high} stops`;
}

function paintArea(ctx: CanvasRenderingContext2D, bins: Uint32Array, largest: number): void {
  const base = HEIGHT - AXIS;
  const step = WIDTH / NUM_BINS;
  ctx.beginPath();
  ctx.moveTo(0, base);
  bins.forEach((n, i) => {
    // square roots keep small fractions visible
    const y = base - (base - 4) * Math.sqrt(n / largest);
    ctx.lineTo(i * step, y);
    ctx.lineTo((i + 1) * step, y);
  });
  ctx.lineTo(WIDTH, base);
}

function paintHistogram(canvas: HTMLCanvasElement, histogram: Histogram): void {
  const ratio = window.devicePixelRatio || 1;
  [canvas.width, canvas.height] = [WIDTH * ratio, HEIGHT * ratio];
  const ctx = canvas.getContext("2d");
  if (ctx === null) return;
  const style = getComputedStyle(canvas);
  ctx.scale(ratio, ratio);
  const all = [histogram.luminance, ...histogram.channels];
  const largest = Math.max(1, ...all.map((bins) => bins.reduce((a, b) => Math.max(a, b), 0)));
  ctx.fillStyle = "#5c5c5c";
  paintArea(ctx, histogram.luminance, largest);
  ctx.fill();
  histogram.channels.forEach((bins, c) => {
    ctx.strokeStyle = style.getPropertyValue(["--red", "--green", "--blue"][c] as string);
    paintArea(ctx, bins, largest);
    ctx.stroke();
  });
  ctx.fillStyle = style.color;
  ctx.font = `10px ${style.fontFamily}`;
  ctx.textAlign = "center";
  for (let stop = MIN_STOP + 2; stop < MAX_STOP; stop += 2) {
    const x = (WIDTH * (stop - MIN_STOP)) / (MAX_STOP - MIN_STOP);
    ctx.fillRect(x, HEIGHT - AXIS, 1, 3);
    ctx.fillText(stop > 0 ? `+${stop}` : String(stop).replace("-", "−"), x, HEIGHT - 1);
  }
}

const IDLE_MS = 250; // after the last frame

/** The histogram once frames pause, and whether the image was exact. */
function useHistogram(): { histogram: Histogram; isExact: boolean } | null {
  const [idleFrame, setIdleFrame] = useState(-1);
  const frame = displayedFrames.value;
  useEffect(() => {
    const timer = setTimeout(() => setIdleFrame(frame), IDLE_MS);
    return () => clearTimeout(timer);
  }, [frame]);
  void bake.value; // another scene may have a view of the same name
  const [image, matrix, isExact] = [stage.active, displayGain.value, isFrameExact.value];
  return useMemo(() => {
    const { hasPixels, pixels } = image;
    return idleFrame < 0 || !hasPixels ? null : { histogram: computeHistogram(pixels.encoded, matrix), isExact };
  }, [idleFrame, image, matrix, isExact]);
}

function HistogramBars() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const histogram = useHistogram();
  useLayoutEffect(() => {
    if (histogram !== null) paintHistogram(canvas.current as HTMLCanvasElement, histogram.histogram);
  }, [histogram]);
  const summaryText =
    histogram === null
      ? "Waiting for the picture…"
      : `${histogram.isExact ? "" : "Approximate: "}${summarize(histogram.histogram)}`;
  return (
    <figure class="histogram" aria-label="Histogram, stops relative to middle gray">
      <canvas ref={canvas} aria-hidden="true" style={{ width: `${WIDTH}px`, height: `${HEIGHT}px` }} />
      <figcaption>{summaryText}</figcaption>
    </figure>
  );
}

export function HistogramView() {
  return histogramOpen.value ? <HistogramBars /> : null;
}
