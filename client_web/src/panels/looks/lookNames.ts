/** The first of "Look 1", "Look 2", … that is free, counted from after so many. */
export function nextName(usedNames: readonly string[], after = usedNames.length): string {
  let n = after + 1;
  while (usedNames.includes(`Look ${n}`)) n += 1;
  return `Look ${n}`;
}
