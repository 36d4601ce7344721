/** What a bake is at, in words: a bar alone would stand still for a minute without saying why. */
import { useEffect, useRef, useState } from "preact/hooks";
import type { BakeBody } from "../protocol";
import type { Baking } from "../state/bakes";
import { formatForeseen } from "../ui/scale";

const PREPARING = {
  starting: "starting worker processes",
  loading: "loading the kernels",
  reading: "reading the scene",
  building: "sorting its triangles",
  compiling: "compiling kernels, once on this machine",
  publishing: "checking what was baked",
} as const;

function isPreparing(phase: BakeBody["phase"]): phase is keyof typeof PREPARING {
  return phase !== null && phase in PREPARING;
}

/** Whether so much is known that a bar can show it. */
export function hasProgress(bake: Baking): boolean {
  return bake.progress > 0 || bake.phase === "sampling" || bake.phase === "tracing";
}

/** What it is at, without numbers that run. */
export function phaseWords(bake: Baking): string {
  if (bake.state === "queued") {
    const ahead = bake.ahead ?? 0;
    return ahead === 0 ? "waits for its turn" : `waits for ${ahead} ${ahead === 1 ? "bake" : "bakes"} before it`;
  }
  if (bake.state !== "running") return `bake ${bake.state}`;
  return isPreparing(bake.phase) ? PREPARING[bake.phase] : "baking";
}

/** The same with how long it has been at it, in seconds, or how far it is. A time left is said only where something
 * tells it. */
export function bakingWords(bake: Baking, elapsed: number): string {
  const words = phaseWords(bake);
  if (bake.state !== "running") return words;
  if (isPreparing(bake.phase)) return `${words}, ${Math.floor(elapsed)} s`;
  const left = bake.seconds_left === null ? "estimating the time…" : `${formatForeseen(bake.seconds_left)} left`;
  return `${words}, ${Math.round(100 * bake.progress)} %, ${left}`;
}

/** Seconds that a bake has been at what it does, counted on here between two messages. */
export function useElapsed(bake: Baking | null): number {
  const [, count] = useState(0);
  const began = useRef({ what: "", at: 0 });
  const what = bake === null || bake.phase === null ? "" : `${bake.id} ${bake.phase}`;
  const at = Date.now() - 1000 * (bake?.phase_seconds ?? 0);
  // not every message says how long it has been
  if (began.current.what !== what || at < began.current.at) began.current = { what, at };
  useEffect(() => {
    if (what === "") return undefined;
    const timer = window.setInterval(() => count((seconds) => seconds + 1), 1000);
    return () => clearInterval(timer);
  }, [what]);
  return (Date.now() - began.current.at) / 1000;
}
