/** The phase of a bake as text, since the progress bar alone may stand still for a minute. */
import { useEffect, useRef, useState } from "preact/hooks";
import type { BakeBody } from "../../protocol";
import type { BakeStatus } from "../../state/bakes";
import { formatEstimatedTime } from "../../ui/scale";

const PREPARATION_LABELS = {
  starting: "starting workers",
  loading: "starting the renderer",
  reading: "loading the scene",
  building: "building the BVH",
  compiling: "compiling kernels (first run only)",
  publishing: "verifying",
} as const;

function isPreparing(phase: BakeBody["phase"]): phase is keyof typeof PREPARATION_LABELS {
  return phase !== null && phase in PREPARATION_LABELS;
}

/** True if the progress is known. */
export function hasProgress(bake: BakeStatus): boolean {
  return bake.progress > 0 || bake.phase === "sampling" || bake.phase === "tracing";
}

/** The current phase, without running numbers. */
export function phaseText(bake: BakeStatus): string {
  if (bake.state === "queued") {
    const ahead = bake.queue_position ?? 0;
    return ahead === 0 ? "queued" : `queued after ${ahead} ${ahead === 1 ? "bake" : "bakes"}`;
  }
  if (bake.state !== "running") return `bake ${bake.state}`;
  return isPreparing(bake.phase) ? PREPARATION_LABELS[bake.phase] : "baking";
}

/** The current phase with elapsed seconds, or progress and remaining time if known. */
export function bakeProgressText(bake: BakeStatus, elapsed: number): string {
  const phase = phaseText(bake);
  if (bake.state !== "running") return phase;
  if (isPreparing(bake.phase)) return `${phase}, ${Math.floor(elapsed)} s`;
  const left = bake.seconds_left === null ? "estimating time…" : `${formatEstimatedTime(bake.seconds_left)} left`;
  return `${phase}, ${Math.round(100 * bake.progress)} %, ${left}`;
}

/** Elapsed seconds of a bake's phase, counted locally between messages. */
export function useElapsedSeconds(bake: BakeStatus | null): number {
  const [, count] = useState(0);
  const phaseStart = useRef({ key: "", at: 0 });
  const phaseKey = bake === null || bake.phase === null ? "" : `${bake.id} ${bake.phase}`;
  const startTime = Date.now() - 1000 * (bake?.phase_seconds ?? 0);
  // not every message has the elapsed time
  if (phaseStart.current.key !== phaseKey || startTime < phaseStart.current.at)
    phaseStart.current = { key: phaseKey, at: startTime };
  useEffect(() => {
    if (phaseKey === "") return undefined;
    const timer = window.setInterval(() => count((seconds) => seconds + 1), 1000);
    return () => clearInterval(timer);
  }, [phaseKey]);
  return (Date.now() - phaseStart.current.at) / 1000;
}
