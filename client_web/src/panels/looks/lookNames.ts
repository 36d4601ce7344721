/** The first unused name of "Look 1", "Look 2", …, starting after the given count. */
export function nextName(usedNames: readonly string[], after = usedNames.length): string {
  let n = after + 1;
  while (usedNames.includes(`Look ${n}`)) n += 1;
  return `Look ${n}`;
}
