/** What a comparison with brute force says, in sentences. */
import type { TruthBody, TruthPlanBody } from "../protocol";
import { formatForeseen, formatSeconds } from "../ui/scale";

/** A share in per cent, with no more digits than its standard error lets it have. */
export function percent(share: number, error?: number): string {
  const size = 100 * (error ?? share);
  const digits = size > 0 ? Math.min(4, Math.max(0, (error === undefined ? 1 : 0) - Math.floor(Math.log10(size)))) : 2;
  const more = error === undefined ? "" : ` ± ${(100 * error).toFixed(digits)}`;
  return `${(100 * share).toFixed(digits)}${more} %`;
}

/** How long it takes, before it begins. */
export function planWords(plan: TruthPlanBody | "unknown" | null): string {
  if (plan === null) return "Finding out how long it takes…";
  if (plan === "unknown") return "How long it takes is not known now; it is said while it runs.";
  const how = plan.is_measured ? "" : ", judged by other pictures; this one is being timed";
  return `${plan.passes} passes of brute force: ${formatForeseen(plan.seconds)}${how}.`;
}

type Progress = Pick<TruthBody, "state" | "passes" | "total" | "progress" | "problem" | "seconds_left">;

/** What it is at; `elapsed`: seconds that somebody has waited. */
export function progressWords(truth: Progress, elapsed: number): string {
  const soFar = `${Math.floor(elapsed)} s so far`;
  switch (truth.state) {
    case "queued":
      return `Waits for its turn, ${soFar}`;
    case "running": {
      if (truth.progress === 0) return `Preparing the picture, ${soFar}`;
      const left = truth.seconds_left === null ? "" : `, ${formatSeconds(truth.seconds_left)} left`;
      const ofPass = Math.round(100 * Math.min(1, Math.max(0, truth.progress * truth.total - truth.passes)));
      return `Brute force: pass ${Math.min(truth.passes + 1, truth.total)} of ${truth.total}, ${ofPass} % of it, ${soFar}${left}`;
    }
    case "ready":
      return `Brute force: ${truth.total} passes`;
    case "stopped":
      return `Stopped after ${truth.passes} of ${truth.total} passes`;
    case "failed":
      return truth.problem ?? "The comparison failed.";
  }
}

type Figures = NonNullable<TruthBody["found"]>;
export type Paths = TruthBody["paths"];

const AGAINST = { all: "all light paths", method: "the method's light paths" };

function error(found: Figures): string {
  if (found.error === null || found.standard_error === null) {
    return `the error is less than the noise, below ${percent(found.limit)}`;
  }
  return `the frame errs by ${percent(found.error, found.standard_error)}`;
}

/** How far the frame is from brute force, by both kinds of paths. */
export function verdicts(body: Pick<TruthBody, "found" | "found_of_method" | "left_out">): string[] {
  const { found, found_of_method } = body;
  if (found === null || found_of_method === null) return [];
  if (body.left_out.length === 0) return [`Against all light paths, which the method follows: ${error(found)} (relative RMSE).`];
  return [
    `Against ${AGAINST.all}: ${error(found)} (relative RMSE).`,
    `Against ${AGAINST.method}: ${error(found_of_method)} (relative RMSE).`,
  ];
}

/** What no figure, or only the first, knows of. */
export function omissions(body: Pick<TruthBody, "left_out" | "untraced">): string[] {
  return [
    ...body.left_out.map((what) => `The method leaves out: ${lower(what)}`),
    ...body.untraced.map((what) => `Brute force leaves out, too: ${lower(what)}`),
  ];
}

function lower(sentence: string): string {
  return sentence.charAt(0).toLowerCase() + sentence.slice(1);
}

/** What the map shows: whether pixels differ, and what the noise would hide. */
export function findings(found: Figures): string[] {
  const noise = `The noise of brute force is ${percent(found.noise)}; more passes lower it.`;
  if (found.significant === 0) return ["In the map no difference is found.", noise];
  return [`In the map ${percent(found.significant)} of the pixels differ by more than noise explains: they are coloured.`, noise];
}
