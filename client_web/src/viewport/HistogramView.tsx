/** The shown picture's histogram, made when the hand rests. */
import { useEffect, useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import { histogramOf, MAX_STOP, MIN_STOP, NUM_BINS, percentile, type Histogram } from "../picture/histogram";
import { stage } from "../picture/stage";
import { bake } from "../state/bakes";
import { drawn } from "../state/display";
import { exact } from "../state/fidelity";
import { exposure } from "../state/look";
import { histogramOpen } from "../state/panels";
import { viewName } from "../state/views";

const WIDTH = 252;
const HEIGHT = 84;
const AXIS = 14;

function signed(stop: number): string {
  return `${stop < 0 ? "−" : "+"}${Math.abs(stop).toFixed(1)}`;
}

function summary(histogram: Histogram): string {
  const [low, middle, high] = [0.01, 0.5, 0.99].map((share) => signed(percentile(histogram, share)));
  return `median ${middle}, 98 % from ${low} to ${high} stops`;
}

function area(ctx: CanvasRenderingContext2D, bins: Uint32Array, largest: number): void {
  const base = HEIGHT - AXIS;
  const step = WIDTH / NUM_BINS;
  ctx.beginPath();
  ctx.moveTo(0, base);
  bins.forEach((n, i) => {
    // square roots keep small shares visible
    const y = base - (base - 4) * Math.sqrt(n / largest);
    ctx.lineTo(i * step, y);
    ctx.lineTo((i + 1) * step, y);
  });
  ctx.lineTo(WIDTH, base);
}

function paint(canvas: HTMLCanvasElement, histogram: Histogram): void {
  const ratio = window.devicePixelRatio || 1;
  [canvas.width, canvas.height] = [WIDTH * ratio, HEIGHT * ratio];
  const ctx = canvas.getContext("2d");
  if (ctx === null) return;
  const style = getComputedStyle(canvas);
  ctx.scale(ratio, ratio);
  const all = [histogram.luminance, ...histogram.channels];
  const largest = Math.max(1, ...all.map((bins) => bins.reduce((a, b) => Math.max(a, b), 0)));
  ctx.fillStyle = "#5c5c5c";
  area(ctx, histogram.luminance, largest);
  ctx.fill();
  histogram.channels.forEach((bins, c) => {
    ctx.strokeStyle = style.getPropertyValue(["--red", "--green", "--blue"][c] as string);
    area(ctx, bins, largest);
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

const REST_MS = 250; // after the last frame

/** Of the picture that is shown once no more frames come, and whether that was exact. */
function useHistogram(): { histogram: Histogram; isExact: boolean } | null {
  const [rested, setRested] = useState(-1);
  const frame = drawn.value;
  useEffect(() => {
    const timer = setTimeout(() => setRested(frame), REST_MS);
    return () => clearTimeout(timer);
  }, [frame]);
  return useMemo(() => {
    const { isThere, pixels } = stage.active;
    return rested < 0 || !isThere ? null : { histogram: histogramOf(pixels.words, exposure.value), isExact: exact.value };
  }, [rested, exact.value, exposure.value, bake.value, viewName.value]);
}

function Bars() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const found = useHistogram();
  useLayoutEffect(() => {
    if (found !== null) paint(canvas.current as HTMLCanvasElement, found.histogram);
  }, [found]);
  const words = found === null ? "Waiting for the picture" : `${found.isExact ? "" : "not exact yet: "}${summary(found.histogram)}`;
  return (
    <figure class="histogram" aria-label="Histogram, stops about middle grey">
      <canvas ref={canvas} aria-hidden="true" style={{ width: `${WIDTH}px`, height: `${HEIGHT}px` }} />
      <figcaption>{words}</figcaption>
    </figure>
  );
}

export function HistogramView() {
  return histogramOpen.value ? <Bars /> : null;
}
