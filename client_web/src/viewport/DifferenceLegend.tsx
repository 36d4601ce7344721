/** Legend of the difference A − B: its scale, mean and maximum. */
import { useMemo } from "preact/hooks";
import { RANGES, SCALES } from "../render/color/difference";
import { summarizeDifference, type DifferenceSummary } from "../render/differenceSummary";
import { stage } from "../render/renderStage";
import type { Rgb } from "../protocol";
import { displayTransform } from "../state/color";
import { difference } from "../state/display";
import { useIdleFrame } from "./useIdleFrame";

const UNITS = { stops: "stops, A brighter: +", delta_e: "ΔE ITP" } as const;
const TICKS = {
  stops: [`−${RANGES.stops}`, "0", `+${RANGES.stops}`],
  delta_e: ["0", String(RANGES.delta_e / 2), String(RANGES.delta_e)],
} as const;

const colorText = (color: Rgb): string => `rgb(${color.map((v) => Math.round(255 * v)).join(" ")})`;
const numberText = (value: number): string => value.toFixed(2).replace("-", "−");

export function differenceText({ mean, maximum, step }: DifferenceSummary): string {
  const sampled = step > 1 ? ` (1 of ${step} pixels)` : "";
  return `Mean ${numberText(mean)}, largest ${numberText(maximum)}${sampled}`;
}

function useSummary(): string {
  const frame = useIdleFrame();
  const [mode, transform, image] = [difference.value, displayTransform.value, stage.active];
  return useMemo(() => {
    const { reference, display, pixels } = image;
    if (frame < 0 || mode === "off" || reference === null) return "Waiting for A…";
    if (display !== null) return "Waiting for the full picture…";
    const summary = summarizeDifference(reference, pixels, transform, mode);
    return summary === null ? "A and B have different sizes" : differenceText(summary);
  }, [frame, mode, transform, image]);
}

function Legend({ mode }: { mode: "stops" | "delta_e" }) {
  const summary = useSummary();
  return (
    <div class="legend difference" aria-label="Difference between A and B">
      <i style={{ background: `linear-gradient(to right, ${SCALES[mode].map(colorText).join(", ")})` }} />
      <div class="ticks">
        {TICKS[mode].map((tick) => (
          <span key={tick}>{tick}</span>
        ))}
      </div>
      <span class="unit">{UNITS[mode]}</span>
      <p role="status">{summary}</p>
    </div>
  );
}

export function DifferenceLegend() {
  return difference.value === "off" ? null : <Legend mode={difference.value} />;
}
