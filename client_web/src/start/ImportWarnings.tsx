/** Import warnings of a scene, grouped by their effect on the image; those of one kind are one line that unfolds. */
import type { SceneBody } from "../protocol";
import { groupWarnings, namesText, type WarningKind } from "./warningKinds";

type ImportWarning = SceneBody["warnings"][number];
type Severity = ImportWarning["severity"];

const WARNING_GROUPS: readonly { severity: Severity; title: string; short: readonly [string, string] }[] = [
  { severity: "unsupported", title: "Differs from the file", short: ["difference", "differences"] },
  { severity: "approximated", title: "Simplified, should look close", short: ["simplification", "simplifications"] },
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

function Kind({ text, names, warnings }: WarningKind) {
  if (warnings.length === 1) return <li>{text}</li>;
  const line = (
    <>
      <b>{warnings.length} ×</b> {text} {names.length > 0 && <span class="names">{namesText(names)}</span>}
    </>
  );
  if (names.length === 0) return <li>{line}</li>;
  return (
    <li class="warning-kind">
      <details>
        <summary>{line}</summary>
        <ul>
          {warnings.map((warning, i) => (
            <li key={i}>{warning.text}</li>
          ))}
        </ul>
      </details>
    </li>
  );
}

export function ImportWarnings({ warnings }: { warnings: readonly ImportWarning[] }) {
  return (
    <div class="warnings" role="group" aria-label="Import warnings" tabIndex={0}>
      {WARNING_GROUPS.map(({ severity, title }) => {
        const ofSeverity = warnings.filter((warning) => warning.severity === severity);
        return (
          ofSeverity.length > 0 && (
            <section key={severity} class={`warning-${severity}`} aria-label={title}>
              <h3>
                {title} <span class="count">{ofSeverity.length}</span>
              </h3>
              <ul>
                {groupWarnings(ofSeverity).map((kind) => (
                  <Kind key={kind.warnings[0]?.text} {...kind} />
                ))}
              </ul>
            </section>
          )
        );
      })}
    </div>
  );
}
