/** What an import has to say about its file, grouped by what it does to the image. */
import type { SceneBody } from "../protocol";

type ImportWarning = SceneBody["warnings"][number];
type Severity = ImportWarning["severity"];

const WARNING_GROUPS: readonly { severity: Severity; title: string; short: string }[] = [
  { severity: "unsupported", title: "Looks other than in the file", short: "wrong" },
  { severity: "approximated", title: "Simplified: looks much the same", short: "simplified" },
  { severity: "ignored", title: "Not used: the picture is the same without", short: "unused" },
];

/** How many there are of each kind: "2 wrong, 1 simplified". */
export function warningCounts(warnings: readonly ImportWarning[]): string {
  const counts = WARNING_GROUPS.map(({ severity, short }) => [warnings.filter((each) => each.severity === severity).length, short]);
  return counts
    .filter(([count]) => count !== 0)
    .map(([count, short]) => `${count} ${short}`)
    .join(", ");
}

export function ImportWarnings({ warnings }: { warnings: readonly ImportWarning[] }) {
  return (
    <div class="remarks" role="group" aria-label="What the import says" tabIndex={0}>
      {WARNING_GROUPS.map(({ severity, title }) => {
        const groupWarnings = warnings.filter((warning) => warning.severity === severity);
        return (
          groupWarnings.length > 0 && (
            <section key={severity} class={`remark-${severity}`} aria-label={title}>
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
