/** What an import has to say about its file, grouped by what it does to the image. */
import type { SceneBody } from "../protocol";

type ImportWarning = SceneBody["remarks"][number];
type WarningEffect = ImportWarning["effect"];

const WARNING_GROUPS: readonly { effect: WarningEffect; title: string; short: string }[] = [
  { effect: "wrong", title: "Looks other than in the file", short: "wrong" },
  { effect: "simplified", title: "Simplified: looks much the same", short: "simplified" },
  { effect: "unused", title: "Not used: the picture is the same without", short: "unused" },
];

/** How many there are of each kind: "2 wrong, 1 simplified". */
export function warningCounts(warnings: readonly ImportWarning[]): string {
  const counts = WARNING_GROUPS.map(({ effect, short }) => [warnings.filter((each) => each.effect === effect).length, short]);
  return counts
    .filter(([count]) => count !== 0)
    .map(([count, short]) => `${count} ${short}`)
    .join(", ");
}

export function ImportWarnings({ warnings }: { warnings: readonly ImportWarning[] }) {
  return (
    <div class="remarks" role="group" aria-label="What the import says" tabIndex={0}>
      {WARNING_GROUPS.map(({ effect, title }) => {
        const groupWarnings = warnings.filter((warning) => warning.effect === effect);
        return (
          groupWarnings.length > 0 && (
            <section key={effect} class={`remark-${effect}`} aria-label={title}>
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
