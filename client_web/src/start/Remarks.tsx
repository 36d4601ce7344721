/** What an import has to say about its file, grouped by what it does to the picture. */
import type { SceneBody } from "../protocol";

type Remark = SceneBody["remarks"][number];
type Effect = Remark["effect"];

const GROUPS: readonly { effect: Effect; title: string; short: string }[] = [
  { effect: "wrong", title: "Looks other than in the file", short: "wrong" },
  { effect: "simplified", title: "Simplified: looks much the same", short: "simplified" },
  { effect: "unused", title: "Not used: the picture is the same without", short: "unused" },
];

/** How many there are of each kind: "2 wrong, 1 simplified". */
export function countsOf(remarks: readonly Remark[]): string {
  const counts = GROUPS.map(({ effect, short }) => [remarks.filter((each) => each.effect === effect).length, short]);
  return counts
    .filter(([count]) => count !== 0)
    .map(([count, short]) => `${count} ${short}`)
    .join(", ");
}

export function Remarks({ remarks }: { remarks: readonly Remark[] }) {
  return (
    <div class="remarks" role="group" aria-label="What the import says" tabIndex={0}>
      {GROUPS.map(({ effect, title }) => {
        const own = remarks.filter((remark) => remark.effect === effect);
        return (
          own.length > 0 && (
            <section key={effect} class={`remark-${effect}`} aria-label={title}>
              <h3>
                {title} <span class="count">{own.length}</span>
              </h3>
              <ul>
                {own.map((remark, i) => (
                  <li key={i}>{remark.text}</li>
                ))}
              </ul>
            </section>
          )
        );
      })}
    </div>
  );
}
