/** The phase of a bake as text: a bar alone would stand still for a minute without saying why. */
import { useEffect, useRef, useState } from "preact/hooks";
import type { BakeBody } from "../../protocol";
import type { BakeStatus } from "../../state/bakes";
import { formatEstimatedTime } from "../../ui/scale";

const PREPARATION_LABELS = {
  starting: "starting worker processes",
  loading: "loading the kernels",
  reading: "reading the scene",
  building: "sorting its triangles",
  compiling: "compiling kernels, once on this machine",
  publishing: "checking what was baked",
} as const;

function isPreparing(phase: BakeBody["phase"]): phase is keyof typeof PREPARATION_LABELS {
  return phase !== null && phase in PREPARATION_LABELS;
}

/** Whether so much is known that a bar can show it. */
export function hasProgress(bake: BakeStatus): boolean {
  return bake.progress > 0 || bake.phase === "sampling" || bake.phase === "tracing";
}

/** What it is at, without numbers that run. */
export function phaseText(bake: BakeStatus): string {
  if (bake.state === "queued") {
    const ahead = bake.queue_position ?? 0;
    return ahead === 0 ? "waits for its turn" : `waits for ${ahead} ${ahead === 1 ? "bake" : "bakes"} before it`;
  }
  if (bake.state !== "running") return `bake ${bake.state}`;
  return isPreparing(bake.phase) ? PREPARATION_LABELS[bake.phase] : "baking";
}

/** The same with how long it has been at it, in seconds, or how far it is. A time left is said only where something
 * tells it. */
export function bakeProgressText(bake: BakeStatus, elapsed: number): string {
  const phase = phaseText(bake);
  if (bake.state !== "running") return phase;
  if (isPreparing(bake.phase)) return `${phase}, ${Math.floor(elapsed)} s`;
  const left = bake.seconds_left === null ? "estimating the time…" : `${formatEstimatedTime(bake.seconds_left)} left`;
  return `${phase}, ${Math.round(100 * bake.progress)} %, ${left}`;
}

/** Seconds that a bake has been at what it does, counted on here between two messages. */
export function useElapsedSeconds(bake: BakeStatus | null): number {
  const [, count] = useState(0);
  const phaseStart = useRef({ what: "", at: 0 });
  const phaseKey = bake === null || bake.phase === null ? "" : `${bake.id} ${bake.phase}`;
  const startTime = Date.now() - 1000 * (bake?.phase_seconds ?? 0);
  // not every message says how long it has been
  if (phaseStart.current.what !== phaseKey || startTime < phaseStart.current.at) phaseStart.current = { what: phaseKey, at: startTime };
  useEffect(() => {
    if (phaseKey === "") return undefined;
    const timer = window.setInterval(() => count((seconds) => seconds + 1), 1000);
    return () => clearInterval(timer);
  }, [phaseKey]);
  return (Date.now() - phaseStart.current.at) / 1000;
}
