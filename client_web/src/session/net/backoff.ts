/** Retry delays: doubling from a quarter second to eight seconds, with jitter. */
export function backoffMs(attempt: number, random: () => number = Math.random): number {
  const base = Math.min(8000, 250 * 2 ** Math.min(attempt, 10));
  return base * (0.8 + 0.4 * random());
}
