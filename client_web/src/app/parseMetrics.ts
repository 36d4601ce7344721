/** The value of a Prometheus gauge without labels; null if missing. */
export function parseGauge(text: string, name: string): number | null {
  const line = text.split("\n").find((candidate) => candidate.startsWith(`${name} `));
  const value = line === undefined ? Number.NaN : Number(line.slice(name.length));
  return Number.isFinite(value) ? value : null;
}
