/** Curves of a polar plot of intensity, in the plane of C0 and C180, and in that of C90 and C270. */

/** Radius of the plot, and of its square's half side. */
export const PLOT_RADIUS = 40;

/** SVG path of two opposite half-planes, with the nadir downward; values at equal steps from the nadir to the zenith. */
export function polarCurve(right: readonly number[], left: readonly number[]): string {
  const point = (value: number, k: number, side: number, count: number) => {
    const angle = (Math.PI * k) / (count - 1);
    const [x, y] = [side * Math.sin(angle) * value, Math.cos(angle) * value].map((v) => (PLOT_RADIUS * v).toFixed(1));
    return `${x} ${y}`;
  };
  const points = [
    ...right.map((value, k) => point(value, k, 1, right.length)),
    ...left.map((value, k) => point(value, k, -1, left.length)).reverse(),
  ];
  return `M${points.join("L")}Z`;
}
