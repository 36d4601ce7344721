/** Import warnings of one kind: sentences that differ only in names and numbers are one line. */
import type { SceneBody } from "../protocol";

type ImportWarning = SceneBody["warnings"][number];

export interface WarningKind {
  /** The sentence, for several warnings with "…" for each name and number in which they differ. */
  text: string;
  /** The first name or number in which they differ, of each; empty for a single warning or equal ones. */
  names: string[];
  warnings: ImportWarning[];
}

const VARIABLE = /“[^”]*”|\d[\d,.]*\d|\d/g;
const MAX_LISTED = 3;

/** Group warnings of one severity, in the order of the first of each kind. */
export function groupWarnings(warnings: readonly ImportWarning[]): WarningKind[] {
  const kinds = new Map<string, ImportWarning[]>();
  for (const warning of warnings) {
    const key = warning.text.replace(VARIABLE, "…");
    kinds.set(key, [...(kinds.get(key) ?? []), warning]);
  }
  return [...kinds.values()].map(summarize);
}

function summarize(warnings: ImportWarning[]): WarningKind {
  const rows = warnings.map(({ text }) => text.match(VARIABLE) ?? []);
  const differs = (rows[0] ?? []).map((value, k) => rows.some((row) => row[k] !== value));
  let index = 0;
  const text = (warnings[0]?.text ?? "").replace(VARIABLE, (value) => (differs[index++] ? withoutName(value) : value));
  // a name says more than a number
  const named = differs.findIndex((isDifferent, k) => isDifferent && rows[0]?.[k]?.startsWith("“"));
  const shown = named >= 0 ? named : differs.indexOf(true);
  const names = shown < 0 ? [] : [...new Set(rows.map((row) => (row[shown] ?? "").replace(/[“”]/g, "")))];
  return { text, names, warnings };
}

const withoutName = (value: string): string => (value.startsWith("“") ? "“…”" : "…");

/** "a.png, b.png, c.png and 2 more". */
export function namesText(names: readonly string[]): string {
  const more = names.length - MAX_LISTED;
  return `${names.slice(0, MAX_LISTED).join(", ")}${more > 0 ? ` and ${more} more` : ""}`;
}
