/** What a comparison with brute force says, in sentences. */
import type { ComparisonBody, ComparisonPlanBody } from "../../protocol";
import { formatEstimatedTime, formatSeconds } from "../../ui/scale";

/** A fraction in percent, with no more digits than its standard error allows. */
export function formatPercentWithError(fraction: number, standardError?: number): string {
  const size = 100 * (standardError ?? fraction);
  const digits = size > 0 ? Math.min(4, Math.max(0, (standardError === undefined ? 1 : 0) - Math.floor(Math.log10(size)))) : 2;
  const uncertainty = standardError === undefined ? "" : ` ± ${(100 * standardError).toFixed(digits)}`;
  return `${(100 * fraction).toFixed(digits)}${uncertainty} %`;
}

/** How long it takes, before it begins. */
export function comparisonPlanText(plan: ComparisonPlanBody | "unknown" | null): string {
  if (plan === null) return "Finding out how long it takes…";
  if (plan === "unknown") return "How long it takes is not known now; it is said while it runs.";
  const estimateNote = plan.is_measured ? "" : ", judged by other pictures; this one is being timed";
  return `${plan.passes} passes of brute force: ${formatEstimatedTime(plan.seconds)}${estimateNote}.`;
}

type ComparisonProgress = Pick<ComparisonBody, "state" | "completed" | "total" | "progress" | "problem" | "seconds_left">;

/** What it is at; `elapsed`: seconds that somebody has waited. */
export function comparisonProgressText(progress: ComparisonProgress, elapsed: number): string {
  const soFar = `${Math.floor(elapsed)} s so far`;
  switch (progress.state) {
    case "queued":
      return `Waits for its turn, ${soFar}`;
    case "running": {
      if (progress.progress === 0) return `Preparing the picture, ${soFar}`;
      const left = progress.seconds_left === null ? "" : `, ${formatSeconds(progress.seconds_left)} left`;
      const passPercent = Math.round(100 * Math.min(1, Math.max(0, progress.progress * progress.total - progress.completed)));
      return `Brute force: pass ${Math.min(progress.completed + 1, progress.total)} of ${progress.total}, ${passPercent} % of it, ${soFar}${left}`;
    }
    case "ready":
      return `Brute force: ${progress.total} passes`;
    case "stopped":
      return `Stopped after ${progress.completed} of ${progress.total} passes`;
    case "failed":
      return progress.problem ?? "The comparison failed.";
  }
}

type ErrorStats = NonNullable<ComparisonBody["error_all_paths"]>;
export type ComparedPaths = ComparisonBody["paths"];

const PATH_LABELS = { all: "all light paths", method: "the method's light paths" };

function errorText(stats: ErrorStats): string {
  if (stats.error === null || stats.standard_error === null) {
    return `the error is less than the noise, below ${formatPercentWithError(stats.error_upper_bound)}`;
  }
  return `the frame errs by ${formatPercentWithError(stats.error, stats.standard_error)}`;
}

/** How far the frame is from brute force, by both kinds of paths. */
export function errorSentences(body: Pick<ComparisonBody, "error_all_paths" | "error_method_paths" | "omitted_paths">): string[] {
  const { error_all_paths: errorOfAll, error_method_paths: errorOfMethod } = body;
  if (errorOfAll === null || errorOfMethod === null) return [];
  if (body.omitted_paths.length === 0) return [`Against all light paths, which the method follows: ${errorText(errorOfAll)} (relative RMSE).`];
  return [
    `Against ${PATH_LABELS.all}: ${errorText(errorOfAll)} (relative RMSE).`,
    `Against ${PATH_LABELS.method}: ${errorText(errorOfMethod)} (relative RMSE).`,
  ];
}

/** What no figure, or only the first, knows of. */
export function omittedPathSentences(body: Pick<ComparisonBody, "omitted_paths" | "unsupported_paths">): string[] {
  return [
    ...body.omitted_paths.map((pathName) => `The method leaves out: ${lowerFirst(pathName)}`),
    ...body.unsupported_paths.map((pathName) => `Brute force leaves out, too: ${lowerFirst(pathName)}`),
  ];
}

function lowerFirst(sentence: string): string {
  return sentence.charAt(0).toLowerCase() + sentence.slice(1);
}

/** What the map shows: whether pixels differ, and what the noise would hide. */
export function mapSentences(stats: ErrorStats): string[] {
  const noise = `The noise of brute force is ${formatPercentWithError(stats.noise)}; more passes lower it.`;
  if (stats.significant_pixel_fraction === 0) return ["In the map no difference is found.", noise];
  return [`In the map ${formatPercentWithError(stats.significant_pixel_fraction)} of the pixels differ by more than noise explains: they are coloured.`, noise];
}
