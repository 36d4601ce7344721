import { describe, expect, it } from "vitest";
import { findings, progressWords } from "../src/truth/words";

const found = { rmse: 0.02, noise: 0.012, error: 0.016, significant: 0.032 };

describe("how true a picture is, in words", () => {
  it("tells the frame's error apart from the noise", () => {
    const [error, noise, pixels] = findings(found);
    expect(error).toContain("1.6 %");
    expect(noise).toContain("1.2 %");
    expect(pixels).toContain("3.2 %");
  });

  it("does not call chance an error", () => {
    const said = findings({ ...found, error: 0, significant: 0.011 });
    expect(said[0]).toContain("No error beyond the noise");
    expect(said[2]).toContain("by chance");
  });

  it("shows small errors with two digits", () => {
    expect(findings({ ...found, error: 0.0016 })[0]).toContain("0.16 %");
  });

  it("counts the pass that is being made, and never beyond the last", () => {
    const at = (passes: number) => progressWords({ state: "running", passes, total: 16, problem: null });
    expect(at(0)).toContain("pass 1 of 16");
    expect(at(16)).toContain("pass 16 of 16");
    expect(progressWords({ state: "failed", passes: 0, total: 16, problem: "The disk is full." })).toBe("The disk is full.");
  });
});
