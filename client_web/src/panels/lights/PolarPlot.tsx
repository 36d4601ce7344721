/** The intensity of an IES file over directions, as luminaire data sheets show it. */
import { PLOT_RADIUS, polarCurve } from "./polarPlot";

interface Props {
  /** Relative intensity in the planes C0, C90, C180 and C270. */
  planes: readonly (readonly number[])[];
  candela: number;
}

export function PolarPlot({ planes, candela }: Props) {
  const [c0, c90, c180, c270] = planes as [number[], number[], number[], number[]];
  const side = 2 * PLOT_RADIUS + 4;
  const maximum = `${candela.toLocaleString("en-US", { maximumFractionDigits: 0 })} cd`;
  return (
    <figure class="polar-plot">
      <svg
        viewBox={`${-side / 2} ${-side / 2} ${side} ${side}`}
        role="img"
        aria-label={`Intensity over directions, at most ${maximum}`}
      >
        <circle r={PLOT_RADIUS} />
        <circle r={PLOT_RADIUS / 2} />
        <path class="c90" d={polarCurve(c90, c270)} />
        <path class="c0" d={polarCurve(c0, c180)} />
      </svg>
      <figcaption>
        {maximum}
        <small>C0–C180 solid, C90–C270 dashed</small>
      </figcaption>
    </figure>
  );
}
