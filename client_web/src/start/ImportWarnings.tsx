/** Import warnings of a scene, grouped by their effect on the image. */
import type { SceneBody } from "../protocol";

type ImportWarning = SceneBody["warnings"][number];
type Severity = ImportWarning["severity"];

const WARNING_GROUPS: readonly { severity: Severity; title: string; short: readonly [string, string] }[] = [
  { severity: "unsupported", title: "Looks different from the source file", short: ["difference", "differences"] },
  { severity: "approximated", title: "Approximated, should look close", short: ["simplification", "simplifications"] },
  { severity: "ignored", title: "Ignored, no visible effect", short: ["ignored", "ignored"] },
];

/** Number of warnings by severity: "1 difference, 2 simplifications". */
export function warningCounts(warnings: readonly ImportWarning[]): string {
  const counts = WARNING_GROUPS.map(({ severity, short }) => ({
    count: warnings.filter((each) => each.severity === severity).length,
    short,
  }));
  return counts
    .filter(({ count }) => count !== 0)
    .map(({ count, short: [one, many] }) => `${count} ${count === 1 ? one : many}`)
    .join(", ");
}

export function ImportWarnings({ warnings }: { warnings: readonly ImportWarning[] }) {
  return (
    <div class="warnings" role="group" aria-label="Import warnings" tabIndex={0}>
      {WARNING_GROUPS.map(({ severity, title }) => {
        const groupWarnings = warnings.filter((warning) => warning.severity === severity);
        return (
          groupWarnings.length > 0 && (
            <section key={severity} class={`warning-${severity}`} aria-label={title}>
              <h3>
                {title} <span class="count">{groupWarnings.length}</span>
              </h3>
              <ul>
                {groupWarnings.map((warning, i) => (
                  <li key={i}>{warning.text}</li>
                ))}
              </ul>
            </section>
          )
        );
      })}
    </div>
  );
}
