import { describe, expect, it } from "vitest";
import {
  mapSentences,
  omittedPathSentences,
  formatPercentWithError,
  comparisonPlanText,
  comparisonProgressText,
  errorSentences,
} from "../src/panels/compare/comparisonMessages";

const stats = {
  rmse: 0.02,
  noise: 0.012,
  error: 0.0163,
  standard_error: 0.0021,
  error_upper_bound: 0.018,
  significant_pixel_fraction: 0.032,
};
const whole = { ...stats, error: 0.3271, standard_error: 0.0004 };
const left = ["Light that surfaces reflect onto each other."];
const body = { error_all_paths: whole, error_method_paths: stats, omitted_paths: left, unsupported_paths: [] };

describe("messages of the comparison", () => {
  it("give the errors for all and for simulated light paths, with standard errors", () => {
    const [all, method] = errorSentences(body);
    expect(all).toContain("Error, all light paths: 32.71 ± 0.04 %");
    expect(method).toContain("Error, simulated light paths: 1.6 ± 0.2 %");
    expect(omittedPathSentences(body)).toEqual(["Not simulated here: light that surfaces reflect onto each other."]);
  });

  it("give one error if all light paths are simulated", () => {
    expect(errorSentences({ ...body, omitted_paths: [] })).toHaveLength(1);
    expect(omittedPathSentences({ omitted_paths: [], unsupported_paths: ["Caustics."] })).toEqual([
      "Not in the reference either: caustics.",
    ]);
  });

  it("give no error below the noise", () => {
    const [, method] = errorSentences({
      ...body,
      error_method_paths: { ...stats, error: null, standard_error: null, significant_pixel_fraction: 0 },
    });
    expect(method).toContain("below the noise, under 1.8 %");
    expect(method).not.toContain("±");
  });

  it("summarize the error map and the noise", () => {
    expect(mapSentences(stats)[0]).toContain("3.2 % of the pixels differ");
    expect(mapSentences(stats)[1]).toContain("1.2 %");
    expect(mapSentences({ ...stats, significant_pixel_fraction: 0 })[0]).toContain("No visible difference");
  });

  it("show only significant digits", () => {
    expect(formatPercentWithError(0.0016)).toBe("0.16 %");
    expect(formatPercentWithError(0.0016, 0.00004)).toBe("0.160 ± 0.004 %");
    expect(formatPercentWithError(0.31, 0.02)).toBe("31 ± 2 %");
    expect(formatPercentWithError(0)).toBe("0.00 %");
  });

  it("count the current pass, at most the last", () => {
    const at = (completed: number, progress: number) =>
      comparisonProgressText(
        { state: "running", completed, total: 16, progress, problem: null, seconds_left: null },
        7.8,
      );
    expect(at(0, 0)).toBe("Preparing the picture, 7 s elapsed");
    expect(at(0, 0.02)).toBe("Reference: pass 1 of 16 (32 %), 7 s elapsed");
    expect(at(16, 1)).toContain("pass 16 of 16 (0 %)");
    const failed = {
      state: "failed" as const,
      completed: 0,
      total: 16,
      progress: 0,
      problem: "The disk is full.",
      seconds_left: null,
    };
    expect(comparisonProgressText(failed, 1)).toBe("The disk is full.");
  });

  it("give the estimated, remaining and completed work", () => {
    expect(comparisonPlanText({ passes: 16, seconds: 90, is_measured: true })).toMatch(/^16 passes, about [^,]*\.$/);
    expect(comparisonPlanText({ passes: 16, seconds: 90, is_measured: false })).toMatch(
      /about .*, estimated from other pictures/,
    );
    const on = { state: "running" as const, completed: 4, total: 16, progress: 0.3, problem: null, seconds_left: 61 };
    expect(comparisonProgressText(on, 3)).toContain("left");
    expect(comparisonProgressText({ ...on, state: "canceled", seconds_left: null }, 3)).toBe(
      "Stopped after 4 of 16 passes",
    );
  });
});
