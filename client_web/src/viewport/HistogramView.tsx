/** Histogram, waveform or RGB parade of the displayed image, computed when input pauses. */
import { useLayoutEffect, useMemo, useRef } from "preact/hooks";
import { computeHistogram, MAX_STOP, MIN_STOP, NUM_BINS, percentile, type Histogram } from "../render/histogram";
import { stage } from "../render/renderStage";
import { computeWaveform, summarizeWaveform, type Waveform } from "../render/waveform";
import { bake } from "../state/bakes";
import { displayTransform } from "../state/color";
import { isFrameExact } from "../state/fidelity";
import { histogramOpen, scope, type Scope } from "../state/panels";
import { RadioRow, type RadioOption } from "../ui/RadioRow";
import { paintWaveform } from "./paintWaveform";
import { useIdleFrame } from "./useIdleFrame";

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

/** Columns of the waveform, and of each channel of the parade. */
const WAVEFORM_COLUMNS = { waveform: WIDTH / 2, parade: WIDTH / 3 };

const SCOPES: readonly RadioOption<Scope>[] = [
  { value: "histogram", label: "Histogram", title: "Luminance and channels in stops" },
  { value: "waveform", label: "Waveform", title: "Luma of display values, by column of the image" },
  { value: "parade", label: "Parade", title: "Red, green and blue of display values, by column of the image" },
];

type Scoped = { scope: "histogram"; histogram: Histogram } | { scope: "waveform" | "parade"; waveform: Waveform };

/** The scope's values once frames pause, and whether the image was exact. */
function useScope(scope: Scope): { values: Scoped; isExact: boolean } | null {
  const idleFrame = useIdleFrame();
  void bake.value; // another scene may have a view of the same name
  const [image, transform, isExact] = [stage.active, displayTransform.value, isFrameExact.value];
  return useMemo(() => {
    const { hasPixels, pixels } = image;
    if (idleFrame < 0 || !hasPixels) return null;
    const values: Scoped =
      scope === "histogram"
        ? { scope, histogram: computeHistogram(pixels.encoded, transform.matrix) }
        : { scope, waveform: computeWaveform(pixels, transform, WAVEFORM_COLUMNS[scope], HEIGHT) };
    return { values, isExact };
  }, [idleFrame, image, transform, isExact, scope]);
}

function paint(canvas: HTMLCanvasElement, values: Scoped): void {
  if (values.scope === "histogram") paintHistogram(canvas, values.histogram);
  else paintWaveform(canvas, values.waveform, values.scope === "parade", [WIDTH, HEIGHT]);
}

const LABELS: Record<Scope, string> = {
  histogram: "Histogram, stops relative to middle gray",
  waveform: "Waveform, display values in percent",
  parade: "RGB parade, display values in percent",
};

function Scopes() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const scoped = useScope(scope.value);
  useLayoutEffect(() => {
    if (scoped !== null) paint(canvas.current as HTMLCanvasElement, scoped.values);
  }, [scoped]);
  const summary = (values: Scoped) =>
    values.scope === "histogram" ? summarize(values.histogram) : summarizeWaveform(values.waveform);
  const text =
    scoped === null ? "Waiting for the picture…" : `${scoped.isExact ? "" : "Approximate: "}${summary(scoped.values)}`;
  return (
    <figure class="histogram" aria-label={LABELS[scope.value]}>
      <RadioRow label="Scope" choices={SCOPES} selected={scope.value} onSelect={(value) => (scope.value = value)} />
      <canvas ref={canvas} aria-hidden="true" style={{ width: `${WIDTH}px`, height: `${HEIGHT}px` }} />
      <figcaption>{text}</figcaption>
    </figure>
  );
}

export function HistogramView() {
  return histogramOpen.value ? <Scopes /> : null;
}
