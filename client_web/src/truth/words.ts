/** What a comparison with brute force says, in sentences. */
import type { TruthBody } from "../protocol";

/** Share of the pixels of a perfect frame that are called different. */
const BY_CHANCE = 0.01;

function percent(share: number): string {
  const value = 100 * share;
  return `${value.toFixed(value < 1 ? 2 : 1)} %`;
}

export function progressWords(truth: Pick<TruthBody, "state" | "passes" | "total" | "problem">): string {
  switch (truth.state) {
    case "queued":
      return "Waits for its turn";
    case "running":
      return `Brute force: pass ${Math.min(truth.passes + 1, truth.total)} of ${truth.total}`;
    case "ready":
      return `Brute force: ${truth.total} passes`;
    case "failed":
      return truth.problem ?? "The comparison failed.";
  }
}

/** One sentence each: the frame's error, how sure that is, and how much of the picture differs. */
export function findings(found: NonNullable<TruthBody["found"]>): string[] {
  const error = found.error === 0 ? "No error beyond the noise of brute force" : `The frame errs by ${percent(found.error)}`;
  const more = found.significant > 2 * BY_CHANCE;
  return [
    `${error} (relative RMSE).`,
    `The noise of brute force is ${percent(found.noise)}; more passes lower it.`,
    more
      ? `${percent(found.significant)} of the pixels differ by more than noise explains: they are coloured.`
      : "No more pixels differ than would by chance.",
  ];
}
