import { falseColor } from "../state/display";
/** Legend of the exposure heat map: stops relative to middle gray, in the shader's colors. */

const STEPS = [
  ["#050505", "< −6"],
  ["#381a73", "−6"],
  ["#1f4dbf", "−4"],
  ["#1a99a6", "−2"],
  ["#737373", "0"],
  ["#59b340", "+½"],
  ["#f2cc26", "+2"],
  ["#e6591a", "+4"],
  ["#ffffff", "> +6"],
] as const;

export function FalseColorLegend() {
  if (!falseColor.value) return null;
  return (
    <div class="legend" aria-label="Exposure heat map, stops relative to middle gray">
      {STEPS.map(([color, label]) => (
        <span key={label}>
          <i style={{ background: color }} />
          {label}
        </span>
      ))}
      <span class="unit">stops</span>
    </div>
  );
}
