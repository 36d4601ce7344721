/** What has room in a row. */

export interface Part {
  name: string;
  /** CSS pixels; 0 where there is nothing to show. */
  width: number;
  /** What has the lowest rank makes room first. */
  rank: number;
}

/** Names of the parts that a row of `room` CSS pixels has no place for; then a button for them stands in it too. */
export function leaving(parts: readonly Part[], room: number, gap: number, button: number): string[] {
  const shown = parts.filter(({ width }) => width > 0).sort((a, b) => b.rank - a.rank);
  const long = (count: number) => shown.slice(0, count).reduce((sum, { width }) => sum + width + gap, 0);
  if (long(shown.length) - gap <= room) return [];
  let count = shown.length;
  while (count > 0 && long(count) + button > room) count -= 1;
  return shown.slice(count).map(({ name }) => name);
}
