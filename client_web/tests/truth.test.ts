import { describe, expect, it } from "vitest";
import { findings, planWords, progressWords } from "../src/truth/words";

const found = { rmse: 0.02, noise: 0.012, error: 0.016, limit: 0.018, significant: 0.032 };

describe("how true a picture is, in words", () => {
  it("tells the frame's error apart from the noise", () => {
    const [pixels, error, noise] = findings(found);
    expect(pixels).toContain("3.2 %");
    expect(error).toContain("errs by 1.6 %");
    expect(noise).toContain("1.2 %");
  });

  it("says of a frame whose pixels do not differ that it errs by less than the noise, never more", () => {
    const said = findings({ ...found, error: null, significant: 0 }).join(" ");
    expect(said).toContain("No difference was found");
    expect(said).toContain("less than the noise: below 1.8 %");
    expect(said).not.toContain("errs by");
    expect(said).not.toContain("differ by more");
  });

  it("does not call a frame right of which some pixels differ, however small that is on the whole", () => {
    const said = findings({ ...found, error: null }).join(" ");
    expect(said).toContain("3.2 % of the pixels differ");
    expect(said).toContain("Over the whole picture that is less than the noise");
    expect(said).not.toContain("No difference");
  });

  it("shows small errors with two digits", () => {
    expect(findings({ ...found, error: 0.0016 })[1]).toContain("0.16 %");
  });

  it("counts the pass that is being made, and never beyond the last", () => {
    const at = (passes: number) => progressWords({ state: "running", passes, total: 16, problem: null, seconds_left: null });
    expect(at(0)).toContain("pass 1 of 16");
    expect(at(16)).toContain("pass 16 of 16");
    const failed = { state: "failed" as const, passes: 0, total: 16, problem: "The disk is full.", seconds_left: null };
    expect(progressWords(failed)).toBe("The disk is full.");
  });

  it("says how long it takes, before and on the way, and where it was stopped", () => {
    expect(planWords({ passes: 16, seconds: 90 })).toMatch(/16 passes .* about \S/);
    const on = { state: "running" as const, passes: 4, total: 16, problem: null, seconds_left: 61 };
    expect(progressWords(on)).toContain("left");
    expect(progressWords({ ...on, state: "stopped", seconds_left: null })).toBe("Stopped after 4 of 16 passes");
  });
});
