/** The first of "Look 1", "Look 2", … that is free. */
export function freeName(taken: readonly string[]): string {
  let n = taken.length + 1;
  while (taken.includes(`Look ${n}`)) n += 1;
  return `Look ${n}`;
}
