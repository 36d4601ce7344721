/** Which items fit into a row. */

export interface RowItem {
  name: string;
  /** CSS pixels; 0 if the item is empty. */
  width: number;
  /** Items of the lowest rank overflow first. */
  rank: number;
}

/** Names of the items that do not fit into a row of `rowWidth` CSS pixels, which then also holds the menu button. */
export function overflowingItems(items: readonly RowItem[], rowWidth: number, gap: number, button: number): string[] {
  const visibleItems = items.filter(({ width }) => width > 0).sort((a, b) => b.rank - a.rank);
  const widthOfFirst = (count: number) => visibleItems.slice(0, count).reduce((sum, { width }) => sum + width + gap, 0);
  if (widthOfFirst(visibleItems.length) - gap <= rowWidth) return [];
  let count = visibleItems.length;
  while (count > 0 && widthOfFirst(count) + button > rowWidth) count -= 1;
  return visibleItems.slice(count).map(({ name }) => name);
}
