/** The first of "Look 1", "Look 2", … that is free, counted from after so many. */
export function freeName(taken: readonly string[], after = taken.length): string {
  let n = after + 1;
  while (taken.includes(`Look ${n}`)) n += 1;
  return `Look ${n}`;
}
