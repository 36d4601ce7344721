import { describe, expect, it } from "vitest";
import { findings, omissions, percent, planWords, progressWords, verdicts } from "../src/truth/words";

const found = { rmse: 0.02, noise: 0.012, error: 0.0163, standard_error: 0.0021, limit: 0.018, significant: 0.032 };
const whole = { ...found, error: 0.3271, standard_error: 0.0004 };
const left = ["Light that surfaces reflect onto each other."];
const body = { found: whole, found_of_method: found, left_out: left, untraced: [] };

describe("how true a picture is, in words", () => {
  it("tells both errors, against all paths and against the method's, each with its standard error", () => {
    const [all, method] = verdicts(body);
    expect(all).toContain("all light paths: the frame errs by 32.71 ± 0.04 %");
    expect(method).toContain("the method's light paths: the frame errs by 1.6 ± 0.2 %");
    expect(omissions(body)).toEqual(["The method leaves out: light that surfaces reflect onto each other."]);
  });

  it("tells one error where the method follows all paths", () => {
    expect(verdicts({ ...body, left_out: [] })).toHaveLength(1);
    expect(omissions({ left_out: [], untraced: ["Caustics."] })).toEqual(["Brute force leaves out, too: caustics."]);
  });

  it("never tells a number that is below the noise", () => {
    const [, method] = verdicts({ ...body, found_of_method: { ...found, error: null, standard_error: null, significant: 0 } });
    expect(method).toContain("the error is less than the noise, below 1.8 %");
    expect(method).not.toContain("errs by");
  });

  it("says what the map shows, and how much is noise", () => {
    expect(findings(found)[0]).toContain("3.2 % of the pixels differ");
    expect(findings(found)[1]).toContain("1.2 %");
    expect(findings({ ...found, significant: 0 })[0]).toContain("no difference");
  });

  it("shows as many digits as are known", () => {
    expect(percent(0.0016)).toBe("0.16 %");
    expect(percent(0.0016, 0.00004)).toBe("0.160 ± 0.004 %");
    expect(percent(0.31, 0.02)).toBe("31 ± 2 %");
    expect(percent(0)).toBe("0.00 %");
  });

  it("counts the pass that is being made, and never beyond the last", () => {
    const at = (passes: number, progress: number) =>
      progressWords({ state: "running", passes, total: 16, progress, problem: null, seconds_left: null }, 7.8);
    expect(at(0, 0)).toBe("Preparing the picture, 7 s so far");
    expect(at(0, 0.02)).toBe("Brute force: pass 1 of 16, 32 % of it, 7 s so far");
    expect(at(16, 1)).toContain("pass 16 of 16, 0 % of it");
    const failed = { state: "failed" as const, passes: 0, total: 16, progress: 0, problem: "The disk is full.", seconds_left: null };
    expect(progressWords(failed, 1)).toBe("The disk is full.");
  });

  it("says how long it takes, before and on the way, and where it was stopped", () => {
    expect(planWords({ passes: 16, seconds: 90, is_measured: true })).toMatch(/16 passes .* about [^,]*\.$/);
    expect(planWords({ passes: 16, seconds: 90, is_measured: false })).toMatch(/about .*, judged by other pictures/);
    const on = { state: "running" as const, passes: 4, total: 16, progress: 0.3, problem: null, seconds_left: 61 };
    expect(progressWords(on, 3)).toContain("left");
    expect(progressWords({ ...on, state: "stopped", seconds_left: null }, 3)).toBe("Stopped after 4 of 16 passes");
  });
});
