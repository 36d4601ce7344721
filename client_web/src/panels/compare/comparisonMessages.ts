/** Messages of the comparison with a reference. */
import type { ComparisonBody, ComparisonPlanBody } from "../../protocol";
import { formatEstimatedTime, formatSeconds } from "../../ui/scale";

/** A fraction in percent, with only the digits that its standard error supports. */
export function formatPercentWithError(fraction: number, standardError?: number): string {
  const size = 100 * (standardError ?? fraction);
  const digits =
    size > 0 ? Math.min(4, Math.max(0, (standardError === undefined ? 1 : 0) - Math.floor(Math.log10(size)))) : 2;
  const uncertainty = standardError === undefined ? "" : ` ± ${(100 * standardError).toFixed(digits)}`;
  return `${(100 * fraction).toFixed(digits)}${uncertainty} %`;
}

/** Estimated duration, before the start. */
export function comparisonPlanText(plan: ComparisonPlanBody | "unknown" | null): string {
  if (plan === null) return "Estimating time…";
  if (plan === "unknown") return "Time unknown; it will show once running.";
  const estimateNote = plan.is_measured ? "" : ", estimated from other pictures";
  return `${plan.passes} passes, ${formatEstimatedTime(plan.seconds)}${estimateNote}.`;
}

type ComparisonProgress = Pick<
  ComparisonBody,
  "state" | "completed" | "total" | "progress" | "problem" | "seconds_left"
>;

/** Current progress; `elapsed`: seconds since the start. */
export function comparisonProgressText(progress: ComparisonProgress, elapsed: number): string {
  const soFar = `${Math.floor(elapsed)} s elapsed`;
  switch (progress.state) {
    case "queued":
      return `Queued, ${soFar}`;
    case "running": {
      if (progress.progress === 0) return `Preparing the picture, ${soFar}`;
      const left = progress.seconds_left === null ? "" : `, ${formatSeconds(progress.seconds_left)} left`;
      const passPercent = Math.round(
        100 * Math.min(1, Math.max(0, progress.progress * progress.total - progress.completed)),
      );
      return `Reference: pass ${Math.min(progress.completed + 1, progress.total)} of ${progress.total} (${passPercent} %), ${soFar}${left}`;
    }
    case "ready":
      return `Reference: ${progress.total} passes`;
    case "canceled":
      return `Stopped after ${progress.completed} of ${progress.total} passes`;
    case "failed":
      return progress.problem ?? "The comparison failed.";
  }
}

type ErrorStats = NonNullable<ComparisonBody["error_all_paths"]>;
export type ComparedPaths = ComparisonBody["paths"];

const PATH_LABELS = { all: "all light paths", method: "simulated light paths" };

function errorText(stats: ErrorStats): string {
  if (stats.error === null || stats.standard_error === null) {
    return `below the noise, under ${formatPercentWithError(stats.error_upper_bound)}`;
  }
  return formatPercentWithError(stats.error, stats.standard_error);
}

/** Error of the frame against the reference with all light paths and with the simulated ones. */
export function errorSentences(
  body: Pick<ComparisonBody, "error_all_paths" | "error_method_paths" | "omitted_paths">,
): string[] {
  const { error_all_paths: errorOfAll, error_method_paths: errorOfMethod } = body;
  if (errorOfAll === null || errorOfMethod === null) return [];
  if (body.omitted_paths.length === 0) return [`Error: ${errorText(errorOfAll)} (relative RMSE).`];
  return [
    `Error, ${PATH_LABELS.all}: ${errorText(errorOfAll)} (relative RMSE).`,
    `Error, ${PATH_LABELS.method}: ${errorText(errorOfMethod)} (relative RMSE).`,
  ];
}

/** Light paths that the bake, or also the reference, does not simulate. */
export function omittedPathSentences(body: Pick<ComparisonBody, "omitted_paths" | "unsupported_paths">): string[] {
  return [
    ...body.omitted_paths.map((pathName) => `Not simulated here: ${lowerFirst(pathName)}`),
    ...body.unsupported_paths.map((pathName) => `Not in the reference either: ${lowerFirst(pathName)}`),
  ];
}

function lowerFirst(sentence: string): string {
  return sentence.charAt(0).toLowerCase() + sentence.slice(1);
}

/** Summary of the error map: the fraction of significantly different pixels, and the noise. */
export function mapSentences(stats: ErrorStats): string[] {
  const noise = `Reference noise: ${formatPercentWithError(stats.noise)}; more passes reduce it.`;
  if (stats.significant_pixel_fraction === 0) return ["No visible difference found.", noise];
  return [
    `${formatPercentWithError(stats.significant_pixel_fraction)} of the pixels differ by more than the noise (colored in the map).`,
    noise,
  ];
}
