/** What a comparison with brute force says, in sentences. */
import type { TruthBody } from "../protocol";
import { formatSeconds } from "../ui/scale";

function percent(share: number): string {
  const value = 100 * share;
  return `${value.toFixed(value < 1 ? 2 : 1)} %`;
}

/** How long it takes, before it begins. */
export function planWords(plan: { passes: number; seconds: number } | "unknown" | null): string {
  if (plan === null) return "Finding out how long it takes…";
  if (plan === "unknown") return "How long it takes is not known now; it is said while it runs.";
  return `${plan.passes} passes of brute force: about ${formatSeconds(plan.seconds)}.`;
}

type Progress = Pick<TruthBody, "state" | "passes" | "total" | "problem" | "seconds_left">;

export function progressWords(truth: Progress): string {
  switch (truth.state) {
    case "queued":
      return "Waits for its turn";
    case "running": {
      const left = truth.seconds_left === null ? "" : `, ${formatSeconds(truth.seconds_left)} left`;
      return `Brute force: pass ${Math.min(truth.passes + 1, truth.total)} of ${truth.total}${left}`;
    }
    case "ready":
      return `Brute force: ${truth.total} passes`;
    case "stopped":
      return `Stopped after ${truth.passes} of ${truth.total} passes`;
    case "failed":
      return truth.problem ?? "The comparison failed.";
  }
}

/** What one test has found: whether pixels differ, by how much the frame errs, and what the noise would hide. */
export function findings(found: NonNullable<TruthBody["found"]>): string[] {
  const noise = `The noise of brute force is ${percent(found.noise)}; more passes lower it.`;
  if (found.significant === 0) {
    return ["No difference was found.", `The frame's error is less than the noise: below ${percent(found.limit)} (relative RMSE).`, noise];
  }
  const differ = `${percent(found.significant)} of the pixels differ by more than noise explains: they are coloured.`;
  const error =
    found.error === null
      ? `Over the whole picture that is less than the noise: below ${percent(found.limit)} (relative RMSE).`
      : `The frame errs by ${percent(found.error)} (relative RMSE).`;
  return [differ, error, noise];
}
